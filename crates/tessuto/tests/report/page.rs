//! The images, the contact sheet and the page of a small made-up reconstruction.

use std::process::Command;

use glam::{DVec2, DVec3};
use tessuto::io::jpeg;
use tessuto::io::rgb8::Rgb8;
use tessuto::mesh::grid;
use tessuto::metrics::{Evaluation, FrameAgreement, FrameMetrics, FrameVerdict, Metrics, State, judge};
use tessuto::motion::causes::Constraint;
use tessuto::report::causes::{CauseRow, CauseSpread, ForceArrows, Replay};
use tessuto::report::chart::Series;
use tessuto::report::embed::{Window, base64};
use tessuto::report::film::{Film, Source};
use tessuto::report::{
    CauseData, Chart, ClothData, EmbeddedMotion, Field, FrameImages, KeyNumber, Kind, Map, Parameter, Ranges,
    ReportData, Scales, Surface, chart, chosen_frames, contact_sheet, measured_depth_image, page,
};
use tessuto::session::Epoch;
use tessuto::{Camera, Frame, Image, Positions};

use crate::support::missing::not_tested;

const WIDTH: usize = 64;
const HEIGHT: usize = 48;

/// A disc of fabric around column `x`: colour, mask and depth.
fn disc(x: f32, z: f32) -> (Image, Image, Image) {
    let mut images =
        (Image::new(WIDTH, HEIGHT, 3), Image::new(WIDTH, HEIGHT, 1), Image::new(WIDTH, HEIGHT, 1));
    for row in 0..HEIGHT {
        for column in 0..WIDTH {
            if (column as f32 - x).hypot(row as f32 - 24.0) < 12.0 {
                images.0.pixel_mut(column, row).copy_from_slice(&[0.8, 0.4, 0.2]);
                images.1.pixel_mut(column, row)[0] = 1.0;
                images.2.pixel_mut(column, row)[0] = z;
            }
        }
    }
    images
}

/// Calls `look` with the images of a disc that is 4 px too far left and 10 mm too far away.
fn with_images(look: impl FnOnce(&FrameImages)) {
    let (rgb, mask, depth) = disc(28.0, 1.21);
    let (observed_rgb, observed_mask, measured) = disc(32.0, 1.20);
    let observed = Frame { rgb: observed_rgb, mask: observed_mask };
    look(&FrameImages {
        rgb: &rgb,
        mask: &mask,
        depth: &depth,
        observed: &observed,
        measured_depth: Some(&measured),
    });
}

#[test]
fn pictures_show_the_sign_of_what_differs() {
    with_images(|images| {
        let scales = Scales::fitting([Ranges::of(images.depth, images.measured_depth)]);
        assert_eq!(scales.depth, [1.21, 1.22]);
        assert!((scales.depth_difference - 0.01).abs() < 1e-9, "{scales:?}");
        let at = |kind, x| images.image(kind, &scales).unwrap().pixel(x, 24).to_vec();
        let (red, blue) = (|c: &[f32]| c[0] > 1.5 * c[2], |c: &[f32]| c[2] > 1.5 * c[0]);
        // Rendered only at the left, observed only at the right, both in the middle.
        assert!(red(&at(Kind::MaskDifference, 18)) && blue(&at(Kind::MaskDifference, 42)));
        assert!(at(Kind::MaskDifference, 30).iter().all(|v| *v > 0.95));
        assert!(red(&at(Kind::DepthDifference, 30)));
        assert!(at(Kind::Difference, 30).iter().all(|v| *v < 0.02) && at(Kind::Difference, 42)[0] > 0.9);
        assert_ne!(at(Kind::Depth, 30), at(Kind::Depth, 60));
        let unmeasured = FrameImages { measured_depth: None, ..*images };
        assert!(unmeasured.image(Kind::DepthDifference, &scales).is_none());
    });
}

