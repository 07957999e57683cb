//! The page of several cameras, and of one that moves.

use glam::{DMat3, DVec3};
use tessuto::Pose;
use tessuto::report::film::Film;
use tessuto::report::{OtherLens, ReportData, page};

use super::page::{data, in_chromium};
use crate::support::missing::not_tested;

/// [R t] by rows of a camera that stands at `eye`, turned about y.
fn rows(eye: DVec3, angle: f64) -> [f64; 12] {
    let rotation = DMat3::from_rotation_y(angle);
    let pose = Pose { rotation, translation: -(rotation * eye) };
    std::array::from_fn(|k| pose.rows()[k])
}

/// A page whose first camera moves along x, with a second one that stands 0.5 m to the right and takes its frames half
/// a frame later.
fn two() -> ReportData {
    let mut data = data(8, 9, 120);
    let cloth = data.cloth.as_mut().unwrap();
    cloth.poses = (0..8).map(|n| rows(DVec3::X * 0.01 * f64::from(n), 0.0)).collect();
    let film = Film { layers: data.film.layers[..2].to_vec(), ..data.film.clone() };
    let poses = vec![rows(DVec3::X * 0.5, 0.4)];
    data.others = vec![OtherLens { name: "right".into(), camera: cloth.camera, poses, late: 0.5, film }];
    data
}

#[test]
fn a_page_of_one_still_camera_says_nothing_of_cameras() {
    let (plain, many) = (page::render(&data(8, 9, 120)), page::render(&two()));
    for part in ["tessuto.Cameras = class", "show-cameras", "id=\"cameras\"", "\"others\":", "next camera"] {
        assert!(!plain.contains(part), "{part}");
        assert!(many.contains(part), "{part} is missing");
    }
    let moving = ReportData { others: Vec::new(), ..two() };
    let moving = page::render(&moving);
    assert!(moving.contains("tessuto.Cameras = class") && moving.contains("show-cameras"));
    assert!(!moving.contains("id=\"cameras\"") && !moving.contains("\"others\":"));
}

const PROBE: &str = r##"<script>
window.faults = [];
addEventListener("error", e => faults.push(e.message));
let patience = 40;
const look = () => {
  if (!(tessuto.page?.cameras && tessuto.page.charts.plots.length) && patience-- > 0) return setTimeout(look, 100);
  const { player, view, wipe, cameras } = tessuto.page, byId = id => document.getElementById(id);
  player.seek(3);
  const round = v => Math.round(1e4 * v) / 1e4;
  const eyes = cameras.all.map(({ corners }) => [...corners.array.subarray(0, 3)].map(round));
  const ways = cameras.all.map(({ way }) => way ? way.geometry.getAttribute("position").count : 0);
  const names = [...document.querySelectorAll("#cameras button")].map(b => b.textContent);
  const seen = () => cameras.all.map(({ body }) => body.visible);
  const middle = () => {
    const { positions: p } = wipe.mesh(3);
    const sum = [0, 0, 0];
    p.forEach((v, i) => { sum[i % 3] += v / (p.length / 3); });
    return sum;
  };
  const whole = n => {
    const p = view.motion.at(n).slice(), sum = [0, 0, 0];
    p.forEach((v, i) => { sum[i % 3] += v / (p.length / 3); });
    return sum;
  };
  const first = middle(), [a, b] = [whole(3), whole(4)];
  document.querySelector("#cameras [data-camera='1']").click();
  const chosen = [cameras.chosen, byId("film-tag").textContent, byId("layer").options.length, view.poses.length];
  // The second camera's axes, half a frame later.
  const late = a.map((v, k) => (v + b[k]) / 2), [s, c] = [Math.sin(0.4), Math.cos(0.4)];
  const [x, y, z] = [late[0] - 0.5, late[1], late[2]];
  const expected = [c * x + s * z, y, c * z - s * x], second = middle();
  const far = Math.hypot(...expected.map((v, k) => v - second[k])) + Math.hypot(first[0] + 0.03 - a[0]);
  const before = seen();
  byId("through-camera").click();
  const through = [seen(), view.throughLens];
  byId("through-camera").click();
  byId("show-cameras").click();
  const hidden = seen();
  document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "v", bubbles: true }));
  const probe = { faults, eyes, ways, names, chosen, far: far < 1e-4, before, through, hidden, next: cameras.chosen };
  document.title = `PROBE ${JSON.stringify(probe)}`;
};
setTimeout(look, 1500);
</script></head>"##;

#[test]
fn cameras_stand_where_they_were_and_one_is_chosen() {
    let Some(seen) = in_chromium(&two(), PROBE) else { return not_tested("Chromium") };
    let expected = serde_json::json!({
        "faults": [], "eyes": [[0.03, 0, 0], [0.5, 0, 0]], "ways": [8, 0], "names": ["original", "right"],
        "chosen": [1, "video: right", 3, 1], "far": true, "before": [true, true],
        "through": [[true, false], true], "hidden": [false, false], "next": 0
    });
    assert_eq!(seen, expected);
}
