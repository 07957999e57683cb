//! Cloth as a continuum: the second elastic model of [`Cloth`], beside the springs. Integrators, rollouts and
//! their adjoints are the same.
//!
//! Where φ-SfT uses ARCSim, this has constant coefficients instead of measured tables.
//! Source: Kairanda et al. 2022, "φ-SfT: Shape-from-Template with a Physics-Based Deformation Model".

use std::collections::BTreeMap;
use std::sync::Arc;

use super::cloth::{Cloth, lumped_masses};
use super::continuum::Continuum;
use super::hinge::Hinge;
use super::membrane::{Coefficients, Membrane};
use super::springs::SpringSides;
use super::stiffness::Stiffness;
use tessuto_core::math::block_matrix::BlockPattern;
use tessuto_core::math::factor::Analysis;
use tessuto_core::mesh::Mesh;

/// Elastic properties of a homogeneous fabric.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fabric {
    /// Tension per strain along the warp, the sides left free [N/m].
    pub warp: f64,
    /// The same along the weft [N/m].
    pub weft: f64,
    /// ν, geometric mean of the two Poisson ratios, in (−1, 1).
    pub poisson: f64,
    /// Shear force per angle [N/m].
    pub shear: f64,
    /// Moment per curvature and width `[J]`.
    pub bend: f64,
}

/// ∂L/∂ the properties of a [`Fabric`].
pub type FabricGradient = Fabric;

impl Fabric {
    /// c₁₁ = Y₁/(1 − ν²), c₂₂ = Y₂/(1 − ν²), c₁₂ = ν √(Y₁ Y₂)/(1 − ν²) and g of [`mod@super::membrane`].
    pub fn coefficients(&self) -> Coefficients {
        let free = 1.0 / (1.0 - self.poisson * self.poisson);
        let mixed = self.poisson * (self.warp * self.weft).sqrt();
        [self.warp * free, self.weft * free, mixed * free, self.shear]
    }

    /// Given `grad` = ∂L/∂ every element's coefficients, ∂L/∂ the properties that all have in common.
    pub fn vjp(&self, grad: &Stiffness) -> FabricGradient {
        let [g11, g22, g12, shear] =
            grad.membrane.iter().fold([0.0; 4], |sum, g| [0, 1, 2, 3].map(|k| sum[k] + g[k]));
        let nu = self.poisson;
        let free = 1.0 / (1.0 - nu * nu);
        let root = (self.warp * self.weft).sqrt();
        let by_free = g11 * self.warp + g22 * self.weft + g12 * nu * root;
        Fabric {
            warp: free * (g11 + g12 * nu * 0.5 * root / self.warp),
            weft: free * (g22 + g12 * nu * 0.5 * root / self.weft),
            poisson: free * g12 * root + by_free * 2.0 * nu * free * free,
            shear,
            bend: grad.hinge.iter().sum(),
        }
    }

    /// The same in every element of `cloth`.
    pub fn stiffness(&self, cloth: &Cloth) -> Stiffness {
        let mut all = Stiffness::uniform(cloth, [0.0; 3]);
        all.membrane.fill(self.coefficients());
        all.hinge.fill(self.bend);
        all
    }
}

impl Cloth {
    /// The continuum that is at rest in the shape of `template`, its warp along growing u.
    pub fn continuum(template: &Mesh) -> Self {
        let (x, triangles) = (&template.positions, template.triangles());
        let mut pairs = Vec::new();
        let mut triangle_pairs = Vec::with_capacity(triangles.len());
        let mut membranes = Vec::with_capacity(triangles.len());
        // Edge, and the apexes of the triangles on it, in a fixed order.
        let mut apexes: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
        for (&[a, b, c], corners) in triangles.iter().zip(template.triangle_uvs()) {
            let first = pairs.len();
            pairs.extend([[b, a], [c, a], [c, b]]);
            let own = [first, first + 1, first + 2];
            triangle_pairs.push(own);
            let uvs = corners.map(|k| template.uvs[k as usize]);
            let membrane = Membrane::new([a, b, c], [a, b, c].map(|v| x[v as usize]), uvs, own);
            // What has no area has no normal to bend from either.
            if let Some(membrane) = membrane {
                membranes.push(membrane);
                for [i, j, apex] in [[a, b, c], [b, c, a], [c, a, b]] {
                    apexes.entry([i.min(j), i.max(j)]).or_default().push(apex);
                }
            }
        }
        let mut hinges = Vec::new();
        for ([i, j], apexes) in apexes {
            for two in apexes.windows(2) {
                let [a, b, c, d] = [i, j, two[0], two[1]];
                let first = pairs.len();
                pairs.extend([[b, a], [c, a], [d, a], [c, b], [d, b], [d, c]]);
                hinges.push(Hinge::new([a, b, c, d], x, [0, 1, 2, 3, 4, 5].map(|k| first + k)));
            }
        }
        let pattern = BlockPattern::new(x, &pairs);
        let analysis = Analysis::new(&pattern);
        Self {
            masses: lumped_masses(template),
            edges: Vec::new(),
            bends: Vec::new(),
            shears: Vec::new(),
            continuum: Some(Continuum::new(membranes, hinges, &pattern)),
            sides: SpringSides::default(),
            triangles: template.triangles(),
            triangle_pairs,
            pattern: Arc::new(pattern),
            analysis: Arc::new(analysis),
            lattice: None,
            contact: None,
        }
    }
}
