//! The nearest points of a point and a triangle, or of two edges, and how they move with the corners.
//!
//! Both are Σ wₖ xₖ of four corners, with weights w that are linear in at most two free coordinates β; what
//! stands between them is c = Σ wₖ xₖ, D = min over β of ‖c‖². With cᵢ = ∂c/∂βᵢ = Σ uᵢₖ xₖ, uᵢ = ∂w/∂βᵢ:
//!
//!   ∂D/∂xₖ = 2 wₖ c,   ∂βᵢ/∂xₖ = −Σⱼ (G⁻¹)ᵢⱼ qⱼₖᵀ,   Gᵢⱼ = cᵢ·cⱼ,   qᵢₖ = wₖ cᵢ + uᵢₖ c,
//!   ∂²D/∂xₖ∂xₗ = 2 wₖ wₗ I − 2 Σᵢⱼ qᵢₖ (G⁻¹)ᵢⱼ qⱼₗᵀ.

use glam::{DMat3, DVec3};

/// Corners of an element: a point and a triangle (1 + 3), or two edges (2 + 2) `[m]`.
pub type Corners = [DVec3; 4];

/// A direction in which the weights may change.
type Direction = [f64; 4];

/// The nearest points of an element.
#[derive(Debug, Clone, Copy)]
pub struct Closest {
    /// w of the four corners; the first side's sum to 1, the second's to −1.
    pub weights: [f64; 4],
    /// c `[m]`.
    pub between: DVec3,
    /// u of the free coordinates.
    directions: [Direction; 2],
    /// How many are free.
    free: usize,
}

/// The matrix ∂²d/∂xₖ∂xₗ [1/m] of every two corners, d = ‖c‖.
pub type Blocks = [[DMat3; 4]; 4];

impl Closest {
    fn new(x: &Corners, weights: [f64; 4], directions: &[Direction]) -> Self {
        let mut both = [[0.0; 4]; 2];
        both[..directions.len()].copy_from_slice(directions);
        Self { weights, between: sum(&weights, x), directions: both, free: directions.len() }
    }

