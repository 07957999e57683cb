//! What a video file holds, as data: time stamps, geometry and colour of its film, and its frames.
//!
//! [`open`] looks at a file and gives a [`Film`]: a [`Stream`], which is what the container says, and the frames, one after the other.
//! [`rate`] makes of the time stamps a constant rate. Texts that programs print for people are never read for what they mean.

mod capture;
mod doors;
mod ffmpeg;
mod ffprobe;
mod film;
pub mod rate;
mod refusal;
mod stream;

pub use doors::expect_file;
pub use ffmpeg::Frames;
pub use film::{Film, Frame, Options, open, tags};
pub use refusal::Refusal;
pub use stream::{Fields, Matrix, Stream, Transfer};
