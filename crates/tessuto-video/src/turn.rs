//! Frames turned upright.

use crate::film::Frame;

/// `frame`, turned clockwise by `degrees`, a multiple of 90.
pub(crate) fn turned(frame: Frame, degrees: u32) -> Frame {
    let [width, height] = frame.size;
    let size = if matches!(degrees, 90 | 270) { [height, width] } else { [width, height] };
    // Where the pixel of a turned column and row comes from.
    let from = |x: usize, y: usize| match degrees {
        90 => [y, height - 1 - x],
        180 => [width - 1 - x, height - 1 - y],
        270 => [width - 1 - y, x],
        _ => [x, y],
    };
    if degrees == 0 {
        return frame;
    }
    let mut rgb = Vec::with_capacity(frame.rgb.len());
    for y in 0..size[1] {
        for x in 0..size[0] {
            let [u, v] = from(x, y);
            let at = 3 * (v * width + u);
            rgb.extend_from_slice(&frame.rgb[at..at + 3]);
        }
    }
    Frame { size, rgb }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_upper_left_pixel_goes_where_a_player_shows_it() {
        let pixel = |n: u8| [n, n, n];
        let frame = Frame { size: [3, 2], rgb: (0..6).flat_map(pixel).collect() };
        let shown = |degrees| {
            let turned = turned(frame.clone(), degrees);
            (turned.size, turned.rgb.chunks_exact(3).map(|p| p[0]).collect::<Vec<_>>())
        };
        // 0 1 2
        // 3 4 5
        assert_eq!(shown(0), ([3, 2], vec![0, 1, 2, 3, 4, 5]));
        assert_eq!(shown(90), ([2, 3], vec![3, 0, 4, 1, 5, 2]));
        assert_eq!(shown(180), ([3, 2], vec![5, 4, 3, 2, 1, 0]));
        assert_eq!(shown(270), ([2, 3], vec![2, 5, 1, 4, 0, 3]));
    }
}
