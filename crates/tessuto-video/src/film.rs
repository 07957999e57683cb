//! A video file, looked at and ready to be decoded.

use std::path::{Path, PathBuf};

use crate::doors::{expect_file, expect_no_list};
use crate::ffmpeg::Programs;
use crate::frames::Frames;
use crate::native::{self, Limits, Refused};
use crate::refusal::Refusal;
use crate::stream::Stream;
use crate::{capture, ffprobe};

/// The way out of frames that are too large.
const SMALLER: &str = "make the film smaller first, e.g. ffmpeg -i IN -vf scale=1920:-2 OUT.mp4";

/// How a file is opened.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// The program ffmpeg; ffprobe is looked for beside it.
    pub ffmpeg: &'a Path,
    /// Longest side of a frame `[px]`.
    pub max_side: usize,
    /// Most memory that one frame may take, three bytes a pixel `[bytes]`.
    pub max_bytes: u64,
    /// Most time stamps that are read; longer films are refused unless only their first [`end`](Self::end) frames
    /// are wanted.
    pub max_frames: usize,
    /// Number of the first frame, as stored, that is not wanted; all are where `None`.
    pub end: Option<usize>,
}

impl Options<'_> {
    /// Refuses frames of a size that takes too much memory, before any is taken.
    ///
    /// # Errors
    /// [`Refusal`] with both sizes.
    pub fn expect_size(&self, [width, height]: [usize; 2]) -> Result<(), Refusal> {
        let bytes = (width as u64).saturating_mul(height as u64).saturating_mul(3);
        if bytes > self.max_bytes {
            return Err(Refusal::new(
                format!("{width}×{height} pixels take {bytes} bytes; at most {} are read", self.max_bytes),
                SMALLER,
            ));
        }
        if width.max(height) > self.max_side || width.min(height) < 2 {
            return Err(Refusal::new(
                format!("{width}×{height} pixels; sides of 2 to {} are read", self.max_side),
                SMALLER,
            ));
        }
        Ok(())
    }

    pub(crate) fn limits(&self) -> Limits {
        Limits { side: self.max_side, frame_bytes: self.max_bytes, frames: self.max_frames }
    }

    /// Most pixels of a frame.
    pub(crate) fn max_pixels(&self) -> u64 {
        // As large as the programs take it.
        (self.max_bytes / 3).min(i32::MAX as u64)
    }
}

/// One frame, 8-bit sRGB as encoded, shape [height, width, 3], upright.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Width and height `[px]`.
    pub size: [usize; 2],
    /// The colours.
    pub rgb: Vec<u8>,
}

/// What decodes a film.
#[derive(Clone, Debug)]
pub(crate) enum Backend {
    /// This crate.
    Native,
    /// The program ffmpeg.
    Ffmpeg(Programs),
}

/// The film in a video file.
#[derive(Clone, Debug)]
pub struct Film {
    /// What the container says of it.
    pub stream: Stream,
    /// Number of stored frames that a player shows; those of a damaged file may be fewer.
    pub stored: usize,
    /// What a user should know of the file.
    pub notes: Vec<String>,
    path: PathBuf,
    backend: Backend,
}

/// Looks at the video file at `path`. Of several films in it the one that a player shows is taken.
///
/// # Errors
/// [`Refusal`] of what is no regular file or a list of files, holds no film, is too large, changes its size where
/// that can be seen without decoding, or needs a program that is not there.
pub fn open(path: &Path, options: &Options) -> Result<Film, Refusal> {
    expect_file(path)?;
    expect_no_list(path)?;
    match native::open_within(path, options.limits()) {
        // The frames of a stream without container would have to be decoded to be counted.
        Ok(native) if native.stream().times.is_empty() => by_programs(path, options, None),
        Ok(native) => here(path, native.stream().clone(), options),
        Err(Refused::TooLarge(what)) => Err(Refusal::new(what, SMALLER)),
        Err(refused) => by_programs(path, options, Some(refused)),
    }
}

/// A film that is decoded by this crate.
fn here(path: &Path, stream: Stream, options: &Options) -> Result<Film, Refusal> {
    options.expect_size(stream.size)?;
    let capture_rate = capture::rate_of(stream.capture_rate, path);
    let stored = stream.times.len();
    let stream = Stream { capture_rate, ..stream };
    Ok(Film { stream, stored, notes: Vec::new(), path: path.to_path_buf(), backend: Backend::Native })
}