#[test]
fn measured_points_become_a_surface_without_gaps() {
    let camera = Camera { fx: 100.0, fy: 100.0, cx: 31.5, cy: 23.5, width: WIDTH, height: HEIGHT };
    let mut points = Vec::new();
    for row in 0..10 {
        for column in 0..10 {
            // Every third pixel.
            points.push(
                camera.ray(glam::DVec2::new(10.0 + 3.0 * f64::from(column), 8.0 + 3.0 * f64::from(row)))
                    * 2.0,
            );
        }
    }
    points.push(points[0] * 1.5);
    points.push(DVec3::new(50.0, 0.0, 1.0));
    let image = measured_depth_image(&points, camera);
    assert!((8..36).all(|y| (10..38).all(|x| (image.pixel(x, y)[0] - 2.0).abs() < 1e-6)));
    assert_eq!(image.pixel(60, 40)[0], 0.0);
}

#[test]
fn contact_sheet_shows_the_first_and_the_last_frame() {
    assert_eq!(chosen_frames(1), [0]);
    assert_eq!(chosen_frames(4), [0, 1, 2, 3]);
    let chosen = chosen_frames(40);
    assert!(chosen.len() == 9 && chosen[0] == 0 && chosen[8] == 39 && chosen.is_sorted());
    with_images(|images| {
        let scales = Scales::fitting([Ranges::of(images.depth, None)]);
        let sheet = contact_sheet(&[(0, *images), (7, *images)], &scales);
        assert!(sheet.data.iter().all(|v| (0.0..=1.0).contains(v)));
        let cloth =
            sheet.data.chunks_exact(3).filter(|p| (p[0] - 0.8).abs() < 1e-3 && (p[2] - 0.2).abs() < 1e-3);
        assert!(cloth.count() > 4 * 5_000);
    });
}

/// Frames 2 and 3 are doubtful, those from 6 on lost.
fn verdicts(frame_count: usize) -> Vec<FrameVerdict> {
    let verdict = |frame: usize| {
        let (state, reason) = match frame {
            2 | 3 => (State::Doubtful, "texture <b> displaced"),
            6.. => (State::Lost, "crumpled"),
            _ => (State::Found, ""),
        };
        FrameVerdict { frame, state, reason: reason.into() }
    };
    (0..frame_count).map(verdict).collect()
}

/// Gravity at three vertices, something that grows at two of them, and a replay of four more frames.
fn causes(motion: &[Positions]) -> CauseData {
    let sites = [0u8, 0, 0, 0, 4, 0, 0, 0, 8, 0, 0, 0];
    let forces = |key, of: &dyn Fn(usize) -> Vec<DVec3>, count: usize| ForceArrows {
        key,
        label: key,
        vectors: EmbeddedMotion::new(&(0..count).map(of).collect::<Vec<_>>()),
    };
    let hold = |n: usize| vec![DVec3::X * 100.0 * n as f64, DVec3::ZERO, DVec3::Y * -400.0];
    let further = [motion, &vec![motion[0].clone(); 4]].concat();
    let row = |label: &str, value, known| CauseRow {
        label: label.into(),
        value,
        unit: "N·m",
        spread: Some(CauseSpread::Factor(1.25)),
        constraint: Some(if value > 1e-5 {
            Constraint::Constrained
        } else {
            Constraint::AtLeast { factor: 0.5 }
        }),
        known,
        note: "<i>assumed</i>".into(),
    };
    CauseData {
        rows: vec![row("bending", 2e-5, Some([8e-7, 1.2e-4])), row("membrane", 1e-6, None)],
        sites: base64(&sites),
        forces: vec![
            forces("gravity", &|_| vec![DVec3::Y * 9.81; 3], 1),
            forces("hold", &hold, motion.len() - 1),
        ],
        replays: vec![Replay {
            key: "let_go",
            label: "let go",
            note: "It falls.".into(),
            from: motion.len() - 1,
            motion: EmbeddedMotion::new(&further),
        }],
    }
}

