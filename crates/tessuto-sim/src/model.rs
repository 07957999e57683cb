//! The elastic models by name, and of each the one table of the properties that a homogeneous cloth of it has.
//! What is searched, written, read, shown and changed by name follows from the table.

use serde::{Deserialize, Serialize};

use super::cloth::Cloth;
use super::fabric::Fabric;
use super::stiffness::Stiffness;
use tessuto_core::mesh::Mesh;

/// How the cloth resists.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Model {
    /// Springs along the edges of the mesh and between them.
    #[default]
    Springs,
    /// Membranes and hinges, on any mesh.
    Continuum,
}

/// A property of a homogeneous cloth, above 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Property {
    /// Its name in files and settings.
    pub key: &'static str,
    /// Its name for people.
    pub label: &'static str,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
}

impl Property {
    /// Its unit in letters that every program reads.
    pub fn plain_unit(&self) -> String {
        self.unit.replace('²', "^2")
    }
}

const fn property(key: &'static str, label: &'static str, unit: &'static str) -> Property {
    Property { key, label, unit }
}

const SPRINGS: [Property; 3] = [
    property("stretch", "stretch stiffness", "N/m"),
    property("bend", "bend stiffness", "J/rad²"),
    property("shear", "shear stiffness", "J/rad²"),
];

const CONTINUUM: [Property; 5] = [
    property("warp", "stretch stiffness along the warp", "N/m"),
    property("weft", "stretch stiffness along the weft", "N/m"),
    property("poisson", "Poisson ratio", ""),
    property("shear", "shear stiffness", "N/m"),
    property("bend", "bend stiffness", "J"),
];

impl Model {
    /// Their names.
    pub const NAMES: &[&str] = &["springs", "continuum"];

    /// Its properties, in the order of every list of their values.
    pub fn properties(self) -> &'static [Property] {
        match self {
            Self::Springs => &SPRINGS,
            Self::Continuum => &CONTINUUM,
        }
    }

    /// The cloth that is at rest in the shape of `template`.
    pub fn cloth(self, template: &Mesh) -> Cloth {
        match self {
            Self::Springs => Cloth::new(template),
            Self::Continuum => Cloth::continuum(template),
        }
    }

    /// Every element's stiffness in a homogeneous `cloth`, given the `values` of its properties.
    ///
    /// # Panics
    /// If these are not as many as the model has.
    pub fn stiffness(self, cloth: &Cloth, values: &[f64]) -> Stiffness {
        match self {
            Self::Springs => Stiffness::uniform(cloth, values.try_into().expect("one value per property")),
            Self::Continuum => fabric(values).stiffness(cloth),
        }
    }

    /// Given `grad` = ∂L/∂ every element's stiffness, ∂L/∂log10 of the properties, which have these `values`.
    ///
    /// # Panics
    /// As [`stiffness`](Self::stiffness).
    pub fn grad_log10(self, grad: &Stiffness, values: &[f64]) -> Vec<f64> {
        match self {
            Self::Springs => grad.grad_log10(values.try_into().expect("one value per property")).to_vec(),
            Self::Continuum => {
                let Fabric { warp, weft, poisson, shear, bend } = fabric(values).vjp(grad);
                let by_value = [warp, weft, poisson, shear, bend];
                by_value.iter().zip(values).map(|(g, k)| g * k * std::f64::consts::LN_10).collect()
            }
        }
    }
}

fn fabric(values: &[f64]) -> Fabric {
    let [warp, weft, poisson, shear, bend] = values.try_into().expect("one value per property");
    Fabric { warp, weft, poisson, shear, bend }
}
