//! Material maps as an untrained decoder's output: its weights are the parameters, its structure is the prior.

use super::texels::{Factors, LIMITS, MapState, Maps, other_maps};
use tessuto_core::error::Result;
use tessuto_render::decoder::{Decoder, DecoderConfig};

/// Steps that bring the decoder to the maps it starts from; they cost no rendering.
const WARM_UP: usize = 100;

/// Steps of its weights are this much shorter than those of texels: at the same length it dies.
const RATE: f64 = 0.3;

/// Maps made by a [`Decoder`].
pub(super) struct Decoded(Decoder);

impl Decoded {
    /// Maps of `size`, a multiple of [`DecoderConfig::LIGHT_STEP`], led to `planes` before anything else.
    pub fn new(size: usize, planes: &[f32], rate: f64, seed: u64) -> Self {
        let mut decoded = Self(Decoder::new(&DecoderConfig::light(size), seed));
        let scale = 2.0 / planes.len() as f32;
        for _ in 0..WARM_UP {
            let gradient: Vec<f32> =
                decoded.maps().iter().zip(planes).map(|(m, p)| scale * (m - p)).collect();
            decoded.step(&gradient, rate);
        }
        decoded
    }
}

impl Maps for Decoded {
    fn maps(&mut self) -> Vec<f32> {
        let mut maps = self.0.maps();
        for (plane, [low, high]) in planes(&mut maps) {
            plane.iter_mut().for_each(|v| *v = low + (high - low) * *v);
        }
        maps
    }

    fn save(&self) -> MapState {
        MapState::Decoder(self.0.state())
    }

    fn restore(&mut self, state: &MapState) -> Result<()> {
        match state {
            MapState::Decoder(state) if self.0.set_state(state) => Ok(()),
            _ => Err(other_maps()),
        }
    }

    fn step(&mut self, gradient: &[f32], rate: f64) {
        let mut gradient = gradient.to_vec();
        for (plane, [low, high]) in planes(&mut gradient) {
            plane.iter_mut().for_each(|g| *g *= high - low);
        }
        self.0.set_learning_rate(rate * RATE);
        self.0.step(&gradient);
    }

    /// The decoder's scale is fixed: the light's follows.
    fn rescale(&mut self, _: Factors<'_>) -> Option<[f64; 3]> {
        None
    }

    fn regroup(&mut self) {}
}

/// Each channel's values and limits.
fn planes(values: &mut [f32]) -> impl Iterator<Item = (&mut [f32], [f32; 2])> {
    let n = values.len() / LIMITS.len();
    values.chunks_exact_mut(n).zip(LIMITS.map(|l| l.map(|v| v as f32)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_from_the_planes_and_stays_within_the_limits() {
        let size = 32;
        let start: Vec<f32> = [0.8, 0.5, 0.2, 0.6, 0.3].iter().flat_map(|v| vec![*v; size * size]).collect();
        let mut decoded = Decoded::new(size, &start, 1e-2, 3);
        let error = |maps: &[f32]| {
            maps.iter().zip(&start).map(|(m, s)| (m - s).abs()).sum::<f32>() / start.len() as f32
        };
        assert!(error(&decoded.maps()) < 0.05, "{}", error(&decoded.maps()));
        // Roughness falls to its lowest value and no further.
        let gradient: Vec<f32> = (0..5).flat_map(|c| vec![f32::from(c == 3); size * size]).collect();
        (0..200).for_each(|_| decoded.step(&gradient, 1e-2));
        let maps = decoded.maps();
        let roughness = &maps[3 * size * size..4 * size * size];
        let mean = roughness.iter().sum::<f32>() / roughness.len() as f32;
        assert!(roughness.iter().all(|r| *r >= 0.3) && mean < 0.35, "{mean}");
    }
}
