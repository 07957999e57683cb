//! Soft coverage at the outline: how far a pixel's colour lies on the line from the colour of the background to that of
//! the fabric there (the compositing equation of T. Porter and T. Duff), where these differ; else how much of the pixel
//! the smoothed outline covers.

use super::frames::{Colours, squared};
use super::plate::Plate;
use super::region::{Field, Region};

/// Coverage changes within this distance `[px]` of the cut.
const REACH: f32 = 2.0;
/// Where colours of fabric and background are taken `[px]`.
const AWAY: f32 = 3.5;
/// A difference of colours `[grey levels]`, on top of the noise, at which colour and outline count alike.
const PLAIN: f32 = 20.0;

/// Coverage of the pixels in the rectangle of the region.
pub(super) fn coverage(frame: &Colours, region: &Region, plate: &Plate, noise: f32) -> Field {
    let rect = region.rect;
    let (w, h) = (rect.width(), rect.height());
    let distance = region.signed_distance(rect);
    let smooth = smoothed(&distance);
    let mut out = Field::new(rect, 0.0);
    for i in 0..w * h {
        let d = distance.data[i];
        if d.abs() > REACH {
            out.data[i] = f32::from(u8::from(d > 0.0));
            continue;
        }
        let (x, y) = ((i % w + rect.x0) as f32, (i / w + rect.y0) as f32);
        let by_outline = (0.5 + smooth.data[i]).clamp(0.0, 1.0);
        let slope = [
            smooth.sample(x + 1.0, y) - smooth.sample(x - 1.0, y),
            smooth.sample(x, y + 1.0) - smooth.sample(x, y - 1.0),
        ];
        let length = slope[0].hypot(slope[1]).max(1e-3);
        let along = |t: f32| frame.sample(x + t * slope[0] / length, y + t * slope[1] / length);
        let fabric = along(AWAY - d);
        let (behind, sure, spread) = plate.at(x as usize, y as usize);
        let outside = along(-AWAY - d);
        let background: [f32; 3] = std::array::from_fn(|c| outside[c] + sure * (behind[c] - outside[c]));
        let apart = squared(fabric, background);
        let own = frame.at(x as usize, y as usize);
        let along_line: f32 = (0..3).map(|c| (own[c] - background[c]) * (fabric[c] - background[c])).sum();
        let by_colour = (along_line / apart.max(1e-3)).clamp(0.0, 1.0);
        // A colour off the line is neither of the two.
        let on_line: [f32; 3] =
            std::array::from_fn(|c| background[c] + by_colour * (fabric[c] - background[c]));
        let noise = noise.hypot(spread);
        let doubt = PLAIN * PLAIN + 8.0 * noise * noise + 4.0 * squared(own, on_line);
        let trust = apart / (apart + doubt);
        // The cut says which side; colour may move the outline by a pixel, not more.
        let limits = [(smooth.data[i] - 0.5).clamp(0.0, 1.0), (smooth.data[i] + 1.5).clamp(0.0, 1.0)];
        out.data[i] = (by_outline + trust * (by_colour - by_outline)).clamp(limits[0], limits[1]);
    }
    out
}

/// Mean of 3×3, twice: stairs of the cut become slopes.
fn smoothed(field: &Field) -> Field {
    let (w, h) = (field.rect.width(), field.rect.height());
    let mut out = field.clone();
    for _ in 0..2 {
        for [count, step, lines, other] in [[w, 1, h, w], [h, w, w, 1]] {
            for line in 0..lines {
                let mut before = out.data[line * other];
                for k in 0..count {
                    let i = line * other + k * step;
                    let own = out.data[i];
                    let after = if k + 1 < count { out.data[i + step] } else { own };
                    out.data[i] = (before + own + after) / 3.0;
                    before = own;
                }
            }
        }
    }
    out
}
