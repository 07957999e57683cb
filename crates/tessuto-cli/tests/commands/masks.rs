//! `masks`, `import --outline` and `template --corners` on the made-up clip of `demo --clip`, as a user types them.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use tempfile::TempDir;
use tessuto::Image;
use tessuto::io::image::{read_mask, write_png};

use crate::missing::not_tested;

/// The clip, and the corners that its README names [px], clockwise from the upper left.
struct Clip {
    home: TempDir,
    corners: [[f64; 2]; 4],
}

impl Clip {
    fn new() -> Self {
        let home = tempfile::tempdir().unwrap();
        let trial = home.path().join("trial");
        let made = Command::new(env!("CARGO_BIN_EXE_tessuto"))
            .args(["demo", "--clip", trial.to_str().unwrap()])
            // Frames as images, so that no ffmpeg is needed.
            .env("TESSUTO_FFMPEG", "/no/such/program")
            .output()
            .unwrap();
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        let readme = std::fs::read_to_string(trial.join("README.md")).unwrap();
        let line = readme.lines().find(|l| l.starts_with("- Corners")).unwrap();
        let corners = line.split(' ').filter_map(|word| {
            let (x, y) = word.split_once(',')?;
            Some([x.parse().ok()?, y.parse().ok()?])
        });
        let corners = corners.collect::<Vec<_>>().try_into().unwrap();
        Self { home, corners }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.home.path().join(name)
    }

    /// Runs the program; words that start with @ are paths of this folder. Status, and what was printed in one line.
    fn run(&self, words: &[&str]) -> (Option<i32>, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tessuto"));
        for word in words {
            match word.strip_prefix('@') {
                Some(name) => command.arg(self.path(name)),
                None => command.arg(word),
            };
        }
        let output = command.output().unwrap();
        let text = String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap();
        (output.status.code(), text.split_whitespace().collect::<Vec<_>>().join(" "))
    }

    fn succeed(&self, words: &[&str]) -> String {
        let (status, text) = self.run(words);
        assert_eq!(status, Some(0), "{words:?}: {text}");
        text
    }

    fn refused(&self, words: &[&str], fragments: &[&str]) {
        let (status, text) = self.run(words);
        assert!(matches!(status, Some(2 | 3)), "{words:?}: {status:?} {text}");
        for fragment in fragments {
            assert!(text.contains(fragment), "{fragment:?} is missing in: {text}");
        }
    }

    /// The corners in the frames of half the size.
    fn clicked(&self) -> [String; 4] {
        self.corners.map(|[x, y]| format!("{:.1},{:.1}", (x + 0.5) / 2.0 - 0.5, (y + 0.5) / 2.0 - 0.5))
    }

    /// The first frames of the clip at half the size, as `scene`, with the outline given as words.
    fn import(&self, scene: &str, more: &[&str]) -> String {
        let clicked = self.clicked();
        let start = ["import", "@trial/frames", scene, "--fps", "50", "--fx", "600", "--downscale", "2"];
        let outline = ["--frames", "0..8", "--outline", &clicked[0], &clicked[1], &clicked[2], &clicked[3]];
        self.succeed(&[&start[..], &outline[..], more].concat())
    }

    /// Overlap of the mask of frame 0 with the plane sheet between its corners.
    fn overlap(&self, scene: &str) -> f64 {
        let (mask, _) = read_mask(&self.path(scene).join("masks/mask_000.png")).unwrap();
        let quad = self.corners.map(|c| c.map(|v| (v + 0.5) / 2.0 - 0.5));
        let (mut both, mut any) = (0.0, 0.0);
        for y in 0..mask.height {
            for x in 0..mask.width {
                let truth = (0..4).all(|k| {
                    let ([ax, ay], [bx, by]) = (quad[k], quad[(k + 1) % 4]);
                    (bx - ax) * (y as f64 - ay) - (by - ay) * (x as f64 - ax) >= 0.0
                });
                let found = mask.pixel(x, y)[0] >= 0.5;
                both += f64::from(u8::from(found && truth));
                any += f64::from(u8::from(found || truth));
            }
        }
        both / any
    }
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn from_four_corners_to_masks_and_a_template() {
    let clip = Clip::new();
    let text = clip.import("@scene", &[]);
    assert!(text.contains("8 masks, confidence") && text.contains("masks.html"), "{text}");
    assert!(clip.overlap("scene") > 0.97, "{}", clip.overlap("scene"));
    let record = json(&clip.path("scene/masks.json"));
    assert_eq!(record["outline"].as_array().map(Vec::len), Some(4));

    // Corners as four words and as one string are the same.
    let clicked = clip.clicked();
    let [a, b, c, d] = [0, 1, 2, 3].map(|k| clicked[k].as_str());
    let flat = ["template", "@scene", "--flat", "50x50cm", "--grid", "9x9", "--force"];
    let template = |corners: &[&str]| {
        clip.succeed(&[&flat[..], &["--corners"], corners].concat());
        std::fs::read(clip.path("scene/template.obj")).unwrap()
    };
    assert!(template(&[a, b, c, d]) == template(&[&format!("{a} {b} {c} {d}")]));
    clip.refused(&[&flat[..], &["--corners", a, b, c]].concat(), &["3 corners", "write four"]);

    // Clicks are added and kept, and the frames that look wrong are named; without an outline the last one counts.
    let text = clip.succeed(&["masks", "@scene", "--inside", "2:100,110", "3:101,110", "--outside", "2:5,5"]);
    assert!(text.contains("next: tessuto check"), "{text}");
    assert_eq!(json(&clip.path("scene/masks.json"))["clicks"].as_array().map(Vec::len), Some(3));
    clip.refused(&["masks", "@scene", "--inside", "8:5,5"], &["frame 8 of 8 frames"]);
    clip.refused(&["masks", "@scene", "--outline", "3,3 40,3 40,40 3,40"], &["frame 0", "--outline"]);

    // The template alone is enough to begin with.
    for name in ["masks", "masks.json", "masks.html"] {
        let path = clip.path("scene").join(name);
        if path.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) }.unwrap();
    }
    clip.succeed(&["masks", "@scene"]);
    assert!(clip.overlap("scene") > 0.97, "{}", clip.overlap("scene"));
    assert_eq!(json(&clip.path("scene/masks.json"))["outline"], Value::Null);
    std::fs::remove_file(clip.path("scene/template.obj")).unwrap();
    for name in ["masks.json", "template.json"] {
        std::fs::remove_file(clip.path("scene").join(name)).unwrap();
    }
    clip.refused(&["masks", "@scene"], &["it is not known where the fabric of", "--outline"]);
}