    /// Of the point `x[0]` and the triangle of the others.
    pub fn of_point_and_triangle(x: &Corners) -> Self {
        let [p, a, b, c] = *x;
        const AB: Direction = [0.0, 1.0, -1.0, 0.0];
        const AC: Direction = [0.0, 1.0, 0.0, -1.0];
        const BC: Direction = [0.0, 0.0, 1.0, -1.0];
        let (ab, ac, ap) = (b - a, c - a, p - a);
        let (d1, d2) = (ab.dot(ap), ac.dot(ap));
        if d1 <= 0.0 && d2 <= 0.0 {
            return Self::new(x, [1.0, -1.0, 0.0, 0.0], &[]);
        }
        let bp = p - b;
        let (d3, d4) = (ab.dot(bp), ac.dot(bp));
        if d3 >= 0.0 && d4 <= d3 {
            return Self::new(x, [1.0, 0.0, -1.0, 0.0], &[]);
        }
        let of_c = d1 * d4 - d3 * d2;
        if of_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
            let t = d1 / (d1 - d3);
            return Self::new(x, [1.0, t - 1.0, -t, 0.0], &[AB]);
        }
        let cp = p - c;
        let (d5, d6) = (ab.dot(cp), ac.dot(cp));
        if d6 >= 0.0 && d5 <= d6 {
            return Self::new(x, [1.0, 0.0, 0.0, -1.0], &[]);
        }
        let of_b = d5 * d2 - d1 * d6;
        if of_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
            let t = d2 / (d2 - d6);
            return Self::new(x, [1.0, t - 1.0, 0.0, -t], &[AC]);
        }
        let of_a = d3 * d6 - d5 * d4;
        if of_a <= 0.0 && d4 >= d3 && d5 >= d6 {
            let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
            return Self::new(x, [1.0, 0.0, t - 1.0, -t], &[BC]);
        }
        let all = of_a + of_b + of_c;
        let (s, t) = (of_b / all, of_c / all);
        Self::new(x, [1.0, s + t - 1.0, -s, -t], &[AB, AC])
    }

    /// Of the edges `x[0]`, `x[1]` and `x[2]`, `x[3]`.
    pub fn of_edges(x: &Corners) -> Self {
        const FIRST: Direction = [-1.0, 1.0, 0.0, 0.0];
        const SECOND: Direction = [0.0, 0.0, 1.0, -1.0];
        let (u, v, r) = (x[1] - x[0], x[3] - x[2], x[0] - x[2]);
        let (uu, vv, uv, ur, vr) = (u.dot(u), v.dot(v), u.dot(v), u.dot(r), v.dot(r));
        let across = u.cross(v).length_squared();
        let unit = |s: f64| s.clamp(0.0, 1.0);
        let mut s = if across > 0.0 { unit((uv * vr - ur * vv) / across) } else { 0.0 };
        let mut t = (uv * s + vr) / vv;
        if t < 0.0 {
            (s, t) = (unit(-ur / uu), 0.0);
        } else if t > 1.0 {
            (s, t) = (unit((uv - ur) / uu), 1.0);
        }
        let inside = |s: f64| s > 0.0 && s < 1.0;
        let weights = [1.0 - s, s, t - 1.0, -t];
        match (inside(s), inside(t)) {
            (true, true) => Self::new(x, weights, &[FIRST, SECOND]),
            (true, false) => Self::new(x, weights, &[FIRST]),
            (false, true) => Self::new(x, weights, &[SECOND]),
            (false, false) => Self::new(x, weights, &[]),
        }
    }

    /// d = √D `[m]`.
    #[inline]
    pub fn distance(&self) -> f64 {
        self.between.length()
    }

    /// G⁻¹ and q of every free coordinate and corner.
    fn moves(&self, x: &Corners) -> ([[f64; 2]; 2], [[DVec3; 4]; 2], [DVec3; 2]) {
        let along = self.directions.map(|u| sum(&u, x));
        let q = [0, 1]
            .map(|i| [0, 1, 2, 3].map(|k| along[i] * self.weights[k] + self.between * self.directions[i][k]));
        let g = [along[0].dot(along[0]), along[0].dot(along[1]), along[1].dot(along[1])];
        let inverse = match self.free {
            0 => [[0.0; 2]; 2],
            1 => [[g[0].recip(), 0.0], [0.0, 0.0]],
            // As an area: products of lengths lose the digits of edges that are nearly parallel.
            _ => {
                let det = along[0].cross(along[1]).length_squared();
                [[g[2] / det, -g[1] / det], [-g[1] / det, g[0] / det]]
            }
        };
        (inverse, q, along)
    }

    /// ∂²d of every two corners.
    pub fn hessian(&self, x: &Corners) -> Blocks {
        let (inverse, q, _) = self.moves(x);
        let distance = self.distance();
        let n = self.between / distance;
        let across = DMat3::IDENTITY - outer(n, n);
        let block = |k: usize, l: usize| {
            let mut own = across * (self.weights[k] * self.weights[l]);
            for i in 0..self.free {
                for j in 0..self.free {
                    own -= outer(q[i][k], q[j][l]) * inverse[i][j];
                }
            }
            own * distance.recip()
        };
        [0, 1, 2, 3].map(|k| [0, 1, 2, 3].map(|l| block(k, l)))
    }

    /// Given the derivatives of a number by c and by the weights, those by the corners.
    pub fn pull_back(&self, x: &Corners, by_between: DVec3, by_weights: [f64; 4]) -> [DVec3; 4] {
        let (inverse, q, along) = self.moves(x);
        let by_free = [0, 1].map(|i| {
            let weights: f64 = (0..4).map(|k| by_weights[k] * self.directions[i][k]).sum();
            weights + by_between.dot(along[i])
        });
        [0, 1, 2, 3].map(|k| {
            let mut own = by_between * self.weights[k];
            for i in 0..self.free {
                for j in 0..self.free {
                    own -= q[j][k] * (by_free[i] * inverse[i][j]);
                }
            }
            own
        })
    }
}

/// Σ wₖ xₖ.
#[inline]
pub fn sum(weights: &[f64; 4], x: &Corners) -> DVec3 {
    x[0] * weights[0] + x[1] * weights[1] + x[2] * weights[2] + x[3] * weights[3]
}