/// A cloth of `side`×`side` vertices that swings, in front of a camera of `size`×`size` pixels.
pub fn data(frame_count: usize, side: usize, size: usize) -> ReportData {
    let mesh = grid(side, side, DVec2::new(0.5, 0.5), 1.2);
    let swung = |n: usize| -> Positions {
        let wave = |p: &DVec3| 0.06 * ((8.0 * p.x + 0.3 * n as f64).sin() + p.y * (0.2 * n as f64).cos());
        mesh.positions.iter().map(|p| *p + DVec3::Z * wave(p)).collect()
    };
    let motion: Vec<Positions> = (0..frame_count).map(swung).collect();
    let depths = |scale: f64| -> Vec<Vec<f32>> {
        motion.iter().map(|s| s.iter().map(|p| (scale * (p.z - 1.2)) as f32).collect()).collect()
    };
    let camera = Camera {
        fx: size as f64,
        fy: size as f64,
        cx: size as f64 / 2.0,
        cy: size as f64 / 2.0,
        width: size,
        height: size,
    };
    // A checked cloth with some grain, on black.
    let image = |shift: u32| {
        Rgb8::from_fn([size, size], |x, y| {
            let [x, y] = [x as u32, y as u32];
            let inside = |v: u32| (size as u32 / 4..3 * size as u32 / 4).contains(&v);
            let grain =
                (x.wrapping_mul(2_654_435_761) ^ y.wrapping_mul(40_503).wrapping_add(shift * 977)) >> 3;
            let check = if ((x + shift) / 20 + y / 20).is_multiple_of(2) { 150 } else { 60 };
            match inside(x) && inside(y) {
                true => [check + (grain % 32) as u8, 200 - check / 2, check / 2 + (grain % 24) as u8],
                false => [0; 3],
            }
        })
    };
    let images = [image(0), image(3)];
    let source = |key, k: usize| {
        let images = &images;
        Source { key, label: key, load: Box::new(move |n| Ok(images[(n + k) % 2].clone())) }
    };
    let sources = [source("observed", 0), source("render", 1), source("rerendered", 0)];
    let history: Vec<Epoch> = (1..30)
        .map(|step| Epoch {
            stage: "refine".into(),
            step,
            of: 29,
            active_frames: frame_count,
            losses: vec![("total".into(), 0.5f64.powi(step as i32)), ("</script><b>".into(), 0.1)],
            parameters: vec![("stretch".into(), 200.0 + step as f64)],
        })
        .collect();
    let parameters = vec![Parameter {
        name: "stretch".into(),
        label: "stretch stiffness".into(),
        value: 229.0,
        unit: "N/m".into(),
        note: String::new(),
    }];
    let row = |frame| FrameMetrics {
        frame,
        metrics: Metrics { depth: Some(5.4e-3 + 1e-4 * frame as f64), ..Metrics::default() },
    };
    let mut charts = chart::of_history(&history, &parameters);
    charts.push(Chart {
        title: "shares".into(),
        x_label: "frame".into(),
        unit: "%".into(),
        by_frame: true,
        stacked: true,
        x: (0..frame_count).map(|n| n as f64).collect(),
        series: [("gravity", 60.0), ("air", 30.0), ("hold", 10.0)]
            .map(|(name, v)| Series { name: name.into(), values: vec![Some(v); frame_count] })
            .into(),
        ..Chart::default()
    });
    ReportData {
        title: "<script>alert(1)</script>".into(),
        subtitle: "a made-up result".into(),
        command: "tessuto reconstruct 'a b' --out c".into(),
        key_numbers: vec![KeyNumber::new("frames", frame_count.to_string(), "")],
        cloth: Some(ClothData {
            poses: Vec::new(),
            fps: 25.0,
            first_frame: 0,
            frame_count,
            camera,
            surface: Surface::new(&mesh, Window::WHOLE),
            motion: EmbeddedMotion::new(&motion),
            fields: [("depth_error", 900.0), ("force", 50.0)]
                .into_iter()
                .filter_map(|(key, scale)| Field::new([key, key, "mm"], key != "force", &depths(scale)))
                .collect(),
            back: None,
        }),
        film: Film::new(&sources, frame_count, &camera, None, 11 << 20).unwrap(),
        others: Vec::new(),
        verdict: None,
        verdicts: verdicts(frame_count),
        maps: vec![Map {
            key: "texture",
            label: "recovered texture",
            image: base64(&jpeg::encode(&image(1), 80)),
        }],
        light: None,
        charts,
        causes: Some(causes(&motion)),
        parameters,
        evaluation: Some(Evaluation {
            mean: row(0).metrics,
            frames: (0..frame_count).map(row).collect(),
            ..Evaluation::default()
        }),
        timings: vec![("motion".into(), 4000.0), ("report".into(), 1.5)],
        warnings: vec!["a & b".into()],
        config: "seed = 0".into(),
        live: false,
    }
}

