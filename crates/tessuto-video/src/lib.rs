//! What a video file holds, as data: time stamps, geometry and colour of its film, and its frames.
//!
//! [`open`] looks at a file and gives a [`Film`]: a [`Stream`], which is what the container says, and the frames,
//! one after the other. What phones record is read and decoded here, see [`native`]; all else by the programs
//! ffprobe and ffmpeg. [`rate`] makes of the time stamps a constant rate. Texts that programs print for people are
//! never read for what they mean.
//!
//! # Without another program
//!
//! Containers are MP4 and QuickTime (fragments, edit lists, several tracks) and Matroska; streams of H.264 and
//! HEVC without one are read as well. Frames are those of H.264 (8 and 10 bits, 4:2:0 and 4:2:2) and HEVC (8 and
//! 10 bits, 4:2:0 and 4:4:4), what phones record, and have the bytes that ffmpeg gives them. All else is refused:
//! [`native::Refused::NotHandled`] says that another program may read it, [`native::Refused::Damaged`] that none
//! should.
//!
//! ```no_run
//! use tessuto_video::native;
//!
//! # fn main() -> Result<(), native::Refused> {
//! let mut film = native::open("clip.mov".as_ref())?;
//! let [width, height] = film.stream().size;
//! println!("{} frames of {width}×{height} px", film.stream().times.len());
//! while let Some(rgb) = film.next_rgb() {
//!     // Red, green and blue of the first pixel.
//!     println!("{:?}", &rgb?[..3]);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! Frames come as they are asked for, in the order in which they are shown; samples are read from the file one by
//! one, and a bounded number of frames waits for others. Nothing is taken on a file's word: tables may not be
//! longer than the file, frames not larger than [`native::Limits`] allow, before memory is taken.
//!
//! Several frames of H.264 are decoded at once, by threads of their own, while whoever reads works on those before.
//! The same file gives the same bytes everywhere, and the same errors: where anything about a film is not sound, its
//! frames are decoded anew, one after the other. HEVC is decoded by the thread that asks.
//!
//! The decoders are the crates `rust_h264` and `rust_h265`. If they panic, the film is damaged, and nothing is
//! printed: the first film that is opened puts a panic hook before the program's own which keeps silent about
//! theirs alone. Holes of zeros within a frame are damage. Known limit: of single bits of a frame that are turned,
//! the decoder of H.264 notices few, and of slices that are missing from a frame none; ffmpeg notices two of
//! three, says so, and goes on.

mod ahead;
mod annexb;
mod bits;
mod bytes;
mod capture;
mod contained;
mod doors;
mod ffmpeg;
mod ffprobe;
mod film;
mod format;
mod frame;
mod frames;
mod h264;
mod hevc;
mod limits;
mod matroska;
mod mp4;
pub mod native;
mod orientation;
mod quiet;
pub mod rate;
mod refusal;
mod refused;
mod rgb;
mod sequence;
mod source;
mod stream;
mod track;
mod turn;

pub use doors::expect_file;
pub use film::{Film, Frame, Options, open, tags};
pub use frames::Frames;
pub use refusal::Refusal;
pub use stream::{Fields, Matrix, Stream, Transfer};