/// A film that ffprobe looks at and ffmpeg decodes, since it was `refused` here. What is damaged ffmpeg may still
/// read in part.
pub(crate) fn by_programs(path: &Path, options: &Options, refused: Option<Refused>) -> Result<Film, Refusal> {
    let look = ffprobe::look(path, Programs::beside(options.ffmpeg), options);
    let look = look.map_err(|refusal| match &refused {
        Some(refused) => behind(refused, refusal),
        None => refusal,
    })?;
    let mut notes = look.notes;
    if let Some(Refused::Damaged(what)) = refused {
        notes.push(format!("is damaged ({what}); ffmpeg reads it, frames may be wrong or missing"));
    }
    let (path, backend) = (path.to_path_buf(), Backend::Ffmpeg(look.programs));
    Ok(Film { stream: look.stream, stored: look.stored, notes, path, backend })
}

/// A missing program is needed for what is `refused` here.
pub(crate) fn behind(refused: &Refused, refusal: Refusal) -> Refusal {
    let refused = refused.to_string();
    match refusal.lacks_program && !refusal.what.contains(&refused) {
        true => Refusal { what: format!("{refused}; so it {}", refusal.what), ..refusal },
        false => refusal,
    }
}

/// Names and values of the metadata of a video file and of its tracks; `None` where it cannot be read.
pub fn tags(path: &Path, options: &Options) -> Option<Vec<(String, String)>> {
    expect_file(path).and_then(|()| expect_no_list(path)).ok()?;
    ffprobe::tags(path, &Programs::beside(options.ffmpeg), options)
}

impl Film {
    /// The frames up to `end`, in the order in which they are shown, each once; of interlaced film each moment is one.
    ///
    /// # Errors
    /// [`Refusal`] if the decoder cannot be started.
    pub fn frames(&self, end: Option<usize>, options: &Options) -> Result<Frames, Refusal> {
        Frames::start(&self.path, &self.backend, &self.stream, end, options)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    fn options() -> Options<'static> {
        let ffmpeg = Path::new("ffmpeg");
        Options { ffmpeg, max_side: 1 << 14, max_bytes: 1 << 28, max_frames: 1000, end: None }
    }

    /// An MP4 of `count` frames; `None`, and said so, where ffmpeg with x264 is missing.
    fn clip(folder: &Path, count: usize) -> Option<PathBuf> {
        let path = folder.join("clip.mp4");
        let source = ["-f", "lavfi", "-i", "testsrc2=s=96x64:r=30"];
        let mut command = Command::new("ffmpeg");
        command.args(["-v", "error", "-nostdin", "-y"]).args(source);
        command.args(["-frames:v", &count.to_string(), "-c:v", "libx264", "-pix_fmt", "yuv420p", "-g", "4"]);
        if !command.arg(&path).status().is_ok_and(|status| status.success()) {
            println!("NOT TESTED: films, ffmpeg with libx264 is missing");
            return None;
        }
        Some(path)
    }

    /// Turns the film's track by writing a matrix of 16.16 fixed point into its header.
    fn turn(path: &Path, [a, b, c, d]: [i32; 4]) {
        let mut bytes = std::fs::read(path).unwrap();
        let at = bytes.windows(4).position(|w| w == b"tkhd").unwrap() + 4 + 40;
        for (k, v) in [(0, a), (1, b), (3, c), (4, d)] {
            bytes[at + 4 * k..][..4].copy_from_slice(&(v << 16).to_be_bytes());
        }
        std::fs::write(path, bytes).unwrap();
    }

    fn frames(film: &Film, options: &Options) -> Vec<Frame> {
        film.frames(None, options).unwrap().map(|frame| frame.unwrap()).collect()
    }

    #[test]
    fn turned_frames_are_upright_as_ffmpeg_turns_them() {
        let folder = tempfile::tempdir().unwrap();
        let options = options();
        for (degrees, matrix) in
            [(0, [1, 0, 0, 1]), (90, [0, 1, -1, 0]), (180, [-1, 0, 0, -1]), (270, [0, -1, 1, 0])]
        {
            let Some(path) = clip(folder.path(), 3) else { return };
            turn(&path, matrix);
            let own = open(&path, &options).unwrap();
            assert!(matches!(own.backend, Backend::Native) && own.stream.turn == degrees);
            let other = by_programs(&path, &options, None).unwrap();
            assert_eq!((own.stored, own.stream.upright_size()), (other.stored, other.stream.upright_size()));
            let (own, other) = (frames(&own, &options), frames(&other, &options));
            assert_eq!(own.len(), other.len());
            for (a, b) in own.iter().zip(&other) {
                assert_eq!(a.size, b.size);
                let apart = a.rgb.iter().zip(&b.rgb).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>();
                let mean = apart / a.rgb.len() as f64;
                println!("{degrees}°: {mean:.2} of 255 apart");
                // Both make colours of the same bytes, each in its way; turned wrongly they are 60 apart.
                assert!(mean < 8.0, "{degrees}°: {mean}");
            }
        }
    }

