//! Scenes, images, arrays and meshes on disk.

mod arrays_meshes;
mod hdr;
mod image;
mod recordings;
mod scene;
mod truth;