/// a bᵀ.
#[inline]
pub fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::rng::Rng;

    type Of = fn(&Corners) -> Closest;

    fn random(rng: &mut Rng) -> Corners {
        [0; 4].map(|_| rng.vector())
    }

    fn along(x: &Corners, d: &Corners, s: f64) -> Corners {
        [0, 1, 2, 3].map(|k| x[k] + d[k] * s)
    }

    /// Nearest of many points of both.
    fn searched(x: &Corners, is_triangle: bool) -> f64 {
        const N: usize = 60;
        let mut best = f64::INFINITY;
        for i in 0..=N {
            for j in 0..=N {
                let (s, t) = (i as f64 / N as f64, j as f64 / N as f64);
                let between = if is_triangle {
                    let t = t * (1.0 - s);
                    x[0] - (x[1] * (1.0 - s - t) + x[2] * s + x[3] * t)
                } else {
                    x[0].lerp(x[1], s) - x[2].lerp(x[3], t)
                };
                best = best.min(between.length());
            }
        }
        best
    }

    #[test]
    fn nothing_is_nearer() {
        let mut rng = Rng::new(1, 0);
        let kinds = [
            (Closest::of_point_and_triangle as Of, true, [true, false, false, false]),
            (Closest::of_edges as Of, false, [true, true, false, false]),
        ];
        for (of, is_triangle, first) in kinds {
            let mut free = [0; 3];
            for _ in 0..300 {
                let x = random(&mut rng);
                let closest = of(&x);
                free[closest.free] += 1;
                let (d, other) = (closest.distance(), searched(&x, is_triangle));
                assert!(d <= other + 1e-12 && other < d + 0.1, "{d} m, but {other} m was found");
                let side = |of: bool| -> f64 {
                    (0..4).filter(|k| first[*k] == of).map(|k| closest.weights[k]).sum()
                };
                assert!((side(true) - 1.0).abs() < 1e-12 && (side(false) + 1.0).abs() < 1e-12);
            }
            println!("free coordinates: {free:?}");
            assert!(free.iter().all(|n| *n > 10), "every kind of neighbourhood: {free:?}");
        }
    }

    #[test]
    fn derivatives_are_differences() {
        let mut rng = Rng::new(2, 0);
        let mut worst = [0.0f64; 3];
        for of in [Closest::of_point_and_triangle as Of, Closest::of_edges] {
            for _ in 0..300 {
                let (x, d, e) = (random(&mut rng), random(&mut rng), random(&mut rng));
                let closest = of(&x);
                if closest.distance() < 0.05 {
                    continue;
                }
                let step = 1e-6;
                let (plus, minus) = (of(&along(&x, &d, step)), of(&along(&x, &d, -step)));
                if [plus.free, minus.free] != [closest.free; 2] {
                    continue;
                }
                let n = closest.between / closest.distance();
                let slope: f64 = (0..4).map(|k| closest.weights[k] * n.dot(d[k])).sum();
                let numeric = (plus.distance() - minus.distance()) / (2.0 * step);
                worst[0] = worst[0].max((slope - numeric).abs());
                // The slope along e, differentiated along d.
                let slope_of = |c: &Closest| -> f64 {
                    (0..4).map(|k| c.weights[k] * (c.between / c.distance()).dot(e[k])).sum()
                };
                let h = closest.hessian(&x);
                let curvature: f64 = (0..4)
                    .flat_map(|k| (0..4).map(move |l| (k, l)))
                    .map(|(k, l)| e[k].dot(h[k][l] * d[l]))
                    .sum();
                let numeric = (slope_of(&plus) - slope_of(&minus)) / (2.0 * step);
                worst[1] = worst[1].max((curvature - numeric).abs() / (1.0 + numeric.abs()));
                // Any function of c and the weights.
                let (by_c, by_w) = (rng.vector(), [0; 4].map(|_| rng.normal()));
                let number =
                    |c: &Closest| c.between.dot(by_c) + (0..4).map(|k| c.weights[k] * by_w[k]).sum::<f64>();
                let back = closest.pull_back(&x, by_c, by_w);
                let slope: f64 = (0..4).map(|k| back[k].dot(d[k])).sum();
                let numeric = (number(&plus) - number(&minus)) / (2.0 * step);
                worst[2] = worst[2].max((slope - numeric).abs() / (1.0 + numeric.abs()));
            }
        }
        println!(
            "worst: distance {:.1e}, its second derivatives {:.1e}, pulled back {:.1e}",
            worst[0], worst[1], worst[2]
        );
        assert!(worst.iter().all(|w| *w > 0.0 && *w < 1e-4), "{worst:?}");
    }
}
