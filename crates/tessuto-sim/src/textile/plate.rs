//! Sheets that bend as the theory of plates says.
//!
//! On a lattice every three vertices in a row bend like a hinge, around the edge on either side of the middle one, by
//! the curvature along the row; the two diagonals of a cell turn by its twist alone. With w the height of the sheet,
//! the energy per area
//!
//!   ½ (D₁ w_xx² + D₂ w_yy² + (D₁ + D₂) w_xy²),
//!
//! of a plate without lateral contraction, follows from half of B = D₁ n_x² + D₂ n_y² for each of both hinges across
//! the direction n, and from ½ (D₁ + D₂) (A/‖e‖²)² for each diagonal e of a cell of area A. It bends along every
//! direction n by that B. This is what hinges between the triangles of a mesh do not: split along like diagonals
//! they make one bias three times as stiff as the other, and a strip gives way by a twist; split along alternate
//! ones every row has kinks that cost nothing.

use std::collections::BTreeSet;
use std::sync::Arc;

use glam::DVec2;

use crate::continuum::Continuum;
use crate::hinge::Hinge;
use crate::stiffness::Stiffness;
use crate::{Cloth, Fabric};
use tessuto_core::math::block_matrix::BlockPattern;
use tessuto_core::math::factor::Analysis;
use tessuto_core::mesh::{Face, Mesh};

/// Elastic properties of a sheet of [`crate::cloth::AREA_DENSITY`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plate {
    /// Tension per strain along x and y [N/m].
    pub membrane: [f64; 2],
    /// Shear force per angle [N/m].
    pub shear: f64,
    /// Moment per curvature and width along x and y [N·m].
    pub bending: [f64; 2],
}

/// Vertices in rows and columns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    /// Vertices in a row.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
    /// The last column has the first as its neighbour.
    pub closed: bool,
}

impl Lattice {
    fn at(&self, column: usize, row: usize) -> u32 {
        (row * self.columns + column % self.columns) as u32
    }

    /// Columns that cells begin at.
    fn cells_in_row(&self) -> usize {
        self.columns - usize::from(!self.closed)
    }

    /// Every vertex at `point`(column, row) `[m]` in the plane z = 0, cells split along alternate diagonals. The
    /// texture coordinates are x and y.
    pub fn mesh(&self, point: impl Fn(usize, usize) -> DVec2) -> Mesh {
        let uvs: Vec<DVec2> =
            (0..self.columns * self.rows).map(|v| point(v % self.columns, v / self.columns)).collect();
        let mut mesh =
            Mesh { positions: uvs.iter().map(|p| p.extend(0.0)).collect(), uvs, faces: Vec::new() };
        for row in 0..self.rows - 1 {
            for column in 0..self.cells_in_row() {
                let [a, b, c, d] = self.cell(column, row);
                let even = (row + column) % 2 == 0;
                for corners in if even { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] } {
                    mesh.faces.push(Face { vertices: corners.to_vec(), uvs: corners.to_vec() });
                }
            }
        }
        mesh
    }

    /// Corners of a cell, one after another.
    fn cell(&self, column: usize, row: usize) -> [u32; 4] {
        [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(c, r)| self.at(column + c, row + r))
    }

    /// Ends of the edge and both apexes of every hinge across rows and columns, and of those on diagonals.
    fn hinges(&self) -> [Vec<[u32; 4]>; 2] {
        let (mut straight, mut diagonal) = (Vec::new(), Vec::new());
        for row in 0..self.rows {
            for column in 0..self.columns {
                let o = self.at(column, row);
                if self.closed || (column > 0 && column + 1 < self.columns) {
                    let ends = [column + self.columns - 1, column + 1].map(|c| self.at(c, row));
                    for beside in [row.checked_sub(1), Some(row + 1).filter(|r| *r < self.rows)] {
                        let beside = beside.map(|r| self.at(column, r));
                        straight.extend(beside.map(|b| [o, b, ends[1], ends[0]]));
                    }
                }
                if row > 0 && row + 1 < self.rows {
                    let ends = [row - 1, row + 1].map(|r| self.at(column, r));
                    let before = (self.closed || column > 0).then(|| column + self.columns - 1);
                    let after = Some(column + 1).filter(|c| self.closed || *c < self.columns);
                    let beside = [before, after].into_iter().flatten().map(|c| self.at(c, row));
                    straight.extend(beside.map(|b| [o, b, ends[1], ends[0]]));
                }
                if row + 1 < self.rows && column < self.cells_in_row() {
                    let [a, b, c, d] = self.cell(column, row);
                    diagonal.extend([[a, c, d, b], [b, d, a, c]]);
                }
            }
        }
        [straight, diagonal]
    }

    /// The cloth of a [`mesh`](Self::mesh), with the stiffness of every element.
    pub fn cloth(&self, mesh: &Mesh, plate: &Plate) -> (Cloth, Stiffness) {
        let x = &mesh.positions;
        let mut cloth = Cloth::continuum(mesh);
        let membranes = cloth.continuum.take().map_or_else(Vec::new, |c| c.membranes);
        let mut pairs: Vec<[u32; 2]> = Vec::new();
        for [a, b, c] in mesh.triangles() {
            pairs.extend([[b, a], [c, a], [c, b]]);
        }
        let [d1, d2] = plate.bending;
        let (mut hinges, mut bending) = (Vec::new(), Vec::new());
        for (of, is_diagonal) in self.hinges().into_iter().zip([false, true]) {
            for [a, b, c, d] in of {
                let first = pairs.len();
                pairs.extend([[b, a], [c, a], [d, a], [c, b], [d, b], [d, c]]);
                let hinge = Hinge::new([a, b, c, d], x, [0, 1, 2, 3, 4, 5].map(|k| first + k));
                let across = (x[c as usize] - x[d as usize]).normalize();
                bending.push(match is_diagonal {
                    true => 0.5 * (d1 + d2) / (hinge.weight * hinge.weight),
                    false => 0.5 * (d1 * across.x * across.x + d2 * across.y * across.y),
                });
                hinges.push(hinge);
            }
        }
        let pattern = BlockPattern::new(x, &pairs);
        cloth.continuum = Some(Continuum::new(membranes, hinges, &pattern));
        cloth.analysis = Arc::new(Analysis::new(&pattern));
        cloth.pattern = Arc::new(pattern);
        let [warp, weft] = plate.membrane;
        let mut stiffness =
            Fabric { warp, weft, poisson: 0.0, shear: plate.shear, bend: 0.0 }.stiffness(&cloth);
        stiffness.hinge = bending;
        (cloth, stiffness)
    }
}

