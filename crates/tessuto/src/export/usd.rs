//! USD as text: the template's polygons with points, normals and extent as time samples, a preview surface with
//! the maps, the exact camera, the light where it was estimated, and the size at which square pixels show the
//! video. With estimated physics also what a simulator takes: [`usd_fabric`].
//!
//! Source: Pixar, *USD documentation*, UsdGeomMesh, UsdGeomCamera, *UsdPreviewSurface Specification*.

use std::fmt::Write as _;

use glam::{DVec3, Vec3};
use tessuto_core::parallel;

use super::clip::identifier;
use super::row::{Output, Row};
use super::{Clip, usd_fabric};
use tessuto_core::camera::{Camera, Pose};

/// Width of the camera's film [tenths of a metre, as USD counts it]: that of 35 mm film.
const FILM_WIDTH: f64 = 0.36;

/// The row of the format.
pub(super) const FORMAT: Row = Row {
    key: "usd",
    programs: "Houdini, Unreal, Newton",
    content: "text: points as time samples, material, camera, physics (y up)",
    files: &[
        (".usda", "moving mesh with camera, light and physics: Houdini, Unreal, Newton"),
        ("_textures", "texture and maps of the USD file"),
    ],
    feature: None,
    for_blender: true,
    outputs: |clip| {
        let textures = format!("{}_textures", clip.name);
        let text = encode(clip, &textures);
        Ok(vec![
            Output::Folder(textures, clip.material.files()),
            Output::File(format!("{}.usda", clip.name), text),
        ])
    },
};

/// The file; its images lie in the folder `textures` beside it.
fn encode(clip: &Clip, textures: &str) -> Vec<u8> {
    let (name, last, fps) = (&clip.name, clip.frame_count - 1, clip.fps);
    let left_out = clip.left_out();
    let remark = if left_out.is_empty() {
        String::new()
    } else {
        format!("; frames of the video without samples, because they were lost: {left_out:?}")
    };
    let mut out = format!(
        "#usda 1.0\n(\n    defaultPrim = \"{name}\"\n    doc = \"tessuto {}{remark}\"\n    \
         startTimeCode = 0\n    \
         endTimeCode = {last}\n    timeCodesPerSecond = {fps}\n    framesPerSecond = {fps}\n    \
         metersPerUnit = 1\n    kilogramsPerUnit = 1\n    \
         renderSettingsPrimPath = \"/Render/Video\"\n    upAxis = \"Y\"\n)\n\ndef Xform \"{name}\" (\n    \
         kind = \"component\"\n)\n{{\n",
        clip.version
    );
    mesh(clip, &mut out);
    material(clip, textures, &mut out);
    let own: Option<Vec<Pose>> = (0..clip.motion.len()).map(|k| clip.camera_y_up(k)).collect();
    camera("Camera", &clip.camera, &path(clip, &own.unwrap_or_default()), &mut out);
    for other in &clip.others {
        let name = format!("Camera_{}", identifier(&other.name));
        camera(&name, &other.camera, &path(clip, &clip.path_y_up(other)), &mut out);
    }
    light(clip, &mut out);
    usd_fabric::simulation(clip, &mut out);
    out.push_str("}\n");
    render_settings(clip, &mut out);
    out.into_bytes()
}

fn list<T>(values: impl IntoIterator<Item = T>, text: impl Fn(&mut String, T)) -> String {
    let mut out = String::from("[");
    for (k, value) in values.into_iter().enumerate() {
        if k > 0 {
            out.push_str(", ");
        }
        text(&mut out, value);
    }
    out.push(']');
    out
}

/// `values` in brackets.
pub(super) fn vectors(values: &[Vec3]) -> String {
    list(values, |out, v| {
        let _ = write!(out, "({}, {}, {})", v.x, v.y, v.z);
    })
}

/// `values` in brackets.
pub(super) fn integers(values: impl IntoIterator<Item = u32>) -> String {
    list(values, |out, v| {
        let _ = write!(out, "{v}");
    })
}

/// The corners of the box around `points`.
pub(super) fn bounds(points: &[Vec3]) -> String {
    let low = points.iter().copied().reduce(Vec3::min).unwrap_or_default();
    let high = points.iter().copied().reduce(Vec3::max).unwrap_or_default();
    vectors(&[low, high])
}

fn samples(clip: &Clip, of: impl Fn(usize) -> String + Sync) -> String {
    let lines: Vec<String> =
        parallel::map(clip.motion.len(), |k| format!("            {}: {},\n", clip.frames[k], of(k)));
    format!("{{\n{}        }}", lines.concat())
}

