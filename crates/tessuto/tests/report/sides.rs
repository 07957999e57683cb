//! The 3D view of a fabric whose other side has one colour.

use tessuto::report::BackData;

use super::page::{data, in_chromium};
use crate::support::missing::not_tested;

/// Parts of the drawn pixels that are green, seen by the recording camera and from behind.
const PROBE: &str = r#"<script>
window.faults = [];
addEventListener("error", e => faults.push(e.message));
const complain = console.error;
console.error = (...words) => { faults.push(words.join(" ")); complain(...words); };
let patience = 40;
const look = () => {
  if (!tessuto.page?.charts.plots.length && patience-- > 0) return setTimeout(look, 100);
  const { view } = tessuto.page;
  view.setLook("texture");
  const shot = document.createElement("canvas");
  [shot.width, shot.height] = [80, 80];
  const pen = shot.getContext("2d", { willReadFrequently: true });
  const green = () => {
    view.drawNow();
    pen.clearRect(0, 0, 80, 80);
    pen.drawImage(view.elements.canvas, 0, 0, 80, 80);
    const { data } = pen.getImageData(0, 0, 80, 80);
    let [drawn, found] = [0, 0];
    for (let i = 0; i < data.length; i += 4) {
      if (data[i + 3] < 255) continue;
      drawn++;
      if (data[i + 1] > 100 && data[i] < 20 && data[i + 2] < 20) found++;
    }
    return [drawn, found / drawn];
  };
  const from = side => {
    view.camera.position.copy(view.centre).z += side * 4 * view.radius;
    view.aim(view.centre);
    return green();
  };
  document.title = `PROBE ${JSON.stringify({ faults, front: from(1), behind: from(-1) })}`;
};
setTimeout(look, 1500);
</script></head>"#;

#[test]
fn one_side_shows_the_print_and_the_other_its_colour() {
    let mut both = Vec::new();
    for outward in [false, true] {
        let mut data = data(8, 9, 120);
        let green = "#00ff00".to_owned();
        let back = BackData { outward, texture: green.clone(), diffuse: green };
        data.cloth.as_mut().unwrap().back = Some(back);
        let Some(seen) = in_chromium(&data, PROBE) else { return not_tested("Chromium") };
        assert_eq!(seen["faults"].as_array().map(Vec::len), Some(0), "{seen}");
        let part = |from: &str| {
            assert!(seen[from][0].as_f64().unwrap() > 300.0, "{seen}");
            seen[from][1].as_f64().unwrap()
        };
        both.push([part("front"), part("behind")]);
    }
    let [[a, b], [c, d]] = [both[0], both[1]];
    assert!((a - b).abs() > 0.9 && (c - d).abs() > 0.9 && (a - d).abs() < 0.1, "{both:?}");
}
