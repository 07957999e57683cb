//! Fabrics of any outline on a table: how exact the outline is, and whether the search finds their motion.

mod motion;
mod outline;
mod shapes;