/// What would make a browser ask for something outside the page.
fn asks_for_more(page: &str) -> Vec<String> {
    let marks = ["src=", "href=", "url(", "@import", "<link", "<iframe", "import("];
    let refers = |place: &str| {
        let target = place.trim_start_matches(['"', '\'']);
        !target.starts_with("data:") && !target.starts_with('#')
    };
    marks
        .iter()
        .flat_map(|mark| page.match_indices(mark).map(move |(i, _)| (mark, &page[i + mark.len()..])))
        .filter(|(mark, rest)| !mark.ends_with(['=', '(']) || refers(rest))
        .map(|(mark, rest)| format!("{mark}{}", rest.chars().take(60).collect::<String>()))
        .collect()
}

#[test]
fn page_of_a_hundred_frames_is_one_file_of_bounded_size() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.html");
    page::write(&path, &data(100, 32, 640)).unwrap();
    let bytes = std::fs::metadata(&path).unwrap().len();
    assert!((2_000_000..15_000_000).contains(&bytes), "{bytes} bytes");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);

    let page = std::fs::read_to_string(&path).unwrap();
    // Markup alone: the libraries' code has strings that look like it, and the policy forbids what they could do.
    let markup: String = page
        .split("<script>")
        .map(|part| part.split_once("</script>").map_or(part, |(_, rest)| rest))
        .collect();
    assert!(markup.len() < page.len() - 500_000);
    assert_eq!(asks_for_more(&markup), Vec::<String>::new());
    assert!(page.contains("default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'"));
    assert!(!page.contains("connect-src"));
    assert!(!page.contains("<script>alert") && !page.contains("</script><b>"));
    for text in ["a &#38; b", "2.00e-5", "N·m", "5.4", "1 h 06 min", "tessuto reconstruct &#39;a b&#39;"] {
        assert!(page.contains(text), "{text} is missing");
    }
}

#[test]
fn doubtful_and_lost_frames_are_listed_and_counted() {
    let mut data = data(8, 5, 60);
    let mesh = grid(3, 3, DVec2::ONE, 1.0);
    let frame = |frame| FrameAgreement { frame, flipped: 0.02 * frame as f64, ..FrameAgreement::default() };
    data.verdict = judge(&[frame(0), frame(1), frame(3)], &mesh);
    let text = page::render(&data);
    for part in [
        concat!(
            r#"<td class="with-frames">frame 2 to 3</td><td><b class="doubtful">doubtful</b></td>"#,
            "<td>texture &#60;b&#62; displaced</td>"
        ),
        r#"<td class="with-frames">frame 6 to 7</td><td><b class="lost">lost</b></td><td>crumpled</td>"#,
        r#"<span class="state lost">lost</span>"#,
        "1 frame found, 1 doubtful, 1 lost. What helps: ",
        r#"{"frame":2,"state":"doubtful","reason":"texture \u003cb> displaced"}"#,
        "area in flipped triangles",
    ] {
        assert!(text.contains(part), "{part} is missing");
    }
    // A list that nobody reads to its end is cut.
    data.verdicts = verdicts(100);
    data.verdicts.iter_mut().step_by(2).for_each(|v| v.state = State::Found);
    assert!(page::render(&data).contains("and 28 more, all in metrics.json"));
}

