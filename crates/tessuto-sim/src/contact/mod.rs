//! Contact: layers of one sheet that do not pass through each other, and bodies that the sheet lies on.
//!
//! Every pair of elements that comes nearer than a thickness has a barrier's energy (`pair.rs`): vertices and
//! triangles, edges and edges of the sheet and of bodies; vertices and planes; triangles and spheres. It is part of
//! the incremental potential of [`super::implicit_euler`], and so is friction (`slip.rs`). No step passes through: a
//! collision test along each iteration's way bounds it (`advance.rs`). The same bits for any number of threads.
//!
//! ```
//! use tessuto_core::glam::{DVec2, DVec3};
//! use tessuto_sim::contact::{Body, ContactSettings, Shape};
//! use tessuto_sim::{
//!     Accelerations, Cloth, Integrator, RolloutInputs, State, StepSettings, Stiffness, play,
//! };
//!
//! // A sheet that falls onto a table 2 cm below it, y down.
//! let mesh = tessuto_core::mesh::grid(5, 5, DVec2::splat(0.2), 1.0);
//! let table = Body { shape: Shape::Plane { normal: -DVec3::Y, height: -0.12 }, friction: 0.3 };
//! let settings = ContactSettings { bodies: vec![table], ..ContactSettings::default() };
//! let cloth = Cloth::new(&mesh).with_contact(&mesh, &settings)?;
//! let initial = State { x: mesh.positions.clone(), v: vec![DVec3::ZERO; 25] };
//! let mut accelerations = Accelerations::zeros(5, 1, 25);
//! accelerations.constant = DVec3::Y * 9.81;
//! let stiffness = Stiffness::uniform(&cloth, [200.0, 1e-3, 1e-3]);
//! let inputs = RolloutInputs { initial: &initial, accelerations: &accelerations, stiffness: &stiffness };
//! let step = StepSettings {
//!     integrator: Integrator::ImplicitEuler,
//!     step: 0.005,
//!     damping: 0.9,
//!     tolerance: 1e-6,
//!     newton_limit: 100,
//! };
//! let frames = play(&cloth, &step, 10, 5, &inputs)?;
//! assert!(frames[4].iter().all(|x| x.y < 0.12), "nothing is below the table");
//! # Ok::<(), tessuto_core::Error>(())
//! ```

mod advance;
pub mod apart;
mod barrier;
mod candidates;
mod closest;
pub mod crossings;
mod pair;
mod slip;
pub(super) mod touch;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::cloth::{AREA_DENSITY, Cloth};
use candidates::{Bounds, meetings};
use pair::{Kind, Law, Pair};
use tessuto_core::error::{Error, Result};
use tessuto_core::mesh::{Mesh, Positions, triangle_area};

/// The thickness, where none is given: this part of the shortest edge. Elements that share no corner are farther
/// apart at rest on any mesh of sound triangles.
const OF_EDGE: f64 = 0.1;

/// What touches what, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ContactSettings {
    /// Gap at which elements begin to feel each other `[m]`; a tenth of the shortest edge if none is given.
    pub thickness: Option<f64>,
    /// Stiffness κ of the barrier [N/m²]: at half of the thickness it presses with 1.2 κ.
    pub stiffness: f64,
    /// Whether layers of the sheet touch each other.
    pub layers: bool,
    /// Coefficient of friction between layers.
    pub friction: f64,
    /// Speed at which friction has its whole force [m/s]; below, it grows smoothly.
    pub slip: f64,
    /// What else there is.
    pub bodies: Vec<Body>,
}

impl Default for ContactSettings {
    fn default() -> Self {
        Self { thickness: None, stiffness: 10.0, layers: true, friction: 0.3, slip: 0.01, bodies: Vec::new() }
    }
}

/// A body that stands still.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// What it is.
    pub shape: Shape,
    /// Coefficient of friction between it and the sheet.
    #[serde(default)]
    pub friction: f64,
}

/// A body's shape, in the frame of the cloth's positions `[m]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// The side n·x > `height` of a plane is free.
    Plane {
        /// n, of any length but 0.
        normal: DVec3,
        /// Along the unit vector of n `[m]`.
        height: f64,
    },
    /// A ball.
    Sphere {
        /// Its centre.
        centre: DVec3,
        /// Its radius `[m]`.
        radius: f64,
    },
    /// A mesh, both of whose sides hold.
    Mesh {
        /// Its vertices.
        positions: Positions,
        /// Its triangles.
        triangles: Vec<[u32; 3]>,
    },
}