#[test]
fn a_drawn_border_is_the_first_mask() {
    let clip = Clip::new();
    clip.import("@scene", &[]);
    let corners = clip.corners.map(|c| c.map(|v| (v + 0.5) / 2.0 - 0.5));
    let points = (0..4).flat_map(|k| {
        let ([ax, ay], [bx, by]) = (corners[k], corners[(k + 1) % 4]);
        [format!("{ax:.3},{ay:.3}"), format!("{:.3},{:.3}", (ax + bx) / 2.0, (ay + by) / 2.0)]
    });
    let outline = points.collect::<Vec<_>>().join(" ");
    let first = |record: &Value| (record["border"].clone(), record["frames"][0]["confidence"].as_f64());
    clip.succeed(&["masks", "@scene", "--outline", &outline]);
    assert_eq!(first(&json(&clip.path("scene/masks.json"))), (Value::Null, Some(1.0)));
    assert!(clip.overlap("scene") > 0.999, "{}", clip.overlap("scene"));
    let drawn = std::fs::read(clip.path("scene/masks/mask_000.png")).unwrap();
    // It is kept, unless it is said to be near the border only.
    clip.succeed(&["masks", "@scene", "--inside", "2:100,110"]);
    assert!(std::fs::read(clip.path("scene/masks/mask_000.png")).unwrap() == drawn);
    clip.succeed(&["masks", "@scene", "--border", "found"]);
    assert_eq!(json(&clip.path("scene/masks.json"))["border"], "found");
    let found = std::fs::read(clip.path("scene/masks/mask_000.png")).unwrap();
    assert!(found != drawn && clip.overlap("scene") > 0.97);
    // A mask of the first frame is the first mask, and is kept.
    std::fs::write(clip.path("mine.png"), &found).unwrap();
    clip.succeed(&["masks", "@scene", "--first", "@mine.png"]);
    clip.succeed(&["masks", "@scene"]);
    assert!(std::fs::read(clip.path("scene/masks/mask_000.png")).unwrap() == found);
    assert_eq!(json(&clip.path("scene/masks.json"))["first"], "drawn.png");
}

#[test]
fn the_empty_place_is_an_image_or_a_film() {
    let clip = Clip::new();
    // Nobody has the empty wall of this clip: where the sheet is in none of three frames far apart, their median
    // shows it.
    let frames = [0, 14, 29]
        .map(|n| tessuto::io::image::read(&clip.path(&format!("trial/frames/frame_{n:03}.png"))).unwrap());
    let mut plate = Image::new(480, 480, 3);
    for (i, v) in plate.data.iter_mut().enumerate() {
        let mut looks = [0, 1, 2].map(|k: usize| frames[k].data[i]);
        looks.sort_by(f32::total_cmp);
        *v = looks[1];
    }
    // Where it always hangs: the colour of the border, which is no cloth.
    let border = frames[0].pixel(2, 2).to_vec();
    let [[x0, y0], _, [x1, y1], _] = clip.corners;
    for y in (y0 - 40.0) as usize..(y1 + 40.0) as usize {
        for x in (x0 - 60.0) as usize..(x1 + 40.0) as usize {
            plate.pixel_mut(x, y).copy_from_slice(&border);
        }
    }
    let file = clip.path("empty.png");
    write_png(&file, &plate).unwrap();
    clip.import("@scene", &["--plate", "@empty.png"]);
    assert_eq!(json(&clip.path("scene/masks.json"))["plate"], "plate.png");
    let of_image = tessuto::io::image::read(&clip.path("scene/plate.png")).unwrap();
    assert_eq!([of_image.width, of_image.height], [240, 240]);

    // Other sizes are refused with both.
    write_png(&clip.path("small.png"), &Image::new(100, 80, 3)).unwrap();
    clip.refused(&["masks", "@scene", "--plate", "@small.png"], &["100×80", "240×240"]);

    let film = clip.path("empty.mkv");
    let ffmpeg = std::env::var_os("TESSUTO_FFMPEG").unwrap_or_else(|| "ffmpeg".into());
    let made = Command::new(ffmpeg)
        .args(["-v", "error", "-nostdin", "-loop", "1", "-i"])
        .arg(&file)
        .args(["-frames:v", "9", "-c:v", "ffv1", "-pix_fmt", "bgr0"])
        .arg(&film)
        .status();
    if !made.is_ok_and(|status| status.success()) {
        not_tested("the empty place as a film: no ffmpeg");
        return;
    }
    clip.import("@filmed", &["--plate", "@empty.mkv"]);
    let of_film = tessuto::io::image::read(&clip.path("filmed/plate.png")).unwrap();
    assert!(of_film == of_image, "the median of a still film is its image");
}
