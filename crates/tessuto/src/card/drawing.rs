//! The pictures of the card, as SVG: the strip over the edge from the side, the draped disc from above.

use std::fmt::Write as _;

use glam::DVec2;

use super::laboratory::Tested;
use tessuto_sim::textile::cantilever::SLOPE;
use tessuto_sim::textile::drape::{DISC, PLATE};

/// Points `[mm]` of a line.
fn points(line: impl Iterator<Item = DVec2>) -> String {
    let words: Vec<String> = line.map(|p| format!("{:.2},{:.2}", 1e3 * p.x, 1e3 * p.y)).collect();
    words.join(" ")
}

/// Strips along warp and weft over the edge of a table, and the line at 41.5°.
pub(super) fn strips(tested: &Tested) -> String {
    let longest = 1e3 * tested.overhangs.iter().map(|o| o[1]).fold(0.0, f64::max);
    let (left, width, height) = (-0.35 * longest, 1.4 * longest, 0.95 * longest);
    let thick = 0.012 * longest;
    let mut out = format!(
        "<svg viewBox=\"{left:.2} {:.2} {width:.2} {height:.2}\" role=\"img\" aria-label=\"Strips along warp and \
         weft over the edge of a table, from the side\" style=\"stroke-width:{thick:.3};font-size:{:.2}px\">\n",
        -0.12 * longest,
        0.045 * longest
    );
    let _ = writeln!(
        out,
        "<rect class=\"table\" x=\"{left:.2}\" y=\"0\" width=\"{:.2}\" height=\"{height:.2}\"/>",
        -left
    );
    let slope = SLOPE.to_radians();
    let end = DVec2::new(slope.cos(), slope.sin()) * longest;
    let _ = writeln!(
        out,
        "<line class=\"slope\" x1=\"0\" y1=\"0\" x2=\"{:.2}\" y2=\"{:.2}\"/>\n<text x=\"{:.2}\" \
         y=\"{:.2}\">{SLOPE}°</text>",
        end.x,
        end.y,
        0.14 * longest,
        0.32 * longest
    );
    for (k, name) in ["warp", "weft"].into_iter().enumerate() {
        let line = &tested.strips[k].line;
        let on_table = DVec2::new(1e-3 * left, 0.0);
        let _ = writeln!(
            out,
            "<polyline class=\"{name}\" pathLength=\"100\" points=\"{}\"><title>{name}: {:.1} mm</title></polyline>",
            points(std::iter::once(on_table).chain(line.iter().copied())),
            1e3 * tested.strips[k].overhang
        );
        let tip = 1e3 * line[line.len() - 1];
        let _ = writeln!(
            out,
            "<text x=\"{:.2}\" y=\"{:.2}\">{name}</text>",
            tip.x + 0.02 * longest,
            tip.y + 0.02 * longest - 0.05 * longest * k as f64
        );
    }
    // A ruler.
    let length = [5.0, 10.0, 20.0, 50.0, 100.0].into_iter().rfind(|l| *l < 0.5 * longest).unwrap_or(2.0);
    let y = -0.06 * longest;
    let _ = writeln!(
        out,
        "<line class=\"ruler\" x1=\"0\" y1=\"{y:.2}\" x2=\"{length}\" y2=\"{y:.2}\"/>\n<text x=\"{:.2}\" \
         y=\"{:.2}\">{length} mm</text>\n</svg>",
        length + 0.02 * longest,
        y + 0.015 * longest
    );
    out
}

/// Outlines of the disc from above, the plate and the flat disc.
pub(super) fn drapes(tested: &Tested) -> String {
    let (disc, plate) = (1e3 * DISC, 1e3 * PLATE);
    let mut out = format!(
        "<svg viewBox=\"{0} {0} {1} {1}\" role=\"img\" aria-label=\"Draped disc from above\" \
         style=\"stroke-width:1.2;font-size:9px\">\n<circle class=\"flat\" r=\"{disc}\"/>\n",
        -disc - 5.0,
        2.0 * disc + 10.0
    );
    for (class, name, drape) in [
        ("mean", "as found", &tested.drapes[1]),
        ("less", "a standard deviation softer", &tested.drapes[0]),
        ("more", "a standard deviation stiffer", &tested.drapes[2]),
    ] {
        let _ = writeln!(
            out,
            "<polygon class=\"{class}\" points=\"{}\"><title>{name}: {:.0} %</title></polygon>",
            points(drape.outline.iter().copied()),
            100.0 * drape.coefficient
        );
    }
    let _ = writeln!(out, "<circle class=\"plate\" r=\"{plate}\"/>\n</svg>");
    out
}
