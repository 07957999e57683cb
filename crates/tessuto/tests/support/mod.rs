//! What several tests share.

pub mod missing;
pub mod raster_scenes;
pub mod recordings;
pub mod scene_maker;
pub mod seamed;