fn mesh(clip: &Clip, out: &mut String) {
    let (mesh, name) = (&clip.mesh, &clip.name);
    let counts = integers(mesh.faces.iter().map(|f| f.vertices.len() as u32));
    let indices = integers(mesh.faces.iter().flat_map(|f| f.vertices.iter().copied()));
    let uv_indices = integers(mesh.faces.iter().flat_map(|f| f.uvs.iter().copied()));
    let uvs = list(&mesh.uvs, |out, uv| {
        let _ = write!(out, "({}, {})", uv.x as f32, uv.y as f32);
    });
    // Programs that play nothing read the default value: the first frame.
    let varying = |kind: &str, name: &str, of: &(dyn Fn(usize) -> String + Sync)| {
        format!("{kind}[] {name} = {}\n        {kind}[] {name}.timeSamples = {}", of(0), samples(clip, of))
    };
    let extent = varying("float3", "extent", &|n| bounds(&Clip::y_up(&clip.motion[n])));
    let points = varying("point3f", "points", &|n| vectors(&Clip::y_up(&clip.motion[n])));
    // Where the two sides differ each is a surface of its own, seen from its front alone.
    let turned = clip.back.is_some_and(|back| !back.outward);
    let normals_in = |n: usize| {
        let mut normals = clip.normals(&clip.motion[n]);
        if turned {
            normals.iter_mut().for_each(|n| *n = -*n);
        }
        vectors(&normals)
    };
    let (normals, still) = (samples(clip, normals_in), normals_in(0));
    let sided = match clip.back {
        None => "uniform bool doubleSided = 1".to_owned(),
        Some(back) => format!("uniform bool doubleSided = 0\n        {}", orientation(back.outward)),
    };
    let _ = write!(
        out,
        "    def Mesh \"Fabric\" (\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )\n    \
         {{\n        \
         {sided}\n        uniform token subdivisionScheme = \"none\"\n        \
         int[] faceVertexCounts = {counts}\n        int[] faceVertexIndices = {indices}\n        \
         {extent}\n        {points}\n        \
         normal3f[] normals = {still} (\n            interpolation = \"vertex\"\n        )\n        \
         normal3f[] normals.timeSamples = {normals}\n        \
         texCoord2f[] primvars:st = {uvs} (\n            interpolation = \"faceVarying\"\n        )\n        \
         int[] primvars:st:indices = {uv_indices}\n        \
         rel material:binding = </{name}/Materials/Fabric>\n    }}\n\n"
    );
    if let Some(back) = clip.back {
        // The same points, seen from the other side; whoever reads them makes their normals.
        let _ = write!(
            out,
            "    def Mesh \"Back\" (\n        prepend references = </{name}/Fabric>\n    )\n    {{\n        \
             {}\n        normal3f[] normals = None\n        \
             rel material:binding = </{name}/Materials/Back>\n    }}\n\n",
            orientation(!back.outward)
        );
    }
}

/// Which way the faces of a side go around as it is seen.
fn orientation(outward: bool) -> String {
    format!("uniform token orientation = \"{}\"", if outward { "rightHanded" } else { "leftHanded" })
}

fn material(clip: &Clip, textures: &str, out: &mut String) {
    let path = format!("/{}/Materials/Fabric", clip.name);
    let maps = clip.material.roughness_metallic.is_some();
    let scalar = |kind: &str, constant: f64| {
        if maps {
            format!("float inputs:{kind}.connect = <{path}/{kind}.outputs:r>")
        } else {
            format!("float inputs:{kind} = {constant}")
        }
    };
    let mut found = String::new();
    usd_fabric::attributes(clip, &mut found);
    let schemas = usd_fabric::schemas(clip);
    let _ = write!(
        out,
        "    def Scope \"Materials\"\n    {{\n        def Material \"Fabric\"{schemas}\n        {{\n{found}            \
         token outputs:surface.connect = <{path}/surface.outputs:surface>\n\n            \
         def Shader \"surface\"\n            {{\n                \
         uniform token info:id = \"UsdPreviewSurface\"\n                \
         color3f inputs:diffuseColor.connect = <{path}/basecolor.outputs:rgb>\n                \
         {}\n                {}\n                \
         float inputs:ior = 1.5\n                int inputs:useSpecularWorkflow = 0\n                \
         token outputs:surface\n            }}\n\n            \
         def Shader \"st\"\n            {{\n                \
         uniform token info:id = \"UsdPrimvarReader_float2\"\n                \
         string inputs:varname = \"st\"\n                float2 outputs:result\n            }}\n",
        scalar("roughness", 1.0),
        scalar("metallic", 0.0)
    );
    let mut texture = |kind: &str, space: &str, output: &str| {
        let _ = write!(
            out,
            "\n            def Shader \"{kind}\"\n            {{\n                \
             uniform token info:id = \"UsdUVTexture\"\n                \
             asset inputs:file = @./{textures}/{}@\n                \
             token inputs:sourceColorSpace = \"{space}\"\n                \
             float2 inputs:st.connect = <{path}/st.outputs:result>\n                \
             token inputs:wrapS = \"clamp\"\n                \
             token inputs:wrapT = \"clamp\"\n                {output}\n            }}\n",
            clip.material.file(kind)
        );
    };
    texture("basecolor", "sRGB", "float3 outputs:rgb");
    if maps {
        texture("roughness", "raw", "float outputs:r");
        texture("metallic", "raw", "float outputs:r");
    }
    out.push_str("        }\n");
    if let Some(back) = clip.back {
        let [r, g, b] = back.colour;
        let path = format!("/{}/Materials/Back", clip.name);
        let _ = write!(
            out,
            "\n        def Material \"Back\"\n        {{\n            \
             token outputs:surface.connect = <{path}/surface.outputs:surface>\n\n            \
             def Shader \"surface\"\n            {{\n                \
             uniform token info:id = \"UsdPreviewSurface\"\n                \
             color3f inputs:diffuseColor = ({r}, {g}, {b})\n                \
             float inputs:roughness = 1\n                float inputs:metallic = 0\n                \
             float inputs:ior = 1.5\n                token outputs:surface\n            }}\n        }}\n"
        );
    }
    out.push_str("    }\n");
}