/// A sheet's elements and the bodies', ready for steps.
#[derive(Debug, Clone)]
pub struct Contact {
    settings: ContactSettings,
    law: Law,
    /// Number of the sheet's vertices; nodes of bodies follow.
    vertex_count: usize,
    /// Area of every vertex `[m²]`.
    areas: Vec<f64>,
    /// The sheet's triangles and edges, then those of bodies.
    triangles: Vec<Element<3>>,
    edges: Vec<Element<2>>,
    /// How many are the sheet's.
    own_triangles: usize,
    own_edges: usize,
    /// Of bodies.
    nodes: Positions,
    /// Pairs of vertices that the cloth's pattern holds, sorted; with the pattern's pair.
    places: Vec<([u32; 2], u32)>,
    /// The template's positions, then the bodies' nodes.
    rest: Positions,
}

/// A triangle or an edge.
#[derive(Debug, Clone, Copy)]
struct Element<const N: usize> {
    nodes: [u32; N],
    /// Of it, at rest `[m²]`.
    area: f64,
    /// Its friction with the sheet: 0 is the sheet's own, k the k-th body's, counted from 1.
    surface: usize,
}

impl Cloth {
    /// The same cloth, with contact. `template` is the mesh that it was made from.
    ///
    /// # Errors
    /// [`Error::Input`] if a number is out of its range or a body is none.
    pub fn with_contact(mut self, template: &Mesh, settings: &ContactSettings) -> Result<Self> {
        self.contact = Some(std::sync::Arc::new(Contact::new(&self, template, settings)?));
        Ok(self)
    }
}

impl Contact {
    fn new(cloth: &Cloth, template: &Mesh, settings: &ContactSettings) -> Result<Self> {
        let x = &template.positions;
        let shortest = cloth
            .triangles
            .iter()
            .flat_map(|t| sides(*t))
            .map(|[a, b]| x[a as usize].distance(x[b as usize]));
        let thickness =
            settings.thickness.unwrap_or_else(|| OF_EDGE * shortest.fold(f64::INFINITY, f64::min));
        settings.check(thickness)?;
        let vertex_count = x.len();
        let mut contact = Self {
            law: Law { thickness, stiffness: settings.stiffness },
            vertex_count,
            areas: cloth.masses.iter().map(|m| m / AREA_DENSITY).collect(),
            triangles: Vec::new(),
            edges: Vec::new(),
            own_triangles: 0,
            own_edges: 0,
            nodes: Vec::new(),
            places: places(cloth),
            rest: x.clone(),
            settings: settings.clone(),
        };
        contact.add_elements(&cloth.triangles, 0, 0);
        (contact.own_triangles, contact.own_edges) = (contact.triangles.len(), contact.edges.len());
        for (k, body) in settings.bodies.iter().enumerate() {
            let first = (vertex_count + contact.nodes.len()) as u32;
            match &body.shape {
                Shape::Plane { .. } => {}
                Shape::Sphere { centre, .. } => contact.add_nodes(&[*centre]),
                Shape::Mesh { positions, triangles } => {
                    contact.add_nodes(positions);
                    contact.add_elements(triangles, first, k + 1);
                }
            }
        }
        Ok(contact)
    }

    fn add_nodes(&mut self, positions: &[DVec3]) {
        self.nodes.extend(positions);
        self.rest.extend(positions);
    }

    /// Adds triangles and their edges; their nodes begin at `first`.
    fn add_elements(&mut self, triangles: &[[u32; 3]], first: u32, surface: usize) {
        let mut edges: Vec<([u32; 2], f64)> = Vec::new();
        for t in triangles {
            let nodes = t.map(|k| k + first);
            let area = triangle_area(&self.rest, nodes);
            self.triangles.push(Element { nodes, area, surface });
            edges.extend(sides(nodes).map(|[a, b]| ([a.min(b), a.max(b)], area / 3.0)));
        }
        edges.sort_unstable_by_key(|(nodes, _)| *nodes);
        for shared in edges.chunk_by(|a, b| a.0 == b.0) {
            let area = shared.iter().map(|(_, area)| area).sum();
            self.edges.push(Element { nodes: shared[0].0, area, surface });
        }
    }

    /// What was asked for.
    pub fn settings(&self) -> &ContactSettings {
        &self.settings
    }

    /// The gap at which elements begin to feel each other `[m]`.
    pub fn thickness(&self) -> f64 {
        self.law.thickness
    }

    /// Coefficients of friction: between layers, then of every body.
    pub fn frictions(&self) -> Vec<f64> {
        let bodies = self.settings.bodies.iter().map(|b| b.friction);
        std::iter::once(self.settings.friction).chain(bodies).collect()
    }

