//! template.json: what is known of the making of a scene's template. It holds for the template.obj beside it as
//! long as that is the same, byte for byte.

use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::io::depth_unit::Unit;
use crate::io::text::decode;
use crate::io::{atomic_write, read_bounded};
use crate::template::table::{FoundPlane, Residual};
use tessuto_core::error::{Error, Result};

/// What a template was made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TemplateKind {
    /// A rectangle of known size.
    Flat,
    /// A depth map of the first frame.
    Depth,
    /// An outline on a table.
    Outline,
    /// A mesh.
    Mesh,
}

/// A camera that was found with the template.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CameraRecord {
    /// What it was found from.
    pub source: String,
    /// Focal length along x `[px]`.
    pub fx: f64,
    /// Focal length along y `[px]`.
    pub fy: f64,
    /// Shortest and longest focal length that would do, at one standard deviation `[px]`, where it was estimated.
    pub interval: Option<[f64; 2]>,
}

/// What a depth map was like.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DepthRecord {
    /// Name of the file.
    pub file: String,
    /// Standard deviation of a pixel's depth from those around it `[m]`.
    pub noise: f64,
    /// Fraction of the fabric in which nothing usable was measured, in [0, 1].
    pub filled: f64,
    /// What a unit of the file was assumed to be `[m]`.
    #[serde(default)]
    pub unit: Option<f64>,
    /// Whether the unit was given; else it is what such files usually have.
    #[serde(default)]
    pub unit_told: bool,
}

/// The plane of the table that the fabric lies on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TableRecord {
    /// What it was found from.
    pub source: String,
    /// One of its points, camera frame of the first frame `[m]`.
    pub point: [f64; 3],
    /// Its normal towards the camera, of length 1.
    pub normal: [f64; 3],
    /// How far a sheet of paper's corners are from those seen, root mean square `[px]`.
    pub residual_px: Option<f64>,
    /// How far measured depths are off, root mean square `[m]`.
    pub residual_m: Option<f64>,
    /// Standard deviation of its tilt `[rad]`.
    pub tilt_deviation: Option<f64>,
    /// Standard deviation of lengths on it, as a fraction.
    pub length_deviation: Option<f64>,
    /// Angle to another plane that fits nearly as well `[rad]`.
    pub rival: Option<f64>,
}

impl TableRecord {
    /// Of a plane that was found from `source`.
    pub fn of(found: &FoundPlane, source: impl Into<String>) -> Self {
        let residual = |unit: fn(Residual) -> Option<f64>| found.residual.and_then(unit);
        Self {
            source: source.into(),
            point: found.plane.point.to_array(),
            normal: found.plane.normal.to_array(),
            residual_px: residual(|r| if let Residual::Pixels(off) = r { Some(off) } else { None }),
            residual_m: residual(|r| if let Residual::Metres(off) = r { Some(off) } else { None }),
            tilt_deviation: found.tilt_deviation,
            length_deviation: found.length_deviation,
            rival: found.rival,
        }
    }
}

/// See the module.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TemplateRecord {
    /// What it was made of.
    pub kind: TemplateKind,
    /// Width along the upper side and height of the rectangle, or of the outline along the image's rows `[m]`.
    pub size: Option<[f64; 2]>,
    /// Corners in the first frame, clockwise from the upper left `[px]`.
    pub corners: Option<[[f64; 2]; 4]>,
    /// Root mean square distance of a plane rectangle's corners from those seen `[px]`.
    pub residual: Option<f64>,
    /// Whether that is near enough for the sheet to be plane.
    pub plane: Option<bool>,
    /// Whether the rectangle tilted the other way would do nearly as well.
    pub ambiguous: Option<bool>,
    /// Overlap with the mask of the first frame (intersection over union), where there is one.
    pub overlap: Option<f64>,
    /// The camera, where it was found with the template.
    pub camera: Option<CameraRecord>,
    /// The depth map, where it was made of one.
    pub depth: Option<DepthRecord>,
    /// The table, where the fabric lies on one.
    #[serde(default)]
    pub table: Option<TableRecord>,
    /// SHA-256 of the template.obj it is about, set when it is [written](Self::write).
    #[serde(default)]
    pub template_sha256: String,
}

impl TemplateRecord {
    /// Name of the file.
    pub const NAME: &'static str = "template.json";

    /// Nothing known but what it was made of.
    pub fn new(kind: TemplateKind) -> Self {
        Self {
            kind,
            size: None,
            corners: None,
            residual: None,
            plane: None,
            ambiguous: None,
            overlap: None,
            camera: None,
            depth: None,
            table: None,
            template_sha256: String::new(),
        }
    }

