//! The place without the fabric: an image, or a second of film.

use std::path::Path;

use tessuto_core::parallel;

use super::video::{Reading, Video};
use crate::io::{expect_file, image};
use tessuto_core::error::Result;
use tessuto_core::image::Image;

/// Most frames of a film that are held; of longer ones every second, fourth, … counts.
const HELD: usize = 24;
/// No more frames of it are read.
const READ: usize = 600;

/// The empty place at `path`, sRGB, shape [height, width, 3]: an image, or the median of the frames of a video, in
/// which whoever walks through is not seen.
///
/// # Errors
/// [`Error::Input`](tessuto_core::Error::Input) if it is neither.
pub fn empty_place(path: &Path, ffmpeg: &Path) -> Result<Image> {
    expect_file(path)?;
    let is_image = path
        .extension()
        .is_some_and(|ending| ["png", "jpg", "jpeg"].iter().any(|known| ending.eq_ignore_ascii_case(known)));
    if is_image {
        return image::read(path);
    }
    let ([width, height], rgb) = median_of_film(path, ffmpeg)?;
    let data = rgb.iter().map(|v| f32::from(*v) / 255.0).collect();
    Ok(Image { width, height, channels: 3, data })
}

fn median_of_film(path: &Path, ffmpeg: &Path) -> Result<([usize; 2], Vec<u8>)> {
    let video = Video::every_frame(path, Reading { ffmpeg, fps: None, rate: None, end: Some(READ) })?;
    let (mut held, mut stride, mut size): (Vec<Vec<u8>>, usize, Option<[usize; 2]>) = (Vec::new(), 1, None);
    for (n, frame) in video.stream(Some(READ), ffmpeg)?.enumerate() {
        let frame = frame?;
        // Of one file all frames are of one size.
        size.get_or_insert(frame.size);
        if n % stride != 0 {
            continue;
        }
        held.push(frame.rgb);
        if held.len() == HELD {
            let mut n = 0;
            held.retain(|_| {
                n += 1;
                n % 2 == 1
            });
            stride *= 2;
        }
    }
    let Some(size) = size else { return Err(video.empty()) };
    let median = |i: usize| {
        let mut looks = [0_u8; HELD];
        held.iter().zip(&mut looks).for_each(|(frame, look)| *look = frame[i]);
        let looks = &mut looks[..held.len()];
        looks.sort_unstable();
        looks[looks.len() / 2]
    };
    let row = |y: usize| (3 * size[0] * y..3 * size[0] * (y + 1)).map(median).collect::<Vec<u8>>();
    Ok((size, parallel::map(size[1], row).concat()))
}
