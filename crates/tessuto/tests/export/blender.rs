//! The script for Blender: what it is told, that it is Python, and that it asks Blender for what was measured to
//! be right.

use std::path::Path;
use std::process::Command;

use tessuto::export::{Clip, Format, export};
use tessuto::io::hdr::write_exr;
use tessuto::{Camera, Image};

use super::files::clip;
use crate::support::missing::not_tested;

/// A module `bpy` that writes down what is asked of it.
const FAKE: &str = r#"
import types
class Any:
    def __init__(self, name): self.__dict__["name"] = name
    def __getattr__(self, key): return self.__dict__.setdefault(key, Any(self.name + "." + key))
    def __setattr__(self, key, value): self.__dict__[key] = value; print("%s.%s = %s" % (self.name, key, told(value)))
    def __call__(self, *arguments, **named):
        said = [told(a) for a in arguments] + ["%s=%s" % (k, told(v)) for k, v in named.items()]
        print("%s(%s)" % (self.name, ", ".join(said)))
        return Any(self.name + "()")
    def __getitem__(self, key): return self.__dict__.setdefault("[%s]" % key, Any("%s[%s]" % (self.name, key)))
    def __iter__(self): return iter(())
    def __bool__(self): return True
    def __repr__(self): return self.name
    def get(self, key): return None
def told(value):
    if isinstance(value, float): return "%.6g" % value
    if isinstance(value, tuple): return "(" + ", ".join(told(v) for v in value) + ")"
    return str(value)
context, data, ops, path = Any("context"), Any("data"), Any("ops"), Any("path")
context.__dict__["space_data"] = None
"#;

/// What the script in `folder` asks of Blender, or why it failed.
fn asked(folder: &Path) -> Option<String> {
    std::fs::write(folder.join("bpy.py"), FAKE).unwrap();
    let output = Command::new("python3")
        .env("PYTHONPATH", folder)
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .arg(folder.join("cloth_blender.py"))
        .output();
    let output = output.ok()?;
    std::fs::remove_file(folder.join("bpy.py")).unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{said}\n{}", String::from_utf8_lossy(&output.stderr));
    Some(said)
}

#[test]
fn blender_is_told_time_camera_video_and_light() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let light = Image { width: 4, height: 2, channels: 3, data: vec![0.5; 24] };
    write_exr(&at("light.exr"), &light).unwrap();
    std::fs::create_dir_all(at("scene/rgbs")).unwrap();
    std::fs::write(at("scene/rgbs/rgb_007.png"), "").unwrap();
    let lit = Clip {
        fps: 30_000.0 / 1001.0,
        video: Some(at("scene/rgbs/rgb_007.png")),
        environment: Some(std::fs::read(at("light.exr")).unwrap()),
        ..clip(true)
    };
    let written = export(&lit, &[Format::Glb], &at("out"), false).unwrap();
    let names: Vec<_> =
        written.iter().map(|p| p.file_name().unwrap().to_string_lossy().into_owned()).collect();
    assert_eq!(names, ["cloth.glb", "cloth_blender.py", "cloth_environment.exr"]);
    // Another format later finds them as they would be: nothing to replace, nothing refused.
    assert_eq!(export(&lit, &[Format::Usd], &at("out"), false).unwrap().len(), 2);
    let Some(said) = asked(&at("out")) else { return not_tested("python3") };
    // fx 700, fy 650, centre (300, 250) of 640×480.
    let shift = [(639.0 / 2.0 - 300.0) / 640.0, (250.0 - 479.0 / 2.0) * (700.0 / 650.0) / 640.0];
    for expected in [
        // The importer multiplies by it; then the scene's own rate.
        "render.fps_base = 0.999001\n".to_owned(),
        "render.fps_base = 1.001\n".to_owned(),
        "context.scene.frame_end = 3".to_owned(),
        "render.resolution_x = 640".to_owned(),
        "render.pixel_aspect_x = 1\n".to_owned(),
        "render.pixel_aspect_y = 1.07692".to_owned(),
        format!(".lens = {:.6}", 700.0 * 36.0 / 640.0).trim_end_matches('0').to_owned(),
        format!(".shift_x = {}", &shift[0].to_string()[..8]),
        format!(".shift_y = {}", &shift[1].to_string()[..8]),
        ".rotation_euler = (1.5708, 0, 0)".to_owned(),
        "scene.camera = ".to_owned(),
        ".image_user.frame_offset = 6".to_owned(),
        "[Rotation].default_value = (0, 0, -1.5708)".to_owned(),
        "ops.import_scene.gltf(".to_owned(),
        "view_transform = Standard".to_owned(),
    ] {
        assert!(said.contains(&expected), "{expected:?} is missing in:\n{said}");
    }
    assert!(said.contains("rgb_007.png") && said.contains("cloth_environment.exr"), "{said}");
    let import = said.find("import_scene").unwrap();
    assert!(said.find("fps_base = 0.999").unwrap() < import, "{said}");
    assert!(said.rfind("fps_base = 1.001").unwrap() > import, "{said}");
    // The light's file is the recovered one.
    assert_eq!(
        std::fs::read(at("out/cloth_environment.exr")).unwrap(),
        std::fs::read(at("light.exr")).unwrap()
    );
}

#[test]
fn without_light_and_video_the_script_still_works() {
    let home = tempfile::tempdir().unwrap();
    let tall = Clip { camera: Camera { fx: 600.0, ..clip(false).camera }, ..clip(false) };
    export(&tall, &[Format::Usd], home.path(), false).unwrap();
    let Some(said) = asked(home.path()) else { return not_tested("python3") };
    assert!(said.contains("pixel_aspect_x = 1.08333") && said.contains("pixel_aspect_y = 1\n"), "{said}");
    assert!(said.contains("no background") && said.contains("ops.wm.usd_import("), "{said}");
    assert!(said.contains("[Color].default_value = (1, 1, 1, 1)") && !said.contains("Rotation"), "{said}");
    // Formats that Blender's importers of scenes do not read bring no script.
    let other = tempfile::tempdir().unwrap();
    assert_eq!(export(&tall, &[Format::Npz], other.path(), false).unwrap().len(), 1);
}

#[test]
fn usd_has_the_light_and_the_size_for_square_pixels() {
    let home = tempfile::tempdir().unwrap();
    let lit = Clip { environment: Some(vec![1, 2, 3]), ..clip(false) };
    export(&lit, &[Format::Usd], home.path(), false).unwrap();
    let text = std::fs::read_to_string(home.path().join("cloth.usda")).unwrap();
    assert!(text.contains("def DomeLight \"Light\"") && text.contains("@./cloth_environment.exr@"));
    assert!(text.contains("double xformOp:rotateY = 180"));
    // 480 rows of 700 / 650.
    assert!(text.contains("uniform int2 resolution = (640, 517)") && text.contains("</cloth/Camera>"));
    export(&clip(false), &[Format::Usd], &home.path().join("dark"), false).unwrap();
    assert!(!std::fs::read_to_string(home.path().join("dark/cloth.usda")).unwrap().contains("DomeLight"));
}