#[test]
fn causes_are_listed_with_their_spread_beside_known_fabrics() {
    let text = page::render(&data(8, 5, 60));
    for part in [
        concat!(
            r#"<td>bending<small class="soft">&#60;i&#62;assumed&#60;/i&#62;</small></td>"#,
            r#"<td class="number">2.00e-5</td><td>N·m</td>"#
        ),
        r#"<td class="nowrap">× or ÷ 1.25</td><td class="nowrap"><b class="found">constrained</b></td>"#,
        r#"8e-7 to 1.2e-4<div class="range""#,
        r#"<span class="soft">at least 5.00e-7</span></td><td class="nowrap soft"></td>"#,
        r#""replays":[{"key":"let_go","label":"let go","note":"It falls.","from":7"#,
    ] {
        assert!(text.contains(part), "{part} is missing");
    }
    // Parameters that only replay the motion are those of results without causes.
    assert!(!text.contains("Recovered parameters"));
    let plain = page::render(&ReportData { causes: None, ..data(8, 5, 60) });
    assert!(plain.contains("Recovered parameters") && !plain.contains("What moved it"));
    assert!(plain.contains(r#""causes":null"#));
}

#[test]
fn page_without_anything_is_still_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.html");
    page::write(&path, &ReportData::default()).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.trim_end().ends_with("</html>"));
    assert!(text.contains(r#""cloth":null"#) && !text.contains("<img"));
    assert_eq!(
        page::write(&folder.path().join("no/such"), &ReportData::default()).unwrap_err().exit_code(),
        5
    );
}

/// Looks, after a while, at what the page made of itself, and says so in its title.
const PROBE: &str = r#"<script>
window.faults = [];
addEventListener("error", e => faults.push(e.message));
const complain = console.error;
console.error = (...words) => { faults.push(words.join(" ")); complain(...words); };
let patience = 40;
const look = () => {
  // On a busy machine the charts, which the page draws last, come late.
  if (!tessuto.page?.charts.plots.length && patience-- > 0) return setTimeout(look, 100);
  const { player, view, wipe, charts } = tessuto.page;
  const { canvas } = view.elements;
  view.drawNow();
  const shot = document.createElement("canvas");
  [shot.width, shot.height] = [80, 80];
  const pen = shot.getContext("2d", { willReadFrequently: true });
  pen.drawImage(canvas, 0, 0, 80, 80);
  const colours = new Set(new Uint32Array(pen.getImageData(0, 0, 80, 80).data.buffer)).size;
  const wiped = wipe.drawn > 0, plots = charts.plots.length;
  // Frames of animation are rare under the driver's clock: playing is left to tools/check_report.mjs.
  const scrub = document.getElementById("scrub"), wipeSlider = document.getElementById("wipe");
  document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true }));
  const byKey = [player.frame, Number(scrub.value), view.frame, wipe.frame];
  const strip = [...document.querySelectorAll('#states i')].map(mark => mark.className);
  const key = (key, shiftKey) =>
    document.body.dispatchEvent(new KeyboardEvent("keydown", { key, shiftKey, bubbles: true }));
  const doubts = [[], [], [], [true]].map(([back]) => (key("n", back), player.frame));
  const told = [scrub.getAttribute("aria-valuetext"), document.getElementById("state-text").textContent];
  const press = query => document.querySelector(query).click();
  press("[data-force=hold]");
  player.seek(3);
  const { arrows } = view, hold = arrows.group.find(g => g.key === "hold");
  const offset = (s, k) => hold.position.array[33 * s + 30 + k] - view.linePositions.array[3 * arrows.sites[s] + k];
  const tip = [0, 1].map(s => Math.hypot(...[0, 1, 2].map(k => offset(s, k))));
  const drawnArrows =
    [hold.mesh.visible, arrows.group[0].mesh.visible, (tip[0] / arrows.length(300)).toFixed(2), tip[1]];
  const bars = [...document.querySelectorAll('#arrow-scale div')].map(row => row.textContent);
  press("[data-replay=let_go]");
  const went = [player.frameCount, player.frame, player.playing, Number(scrub.max), hold.mesh.visible,
    document.getElementById("replay-note").textContent];
  player.toggle(false);
  player.seek(11);
  const fell = [view.frame, wipe.frame, view.foundLines.visible, document.getElementById("state").hidden];
  press("[data-replay=found]");
  const back = [player.frameCount, player.frame, view.foundLines.visible, hold.mesh.visible,
    document.getElementById("state").hidden];
  const shares = charts.plots.find(plot => plot.chart.stacked).data.slice(1).map(line => line[2]);
  scrub.value = 5;
  scrub.dispatchEvent(new Event("input"));
  const bySlider = [player.frame, view.frame, document.getElementById("frame").textContent.includes("frame 5")];
  wipeSlider.value = 250;
  wipeSlider.dispatchEvent(new Event("input"));
  player.toggle();
  const played = player.playing;
  const probe = { faults, colours, wiped, plots, byKey, bySlider, strip, doubts, told, share: wipe.share, played,
    drawnArrows, bars, went, fell, back, shares };
  document.title = `PROBE ${JSON.stringify(probe)}`;
};
setTimeout(look, 1500);
</script></head>"#;