    #[test]
    fn a_pixel_format_that_changes_is_refused_with_the_frame() {
        let folder = tempfile::tempdir().unwrap();
        let options = options();
        if clip(folder.path(), 4).is_none() {
            return;
        }
        let make = |arguments: &str| make(folder.path(), arguments);
        make("-i clip.mp4 -c:v libx264 -bf 0 -pix_fmt yuv420p -f h264 a.h264");
        make("-i clip.mp4 -c:v libx264 -bf 0 -pix_fmt yuv422p -f h264 b.h264");
        let part = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
        std::fs::write(folder.path().join("ab.h264"), [part("a.h264"), part("b.h264")].concat()).unwrap();
        make("-framerate 30 -i ab.h264 -c copy ab.mp4");
        let refusal = open(&folder.path().join("ab.mp4"), &options)
            .and_then(|film| film.frames(None, &options)?.find_map(Result::err).map_or(Ok(film), Err))
            .map(|_| ())
            .unwrap_err();
        println!("{refusal:?}");
        assert!(refusal.what.contains("changes its pixel format at frame 4"), "{refusal}");
        assert_eq!(refusal.part, Some(0..4));
    }

    /// Runs ffmpeg in `folder`.
    fn make(folder: &Path, arguments: &str) {
        let mut command = Command::new("ffmpeg");
        command.current_dir(folder).args("-v error -nostdin -y".split(' ')).args(arguments.split(' '));
        assert!(command.status().unwrap().success(), "{arguments}");
    }

    /// Half a turn, said by the frames that begin a group.
    const HALF: &str = "-bsf:v h264_metadata=display_orientation=insert:rotate=180";

    #[test]
    fn a_rotation_that_changes_is_refused_with_the_frame() {
        let folder = tempfile::tempdir().unwrap();
        let options = options();
        let Some(path) = clip(folder.path(), 8) else { return };
        let make = |arguments: &str| make(folder.path(), arguments);
        // Groups of four frames without others, so that the order of the file is the one of display.
        make("-i clip.mp4 -c:v libx264 -bf 0 -g 4 -f h264 a.h264");
        make(&format!("-i a.h264 -c copy {HALF} b.h264"));
        let part = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
        std::fs::write(folder.path().join("ab.h264"), [part("a.h264"), part("b.h264")].concat()).unwrap();
        for name in ["ab.mp4", "ab.mkv"] {
            make(&format!("-framerate 30 -i ab.h264 -c copy -bsf:v setts=ts=N/30/TB {name}"));
        }
        for name in ["a", "b"] {
            make(&format!("-framerate 30 -i {name}.h264 -c copy {name}.ts"));
        }
        std::fs::write(folder.path().join("ab.ts"), [part("a.ts"), part("b.ts")].concat()).unwrap();
        std::fs::remove_file(path).unwrap();
        for (name, is_native) in [("ab.mp4", true), ("ab.mkv", true), ("ab.mp4", false), ("ab.ts", false)] {
            let path = folder.path().join(name);
            let film = if is_native { open(&path, &options) } else { by_programs(&path, &options, None) };
            let refusal = film.and_then(|film| {
                assert!(matches!(film.backend, Backend::Native) == is_native, "{name}");
                film.frames(None, &options)?.find_map(Result::err).map_or(Ok(()), Err)
            });
            let refusal = refusal.unwrap_err();
            println!("{name}: {refusal}");
            assert!(
                refusal.what.contains("changes its rotation at frame 8: 0° before, "),
                "{name}: {refusal}"
            );
            assert!(refusal.what.contains("180° from there on"), "{name}: {refusal}");
            assert_eq!(refusal.part, Some(0..8), "{name}");
            // The frames before can be taken.
            let few = Options { end: Some(8), ..options };
            let film = if is_native { open(&path, &few) } else { by_programs(&path, &few, None) };
            let taken: Vec<_> = film.unwrap().frames(Some(8), &few).unwrap().collect();
            assert!(taken.len() == 8 && taken.iter().all(Result::is_ok), "{name}");
        }
    }