    /// The same with other coefficients of friction, in the order of [`frictions`](Self::frictions).
    #[must_use]
    pub fn with_frictions(&self, frictions: &[f64]) -> Self {
        let mut other = self.clone();
        other.settings.friction = frictions[0];
        let bodies = other.settings.bodies.iter_mut();
        bodies.zip(&frictions[1..]).for_each(|(body, friction)| body.friction = *friction);
        other
    }

    /// The pattern's pair of two vertices, and whether it is named the other way round.
    fn place(&self, a: u32, b: u32) -> Option<(usize, bool)> {
        let of = |key: [u32; 2]| {
            let found = self.places.binary_search_by(|(pair, _)| pair.cmp(&key)).ok()?;
            Some(self.places[found].1 as usize)
        };
        of([a, b]).map(|pair| (pair, false)).or_else(|| of([b, a]).map(|pair| (pair, true)))
    }

    /// All pairs that can come within the thickness while every vertex stays in its box.
    fn pairs(&self, boxes: &[Bounds]) -> Vec<Pair> {
        let reach = self.law.thickness;
        let mut all: Vec<Bounds> = boxes.to_vec();
        all.extend(self.nodes.iter().map(|x| Bounds::of(*x, *x)));
        let points: Vec<Bounds> = all.iter().map(|b| b.grown(reach)).collect();
        let own = 0..self.vertex_count;
        let triangles: Vec<Bounds> = self.triangles.iter().map(|t| Bounds::around(&all, &t.nodes)).collect();
        let edges: Vec<Bounds> = self.edges.iter().map(|e| Bounds::around(&all, &e.nodes)).collect();
        let mut pairs = Vec::new();
        // The sheet's vertices and all triangles, then bodies' vertices and the sheet's.
        let layers = self.settings.layers;
        for [v, t] in meetings(&points[own.clone()], &triangles) {
            let triangle = &self.triangles[t as usize];
            if triangle.surface > 0 || layers {
                pairs.extend(self.point_and_triangle(v, triangle, self.areas[v as usize], triangle.surface));
            }
        }
        self.extend_with_bodies(boxes, &points, &triangles[..self.own_triangles], &mut pairs);
        let grown: Vec<Bounds> = edges[..self.own_edges].iter().map(|b| b.grown(reach)).collect();
        for [a, b] in meetings(&grown, &edges) {
            let (first, second) = (&self.edges[a as usize], &self.edges[b as usize]);
            if second.surface > 0 || (layers && b > a) {
                pairs.extend(self.two_edges(first, second));
            }
        }
        pairs
    }

    fn extend_with_bodies(
        &self,
        boxes: &[Bounds],
        points: &[Bounds],
        triangles: &[Bounds],
        pairs: &mut Vec<Pair>,
    ) {
        let mut node = self.vertex_count as u32;
        for (k, body) in self.settings.bodies.iter().enumerate() {
            let surface = k + 1;
            match &body.shape {
                Shape::Plane { normal, height } => {
                    let n = normal.normalize();
                    let near = |v: &usize| boxes[*v].lowest(n) - height < self.law.thickness;
                    let pair = |v: usize| {
                        let (kind, area) = (Kind::Plane(n, *height), self.areas[v]);
                        Pair { nodes: [v as u32; 4], kind, area, offset: 0.0, surface }
                    };
                    pairs.extend((0..boxes.len()).filter(near).map(pair));
                }
                Shape::Sphere { centre, radius } => {
                    let reach = radius + self.law.thickness;
                    for (bounds, triangle) in triangles.iter().zip(&self.triangles) {
                        if bounds.square_distance(*centre) < reach * reach {
                            let [a, b, c] = triangle.nodes;
                            let (kind, nodes) = (Kind::PointTriangle, [node, a, b, c]);
                            pairs.push(Pair { nodes, kind, area: triangle.area, offset: *radius, surface });
                        }
                    }
                    node += 1;
                }
                Shape::Mesh { positions, .. } => {
                    let count = positions.len() as u32;
                    let own = &points[node as usize..(node + count) as usize];
                    for [v, t] in meetings(own, triangles) {
                        let triangle = &self.triangles[t as usize];
                        pairs.extend(self.point_and_triangle(node + v, triangle, triangle.area, surface));
                    }
                    node += count;
                }
            }
        }
    }

    /// `None` where they touch at rest.
    fn point_and_triangle(&self, v: u32, triangle: &Element<3>, area: f64, surface: usize) -> Option<Pair> {
        let [a, b, c] = triangle.nodes;
        let pair = Pair { nodes: [v, a, b, c], kind: Kind::PointTriangle, area, offset: 0.0, surface };
        (!triangle.nodes.contains(&v) && !self.touches_at_rest(&pair)).then_some(pair)
    }

