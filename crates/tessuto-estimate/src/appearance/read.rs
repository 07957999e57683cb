//! Reads the files of an estimate.

use std::path::Path;

use super::write::{BACK, OfBack};
use crate::io;
use tessuto_core::error::{Error, Result};
use tessuto_core::image::srgb;
use tessuto_render::pbr::Material;

/// The maps in `folder`, as [`write_material`](super::write_material) leaves them; those of other programs may have
/// any size, the same for all three.
///
/// # Errors
/// [`Error::Input`] naming the file.
pub fn read_material(folder: &Path) -> Result<Material> {
    let diffuse = io::image::read(&folder.join("diffuse.png"))?;
    let size = [diffuse.width, diffuse.height];
    let grey = |name: &str| {
        let path = folder.join(name);
        let map = io::image::read_grey(&path)?;
        if [map.width, map.height] != size {
            return Err(Error::input(
                path.display().to_string(),
                format!("{}×{} px, diffuse.png has {}×{}", map.width, map.height, size[0], size[1]),
                "give all maps the same size",
            ));
        }
        Ok(map)
    };
    let (roughness, metallic) = (grey("roughness.png")?, grey("metallic.png")?);
    let mut planes: Vec<f32> =
        (0..3).flat_map(|c| diffuse.data.iter().skip(c).step_by(3)).map(|s| srgb::decode(*s)).collect();
    planes.extend(roughness.data);
    planes.extend(metallic.data);
    Ok(Material { back: back(&folder.join(BACK))?, ..Material::from_planes(size[0], size[1], &planes) })
}

/// The albedo of the other side in the file at `path`, if there is one.
fn back(path: &Path) -> Result<Option<[f32; 3]>> {
    if !path.is_file() {
        return Ok(None);
    }
    let bad =
        |problem: String| Error::input(path.display().to_string(), problem, "delete or restore the file");
    let OfBack { albedo } = serde_json::from_str(&io::read_text(path)?).map_err(|e| bad(e.to_string()))?;
    match albedo.iter().all(|v| (0.0..=1.0).contains(v)) {
        true => Ok(Some(albedo)),
        false => Err(bad(format!("an albedo of {albedo:?}, not from 0 to 1"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::appearance::{Appearance, Window, write_material};
    use tessuto_core::image::Image;
    use tessuto_core::mesh::grid;
    use tessuto_render::pbr::EnvironmentMap;

    #[test]
    fn maps_are_read_as_they_were_written() {
        let folder = tempfile::tempdir().unwrap();
        let mut material = Material::uniform(5, 3, [0.1, 0.4, 0.9], 0.3, 0.0);
        material.back = Some([0.25, 0.5, 0.125]);
        material.texels[7] = [0.9, 0.2, 0.05, 0.8, 1.0, 0.0, 0.0, 0.0];
        let window = Window::of(&grid(2, 2, glam::DVec2::ONE, 1.0));
        let written = Appearance {
            material,
            window,
            environment: EnvironmentMap::uniform(8, 4, [1.0; 3]),
            scale: None,
            history: Vec::new(),
        };
        write_material(folder.path(), &written).unwrap();
        let read = read_material(folder.path()).unwrap();
        assert_eq!(read.back, written.material.back);
        for (a, b) in read.texels.iter().flatten().zip(written.material.texels.iter().flatten()) {
            assert!((a - b).abs() < 0.006, "{a} {b}");
        }
        io::image::write_png(&folder.path().join("metallic.png"), &Image::new(4, 3, 1)).unwrap();
        let error = read_material(folder.path()).unwrap_err().to_string();
        assert!(error.contains("metallic.png") && error.contains("5×3"), "{error}");
    }
}