    #[test]
    fn a_rotation_that_all_frames_share_is_honoured() {
        let folder = tempfile::tempdir().unwrap();
        let options = options();
        if clip(folder.path(), 6).is_none() {
            return;
        }
        let make = |arguments: &str| make(folder.path(), arguments);
        // The group lasts, and with it what its first frame says: six frames of one group.
        make("-i clip.mp4 -c:v libx264 -bf 2 -g 100 one.mp4");
        make(&format!("-i one.mp4 -c copy {HALF} one_turned.mp4"));
        let one = frames(&open(&folder.path().join("one.mp4"), &options).unwrap(), &options);
        let film = open(&folder.path().join("one_turned.mp4"), &options).unwrap();
        assert!(matches!(film.backend, Backend::Native) && film.stream.turn == 180);
        let upright = |frames: &[Frame]| -> Vec<Frame> {
            frames.iter().map(|frame| crate::turn::turned(frame.clone(), 180)).collect()
        };
        assert!(frames(&film, &options) == upright(&one));
        // Where the next group says nothing, it ends.
        for name in ["one", "one_turned"] {
            make(&format!("-i {name}.mp4 -c copy -f h264 {name}.h264"));
        }
        let part = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
        let both = [part("one_turned.h264"), part("one.h264")].concat();
        std::fs::write(folder.path().join("both.h264"), both).unwrap();
        make("-framerate 30 -i both.h264 -c:v copy -bsf:v setts=ts=N/30/TB both.mp4");
        let film = open(&folder.path().join("both.mp4"), &options).unwrap();
        let refusal = film.frames(None, &options).unwrap().find_map(Result::err).unwrap();
        assert!(refusal.what.contains("changes its rotation at frame 6: 180° before, 0° from"), "{refusal}");
        // ffmpeg turns each frame by what it says itself; here each does.
        // Frames with other messages, beside which it is written; else it comes behind the frame.
        make("-i clip.mp4 -c:v libx264 -g 1 -b:v 1M -maxrate 1M -bufsize 1M -nal-hrd vbr -f h264 each.h264");
        make(&format!("-i each.h264 -c copy {HALF} -f h264 each_turned.h264"));
        for name in ["each", "each_turned"] {
            make(&format!("-framerate 30 -i {name}.h264 -c copy {name}.mp4"));
        }
        let path = folder.path().join("each_turned.mp4");
        let film = by_programs(&path, &options, None).unwrap();
        assert_eq!(film.stream.turn, 180);
        let each = by_programs(&folder.path().join("each.mp4"), &options, None).unwrap();
        assert!(frames(&film, &options) == upright(&frames(&each, &options)));
        assert_eq!(open(&path, &options).unwrap().stream.turn, 180);
    }

    #[test]
    fn what_is_damaged_amid_the_film_is_left_to_ffmpeg_with_a_note() {
        let folder = tempfile::tempdir().unwrap();
        let options = options();
        let Some(path) = clip(folder.path(), 12) else { return };
        let whole = frames(&open(&path, &options).unwrap(), &options);
        // Lengths of units that reach beyond their frame, in the second half of the film.
        let mut bytes = std::fs::read(&path).unwrap();
        let at = bytes.windows(4).position(|w| w == b"mdat").unwrap() + 4;
        let end = at + u32::from_be_bytes(bytes[at - 8..at - 4].try_into().unwrap()) as usize - 8;
        bytes[at + (end - at) / 2..end].fill(0xff);
        std::fs::write(&path, bytes).unwrap();
        let film = open(&path, &options).unwrap();
        let mut stream = film.frames(None, &options).unwrap();
        let read: Vec<_> = stream.by_ref().collect();
        let good = read.iter().filter(|frame| frame.is_ok()).count();
        assert!((1..=12).contains(&good), "{good}");
        assert_eq!(read[0].as_ref().unwrap(), &whole[0]);
        let told = stream.complaint().or(read.iter().find_map(|f| Some(f.as_ref().err()?.to_string())));
        println!("{good} frames, {told:?}");
        assert!(told.is_some_and(|told| told.contains("damaged") || told.contains("ffmpeg")));
        // Without ffmpeg, what was read before can still be taken.
        let lonely = Options { ffmpeg: Path::new("/no/such/ffmpeg"), ..options };
        let refusal = film.frames(None, &lonely).unwrap().find_map(Result::err);
        println!("{refusal:?}");
        let refusal = refusal.expect("there is no such program");
        assert!(
            refusal.what.contains("is damaged") && refusal.what.contains("needs the program ffmpeg"),
            "{refusal}"
        );
        assert!(refusal.part.is_some_and(|part| part.start == 0 && part.end > 0));
    }
}