/// The pinhole that looks along −z, at the origin or where it moved. The film covers the pixels' areas, from −½ to
/// width − ½.
fn camera(name: &str, c: &Camera, path: &str, out: &mut String) {
    let (w, h) = (c.width as f64, c.height as f64);
    let focal = c.fx * FILM_WIDTH / w;
    let film_height = h * focal / c.fy;
    let offsets = [((w - 1.0) / 2.0 - c.cx) * FILM_WIDTH / w, (c.cy - (h - 1.0) / 2.0) * film_height / h];
    let _ = write!(
        out,
        "\n    def Camera \"{name}\"\n    {{\n        token projection = \"perspective\"\n        \
         float focalLength = {}\n        float horizontalAperture = {}\n        \
         float verticalAperture = {}\n        \
         float horizontalApertureOffset = {}\n        float verticalApertureOffset = {}\n        \
         float2 clippingRange = (0.01, 100)\n        float fStop = 0\n{}    }}\n",
        focal as f32, FILM_WIDTH as f32, film_height as f32, offsets[0] as f32, offsets[1] as f32, path
    );
}

/// Where a camera is, world from camera with y up in every frame or in all: time samples of a matrix that rows are
/// multiplied with, or that matrix; nothing of one at the origin, which has no `poses`.
fn path(clip: &Clip, poses: &[Pose]) -> String {
    let matrix = |Pose { rotation, translation: t }: &Pose| {
        let row = |v: DVec3, w: f64| format!("({}, {}, {}, {w})", v.x, v.y, v.z);
        let rows =
            [row(rotation.x_axis, 0.0), row(rotation.y_axis, 0.0), row(rotation.z_axis, 0.0), row(*t, 1.0)];
        format!("( {} )", rows.join(", "))
    };
    let sample = |(n, pose): (&usize, &Pose)| format!("            {n}: {},\n", matrix(pose));
    let value = match poses {
        [] => return String::new(),
        [pose] => format!(" = {}", matrix(pose)),
        _ => {
            let samples: String = clip.frames.iter().zip(poses).map(sample).collect();
            format!(".timeSamples = {{\n{samples}        }}")
        }
    };
    format!(
        "        matrix4d xformOp:transform{value}\n        uniform token[] xformOpOrder = \
         [\"xformOp:transform\"]\n"
    )
}

/// The recovered light: the middle of its map is where the camera looks, −z; USD's middle is +z.
fn light(clip: &Clip, out: &mut String) {
    if clip.environment.is_none() {
        return;
    }
    let _ = write!(
        out,
        "\n    def DomeLight \"Light\"\n    {{\n        float inputs:intensity = 1\n        \
         asset inputs:texture:file = @./{}@\n        token inputs:texture:format = \"latlong\"\n        \
         double xformOp:rotateY = 180\n        uniform token[] xformOpOrder = [\"xformOp:rotateY\"]\n    }}\n",
        clip.environment_file()
    );
}

/// Pixels of the video are 1/fx wide and 1/fy high; square ones of the same width show the same with as many rows
/// more or less, to within half a row.
fn render_settings(clip: &Clip, out: &mut String) {
    let c = &clip.camera;
    let rows = (c.height as f64 * c.fx / c.fy).round();
    let _ = write!(
        out,
        "\ndef Scope \"Render\"\n{{\n    def RenderSettings \"Video\"\n    {{\n        \
         rel camera = </{}/Camera>\n        \
         uniform int2 resolution = ({}, {rows})\n        uniform float pixelAspectRatio = 1\n    }}\n}}\n",
        clip.name, c.width
    );
}