/// What `probe`, put into the head of the page of `data`, says in the page's title; `None` without Chromium.
pub fn in_chromium(data: &ReportData, probe: &str) -> Option<serde_json::Value> {
    let program = ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(|p| Command::new(p).arg("--version").output().is_ok_and(|o| o.status.success()))?;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.html");
    std::fs::write(&path, page::render(data).replacen("</head>", probe, 1)).unwrap();
    let run = Command::new(program)
        .args(["--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"])
        .args(["--enable-unsafe-swiftshader", "--virtual-time-budget=6000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
        .arg(format!("file://{}", path.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&run.stdout);
    let title = title(&dom).unwrap_or_else(|| panic!("{}", String::from_utf8_lossy(&run.stderr)));
    let seen = title.strip_prefix("PROBE ").unwrap_or_else(|| panic!("nothing was looked at: {title}"));
    Some(serde_json::from_str(seen).unwrap_or_else(|e| panic!("{e}: {title}")))
}

#[test]
fn page_runs_in_chromium() {
    let Some(seen) = in_chromium(&data(8, 9, 120), PROBE) else { return not_tested("Chromium") };
    let title = seen.to_string();
    assert_eq!(seen["faults"].as_array().map(Vec::len), Some(0), "{title}");
    assert!(seen["colours"].as_u64() > Some(20), "the 3D view is blank: {title}");
    let expected = serde_json::json!({
        "strip": ["found", "doubtful", "found", "lost"], "doubts": [2, 6, 2, 6],
        "told": ["frame 6, lost: crumpled", "lost crumpled"],
        "wiped": true, "plots": 4, "byKey": [1, 1, 1, 1], "bySlider": [5, 5, true], "share": 0.25, "played": true,
        "drawnArrows": [true, false, "1.00", 0], "shares": [100, 40, 10],
        "went": [12, 2, true, 11, false, "It falls. Dark threads: as found."],
        "fell": [11, 7, false, true], "back": [8, 7, false, true, false]
    });
    assert!(seen["bars"].as_array().is_some_and(|bars| !bars.is_empty()), "{title}");
    for (key, value) in expected.as_object().unwrap() {
        assert_eq!(seen[key], *value, "{key}: {title}");
    }
}

fn title(dom: &str) -> Option<&str> {
    dom.split("<title>").nth(1)?.split("</title>").next()
}
