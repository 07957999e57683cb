//! Where the derivatives of many points add up.

use super::material::Footprint;

/// Derivatives and losses of one part of the points, summed.
#[derive(Debug, Clone, Default)]
pub(super) struct GradientSums {
    /// With respect to the material, by texel.
    pub material: Vec<[f32; 8]>,
    /// With respect to the radiance, by texel of the environment map.
    pub light: Vec<[f32; 4]>,
    /// Sum of the losses.
    pub loss: f64,
}

impl GradientSums {
    /// Zeros for this many texels of the material and of the environment map.
    pub fn clear(&mut self, texels: usize, light: usize) {
        self.material.clear();
        self.material.resize(texels, [0.0; 8]);
        self.light.clear();
        self.light.resize(light, [0.0; 4]);
        self.loss = 0.0;
    }

    /// Spreads a derivative over the texels that the value was interpolated from.
    #[inline]
    pub fn add_material(&mut self, footprint: &Footprint, gradient: &[f32; 8]) {
        for (texel, weight) in footprint.texels.iter().zip(footprint.weights) {
            let sum = &mut self.material[*texel as usize];
            sum.iter_mut().zip(gradient).for_each(|(s, g)| *s += weight * g);
        }
    }

    /// Adds to one texel of the environment map.
    #[inline]
    pub fn add_light(&mut self, texel: u32, [r, g, b]: [f32; 3]) {
        let sum = &mut self.light[texel as usize];
        *sum = [sum[0] + r, sum[1] + g, sum[2] + b, 0.0];
    }
}
