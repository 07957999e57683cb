//! Scenes, images, arrays and meshes on disk.

mod arrays_meshes;
mod hdr;
mod image;
mod memory;
mod recordings;
mod scene;
mod truth;
mod views;
