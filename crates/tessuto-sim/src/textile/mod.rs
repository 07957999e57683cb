//! Tests of the textile laboratory on a simulated sheet, and the closed forms that they are held against.
//!
//! [`cantilever`] lets a strip hang over the edge of a table, [`drape`] a disc over a plate. Both simulate the
//! continuum on meshes that bend as the theory of plates says ([`plate`]). [`elastica`] is the published curve of
//! all cantilevers; [`rest`] finds the shape at rest of any cloth.

pub mod cantilever;
pub mod drape;
pub mod elastica;
pub mod plate;
pub mod rest;

/// Acceleration of gravity [m/s²].
pub const GRAVITY: f64 = 9.81;
