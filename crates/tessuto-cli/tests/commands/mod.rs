//! Commands, good and bad input, kills and interruptions.

mod bad_input;
mod check_bad_input;
mod compare;
mod completions;
mod evaluate;
mod held;
mod import;
mod import_cameras;
mod import_files;
mod import_video;
#[cfg(feature = "man")]
mod man_pages;
mod masks;
mod on_table;
mod output;
mod physics;
mod render;
mod report;
#[cfg(feature = "rerun")]
mod rerun;
mod resume;
mod run;
mod settings;
mod sheet;
mod strangers;
mod studio;
mod template;
mod template_files;
mod verdict;
mod view;
mod views;