    /// Writes it beside the template.obj in `folder`, which it is about.
    ///
    /// # Errors
    /// [`Error::Input`] if template.obj cannot be read; [`Error::Output`].
    pub fn write(&self, folder: &Path) -> Result<()> {
        let record = Self { template_sha256: digest(folder)?, ..self.clone() };
        let text = serde_json::to_string_pretty(&record).expect("plain data") + "\n";
        atomic_write(&folder.join(Self::NAME), text.as_bytes())
    }

    /// What is known of the template in `folder`; `None` also where template.obj has changed since.
    pub fn read(folder: &Path) -> Option<Self> {
        let bytes = read_bounded(&folder.join(Self::NAME), 1 << 20).ok()?;
        let record: Self = serde_json::from_str(&decode(bytes, Self::NAME).ok()?).ok()?;
        (digest(folder).ok()? == record.template_sha256).then_some(record)
    }

    /// In words, for a table.
    pub fn sentence(&self) -> String {
        let size = self.size.map_or_else(String::new, |[w, h]| format!(" of {w:.3}×{h:.3} m"));
        let mut parts = vec![match (self.kind, self.residual) {
            (TemplateKind::Flat, Some(off)) => format!("flat sheet{size}, its corners off by {off:.2} px"),
            (TemplateKind::Flat, None) => format!("flat sheet{size}"),
            (TemplateKind::Outline, _) => format!("outline{size} on a table"),
            (TemplateKind::Depth, _) => "from a depth map".to_owned(),
            (TemplateKind::Mesh, _) => "from a mesh".to_owned(),
        }];
        parts.extend(self.depth.as_ref().map(|d| {
            let (noise, filled) = (1e3 * d.noise, 100.0 * d.filled);
            let unit = d.unit.map(|metres| Unit { metres, told: d.unit_told }.name());
            let unit = unit.map_or_else(String::new, |name| format!(" in units of {name}"));
            format!("{}{unit}, noise {noise:.1} mm, {filled:.0} % filled in", d.file)
        }));
        parts.extend(self.table.as_ref().map(|table| match table.length_deviation {
            Some(part) => format!("the table from {}, lengths ± {:.1} %", table.source, 100.0 * part),
            None => format!("the table from {}", table.source),
        }));
        parts.extend(self.camera.as_ref().map(|c| match c.interval {
            Some([low, high]) => format!("focal length {:.0} px ({low:.0} to {high:.0}) {}", c.fx, c.source),
            None => format!("camera {}", c.source),
        }));
        parts.join("; ")
    }
}

fn digest(folder: &Path) -> Result<String> {
    let path = folder.join("template.obj");
    let bytes = std::fs::read(&path).map_err(|e| {
        Error::input(path.display().to_string(), format!("cannot be read: {e}"), "make the template first")
    })?;
    Ok(Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_holds_for_its_template_only() {
        let folder = tempfile::tempdir().unwrap();
        let record = TemplateRecord {
            size: Some([0.55, 0.56]),
            residual: Some(1.5),
            camera: Some(CameraRecord {
                source: "estimated from the corners".into(),
                fx: 800.0,
                fy: 800.0,
                interval: Some([760.0, 850.0]),
            }),
            ..TemplateRecord::new(TemplateKind::Flat)
        };
        assert!(record.write(folder.path()).is_err());
        std::fs::write(folder.path().join("template.obj"), "v 0 0 1\n").unwrap();
        record.write(folder.path()).unwrap();
        let found = TemplateRecord::read(folder.path()).unwrap();
        assert_eq!(TemplateRecord { template_sha256: String::new(), ..found.clone() }, record);
        assert_eq!(
            found.sentence(),
            "flat sheet of 0.550×0.560 m, its corners off by 1.50 px; focal length 800 px (760 to 850) \
             estimated from the corners"
        );
        // Of an outline, and of one that an older version wrote.
        let outline = TemplateRecord {
            size: Some([0.6, 0.5]),
            table: Some(TableRecord {
                source: "a sheet of paper".into(),
                point: [0.0, 0.0, 1.0],
                normal: [0.0, 0.0, -1.0],
                residual_px: Some(0.4),
                residual_m: None,
                tilt_deviation: Some(0.01),
                length_deviation: Some(0.012),
                rival: None,
            }),
            ..TemplateRecord::new(TemplateKind::Outline)
        };
        outline.write(folder.path()).unwrap();
        let found = TemplateRecord::read(folder.path()).unwrap();
        assert_eq!(
            found.sentence(),
            "outline of 0.600×0.500 m on a table; the table from a sheet of paper, lengths ± 1.2 %"
        );
        let mut old = serde_json::to_value(&record).unwrap();
        old.as_object_mut().unwrap().remove("table");
        assert_eq!(serde_json::from_value::<TemplateRecord>(old).unwrap(), record);
        std::fs::write(folder.path().join("template.obj"), "v 0 0 2\n").unwrap();
        assert_eq!(TemplateRecord::read(folder.path()), None);
    }
}