    /// `None` where they touch at rest.
    fn two_edges(&self, first: &Element<2>, second: &Element<2>) -> Option<Pair> {
        let ([a, b], [c, d]) = (first.nodes, second.nodes);
        if [c, d].contains(&a) || [c, d].contains(&b) {
            return None;
        }
        let along = |[a, b]: [u32; 2]| self.rest[b as usize] - self.rest[a as usize];
        let kind = Kind::of_edges(along(first.nodes), along(second.nodes));
        let area = 0.5 * (first.area + second.area);
        let pair = Pair { nodes: [a, b, c, d], kind, area, offset: 0.0, surface: second.surface };
        (!self.touches_at_rest(&pair)).then_some(pair)
    }

    /// Whether two elements of the sheet are within the thickness in the template: they are no layers.
    fn touches_at_rest(&self, pair: &Pair) -> bool {
        let own = pair.nodes.iter().all(|k| (*k as usize) < self.vertex_count);
        own && pair.gap_size(&pair.corners(&self.rest)) < self.law.thickness
    }
}

impl ContactSettings {
    fn check(&self, thickness: f64) -> Result<()> {
        let positive = |name: &str, value: f64, unit: &str| {
            let good = value.is_finite() && value > 0.0;
            good.then_some(()).ok_or_else(|| bad(format!("{name} is {value} {unit}"), "it must be above 0"))
        };
        positive("the thickness", thickness, "m")?;
        positive("the stiffness of the barrier", self.stiffness, "N/m²")?;
        positive("the speed of slipping", self.slip, "m/s")?;
        let frictions = std::iter::once(self.friction).chain(self.bodies.iter().map(|b| b.friction));
        for (k, friction) in frictions.enumerate() {
            if !(friction.is_finite() && friction >= 0.0) {
                let whose = if k == 0 { "between layers".to_owned() } else { format!("of body {}", k - 1) };
                return Err(bad(format!("the friction {whose} is {friction}"), "it must be 0 or more"));
            }
        }
        for (k, body) in self.bodies.iter().enumerate() {
            body.shape
                .check()
                .map_err(|problem| bad(format!("body {k}: {problem}"), "see its shape's fields"))?;
        }
        Ok(())
    }
}

impl Shape {
    fn check(&self) -> std::result::Result<(), String> {
        match self {
            Self::Plane { normal, height } => {
                let good = normal.is_finite() && normal.length() > 0.0 && height.is_finite();
                good.then_some(()).ok_or_else(|| format!("a plane of normal {normal} and height {height} m"))
            }
            Self::Sphere { centre, radius } => {
                let good = centre.is_finite() && radius.is_finite() && *radius > 0.0;
                good.then_some(()).ok_or_else(|| format!("a sphere of centre {centre} and radius {radius} m"))
            }
            Self::Mesh { positions, triangles } => {
                if let Some(v) = positions.iter().position(|x| !x.is_finite()) {
                    return Err(format!("vertex {v} is {}", positions[v]));
                }
                let beyond = triangles.iter().position(|t| t.iter().any(|k| *k as usize >= positions.len()));
                match beyond {
                    Some(t) => Err(format!(
                        "triangle {t} is {:?}, but there are {} vertices",
                        triangles[t],
                        positions.len()
                    )),
                    None => Ok(()),
                }
            }
        }
    }
}

fn bad(problem: String, hint: &str) -> Error {
    Error::input("contact", problem, hint)
}

/// The three edges of a triangle.
fn sides([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// Every pair of vertices of the cloth's pattern that elements of contact can name, with the pattern's pair.
fn places(cloth: &Cloth) -> Vec<([u32; 2], u32)> {
    let triangles = cloth.triangles.iter().zip(&cloth.triangle_pairs);
    let mut all: Vec<([u32; 2], u32)> = triangles
        .flat_map(|([a, b, c], pairs)| {
            [([*b, *a], pairs[0] as u32), ([*c, *a], pairs[1] as u32), ([*c, *b], pairs[2] as u32)]
        })
        .collect();
    for spring in cloth.bends.iter().chain(&cloth.shears) {
        let [a, o, c] = spring.vertices;
        let [ao, ac, oc] = spring.pairs.map(|p| p as u32);
        all.extend([([a, o], ao), ([a, c], ac), ([o, c], oc)]);
    }
    all.sort_unstable();
    all.dedup_by_key(|(pair, _)| *pair);
    all
}
