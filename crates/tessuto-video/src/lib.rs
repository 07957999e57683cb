//! What a video file holds, as data: time stamps, geometry and colour of its film, and its frames.

mod stream;

pub use stream::{Fields, Matrix, Stream, Transfer};