/// Doubles the stiffness of the hinges around edges between `held` vertices: the cells on one side of them are held
/// straight, and without that the sheet would bend half a cell before it.
pub fn clamp(cloth: &Cloth, held: &[usize], stiffness: &mut Stiffness) {
    let held: BTreeSet<u32> = held.iter().map(|v| *v as u32).collect();
    let hinges = cloth.continuum.as_ref().map_or(&[][..], |c| &c.hinges);
    for (hinge, b) in hinges.iter().zip(&mut stiffness.hinge) {
        if hinge.vertices[..2].iter().all(|v| held.contains(v)) {
            *b *= 2.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use tessuto_core::mesh::Positions;

    /// Heights z of the sheet `rest` with the curvatures xx, yy and xy [1/m].
    fn bent(rest: &[DVec3], [xx, yy, xy]: [f64; 3]) -> Positions {
        let height = |p: &DVec3| 0.5 * (xx * p.x * p.x + yy * p.y * p.y) + xy * p.x * p.y;
        rest.iter().map(|p| DVec3::new(p.x, p.y, height(p))).collect()
    }

    #[test]
    fn every_curvature_has_the_energy_of_a_plate() {
        let (lattice, step) = (Lattice { columns: 21, rows: 31, closed: false }, DVec2::new(0.01, 0.006));
        let mesh = lattice.mesh(|c, r| DVec2::new(c as f64, r as f64) * step);
        let plate = Plate { membrane: [50.0; 2], shear: 10.0, bending: [3e-6, 1e-6] };
        let (cloth, stiffness) = lattice.cloth(&mesh, &plate);
        let [d1, d2] = plate.bending;
        // Without the cells at the border, which have a hinge on one side only.
        let cells = |lines: [usize; 2]| (lines[0] * lines[1]) as f64 * step.x * step.y;
        let part = |curvature: [f64; 3]| {
            cloth.energy(&stiffness, &bent(&mesh.positions, curvature.map(|c| 0.01 * c))).bend / 1e-4
        };
        let close = |own: f64, expected: f64| {
            assert!((own / expected - 1.0).abs() < 2e-3, "{own} {expected}");
        };
        close(part([1.0, 0.0, 0.0]), 0.5 * d1 * cells([19, 30]));
        close(part([0.0, 1.0, 0.0]), 0.5 * d2 * cells([20, 29]));
        close(part([0.0, 0.0, 1.0]), 0.5 * (d1 + d2) * cells([20, 30]));
        // Along both biases.
        for twist in [0.5, -0.5] {
            let sum = 0.25 * (d1 * cells([19, 30]) + d2 * cells([20, 29]) + (d1 + d2) * cells([20, 30]));
            close(part([0.5, 0.5, twist]), 0.5 * sum);
        }
    }
}
