//! What a video file holds, as data: time stamps, geometry and colour of its film, and its frames.

mod annexb;
mod bits;
mod bytes;
mod contained;
mod frame;
mod h264;
mod hevc;
mod limits;
mod matroska;
mod mp4;
pub mod native;
mod picture;
mod quiet;
mod refused;
mod rgb;
mod sequence;
mod source;
mod stream;
mod track;

pub use frame::{Chroma, Frame, Planes};
pub use limits::Limits;
pub use native::Native;
pub use refused::Refused;
pub use rgb::Colours;
pub use stream::{Fields, Matrix, Stream, Transfer};
