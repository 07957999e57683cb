//! L B Lᵀ with pivots chosen among a front's own rows: for the rare matrices that elimination in the given order spoils.
//! Plain loops, one thread.
//!
//! Source: Bunch and Kaufman, *Some stable methods for calculating inertia and solving symmetric linear systems*, 1977,
//! on the dense front; Duff and Reid (see above) restrict pivots so. B has blocks of one or two rows.

use super::Fronts;

/// A factor with pivots.
#[derive(Debug, Clone)]
pub struct Pivoted {
    /// Columns of every front: L below the diagonal, the diagonal of B on it.
    values: Vec<f64>,
    /// Below the diagonal of B, where it has a block of two; else 0.
    subdiagonal: Vec<f64>,
    /// The own row of a front that came to each place.
    order: Vec<usize>,
}

/// A pivot: its place, the row that is swapped to it, and whether it takes the next row along.
struct Choice {
    place: usize,
    row: usize,
    two: bool,
}

impl Fronts {
    /// Eliminates the matrix with the given values, whatever it is. A singular one leaves numbers that are not finite.
    pub(in crate::math) fn factorize_pivoting(&self, matrix: &[f64]) -> Pivoted {
        let rows = self.fronts.last().map_or(0, |f| 3 * (f.first + f.own));
        let mut out =
            Pivoted { values: vec![0.0; self.len()], subdiagonal: vec![0.0; rows], order: vec![0; rows] };
        let mut updates: Vec<Vec<f64>> = Vec::with_capacity(self.fronts.len());
        for front in &self.fronts {
            let (k, n, height) = (front.width(), front.update(), front.height());
            let own = &mut out.values[front.values[1]..][..front.len()];
            let columns = front.matrix[0]..front.matrix[1];
            for (place, value) in self.places[columns.clone()].iter().zip(&matrix[columns]) {
                own[*place as usize] = *value;
            }
            let mut update = vec![0.0; n * n];
            for child in &front.children {
                let below = std::mem::take(&mut updates[child.front]);
                let side = self.fronts[child.front].update();
                child.add_to_own(&below, side, own, height);
                child.add_to_update(&below, side, &mut update, front);
            }
            let first = 3 * front.first;
            let (subdiagonal, order) = (&mut out.subdiagonal[first..][..k], &mut out.order[first..][..k]);
            eliminate(own, height, subdiagonal, order);
            take_products(own, height, subdiagonal, &mut update);
            updates.push(update);
        }
        out
    }

    /// Solves A X = B in place; `x` of shape [rows in elimination order, `columns`].
    pub(in crate::math) fn solve_pivoting(&self, factor: &Pivoted, x: &mut [f64], columns: usize) {
        for column in 0..columns {
            let mut one: Vec<f64> = x[column..].iter().step_by(columns).copied().collect();
            self.solve_one(factor, &mut one);
            x[column..].iter_mut().step_by(columns).zip(one).for_each(|(x, one)| *x = one);
        }
    }

    fn solve_one(&self, factor: &Pivoted, x: &mut [f64]) {
        let places = |k: usize, boundary: &[u32]| 3 * boundary[k / 3] as usize + k % 3;
        for front in &self.fronts {
            let (first, k) = (3 * front.first, front.width());
            let columns = front.own_values(&factor.values).chunks_exact(front.height().max(1));
            let mut own: Vec<f64> = factor.order[first..][..k].iter().map(|row| x[first + row]).collect();
            for (j, column) in columns.enumerate() {
                let of_j = own[j];
                (j + 1..k).for_each(|i| own[i] -= column[i] * of_j);
                (0..front.update()).for_each(|i| x[places(i, &front.boundary)] -= column[k + i] * of_j);
            }
            x[first..][..k].copy_from_slice(&own);
        }
        for front in self.fronts.iter().rev() {
            let (first, k, height) = (3 * front.first, front.width(), front.height());
            let values = front.own_values(&factor.values);
            let mut own = x[first..][..k].to_vec();
            divide(&mut own, values, height, &factor.subdiagonal[first..][..k]);
            for (j, column) in values.chunks_exact(height.max(1)).enumerate().rev() {
                let boundary = (0..front.update()).map(|i| column[k + i] * x[places(i, &front.boundary)]);
                let later: f64 = (j + 1..k).map(|i| column[i] * own[i]).sum();
                own[j] -= later + boundary.sum::<f64>();
            }
            for (row, value) in factor.order[first..][..k].iter().zip(own) {
                x[first + row] = value;
            }
        }
    }
}

/// B⁻¹ x.
fn divide(x: &mut [f64], values: &[f64], height: usize, subdiagonal: &[f64]) {
    let pivot = |j: usize| values[j * height + j];
    let mut j = 0;
    while j < x.len() {
        if subdiagonal[j] == 0.0 {
            x[j] /= pivot(j);
            j += 1;
        } else {
            [x[j], x[j + 1]] = divided([x[j], x[j + 1]], [pivot(j), subdiagonal[j], pivot(j + 1)]);
            j += 2;
        }
    }
}

/// The inverse of [[a, b], [b, c]] times a vector.
fn divided([x, y]: [f64; 2], [a, b, c]: [f64; 3]) -> [f64; 2] {
    // b is the largest: nothing overflows.
    let (a, c) = (a / b, c / b);
    let scale = 1.0 / (b * (a * c - 1.0));
    [(c * x - y) * scale, (a * y - x) * scale]
}

/// Eliminates the columns of a front; see [`Pivoted`].
fn eliminate(own: &mut [f64], height: usize, subdiagonal: &mut [f64], order: &mut [usize]) {
    let k = order.len();
    order.iter_mut().enumerate().for_each(|(place, row)| *row = place);
    let mut j = 0;
    while j < k {
        let choice = choose(own, height, k, j);
        swap(own, height, k, choice.place, choice.row);
        order.swap(choice.place, choice.row);
        let next = j + 1 + usize::from(choice.two);
        let (pivots, later) = own.split_at_mut(next * height);
        let [a, b] = [&pivots[j * height..][..height], &pivots[(next - 1) * height..][..height]];
        // Of every later row: its part of L, in one or two columns.
        let of_row: Vec<[f64; 2]> = match choice.two {
            false => (next..height).map(|i| [a[i] / a[j], 0.0]).collect(),
            true => {
                let block = [a[j], a[j + 1], b[j + 1]];
                (next..height).map(|i| divided([a[i], b[i]], block)).collect()
            }
        };
        for (c, column) in (next..k).zip(later.chunks_exact_mut(height)) {
            let [p, q] = if choice.two { [a[c], b[c]] } else { [a[c], 0.0] };
            let rows = column[c..].iter_mut().zip(&of_row[c - next..]);
            rows.for_each(|(v, l)| *v -= l[0] * p + l[1] * q);
        }
        for (i, l) in (next..height).zip(of_row) {
            own[j * height + i] = l[0];
            if choice.two {
                own[(j + 1) * height + i] = l[1];
            }
        }
        if choice.two {
            subdiagonal[j] = std::mem::take(&mut own[j * height + j + 1]);
        }
        j = next;
    }
}

/// The next pivot from place `j` on.
fn choose(own: &[f64], height: usize, k: usize, j: usize) -> Choice {
    // Bounds the growth of a step of one row and of one of two alike.
    let alpha = (1.0 + 17f64.sqrt()) / 8.0;
    let at = |i: usize, c: usize| own[c * height + i].abs();
    let largest = |rows: &mut dyn Iterator<Item = (usize, f64)>| {
        rows.fold((j, 0.0), |best, next| if next.1 > best.1 { next } else { best })
    };
    let (row, off) = largest(&mut (j + 1..k).map(|i| (i, at(i, j))));
    if off == 0.0 || at(j, j) >= alpha * off {
        return Choice { place: j, row: j, two: false };
    }
    let (_, beyond) =
        largest(&mut (j..row).map(|c| (c, at(row, c))).chain((row + 1..k).map(|i| (i, at(i, row)))));
    if at(j, j) * beyond >= alpha * off * off {
        Choice { place: j, row: j, two: false }
    } else if at(row, row) >= alpha * beyond {
        Choice { place: j, row, two: false }
    } else {
        Choice { place: j + 1, row, two: true }
    }
}

/// Swaps own rows and columns p < q of a front of which the lower triangle is there.
fn swap(own: &mut [f64], height: usize, k: usize, p: usize, q: usize) {
    if p == q {
        return;
    }
    let at = |i: usize, c: usize| c * height + i;
    (0..p).for_each(|c| own.swap(at(p, c), at(q, c)));
    own.swap(at(p, p), at(q, q));
    (p + 1..q).for_each(|i| own.swap(at(i, p), at(q, i)));
    (q + 1..height).for_each(|i| own.swap(at(i, p), at(i, q)));
    debug_assert!(q < k);
}

/// Takes L B Lᵀ of the rows of the boundary from the `update` (lower triangle).
fn take_products(own: &[f64], height: usize, subdiagonal: &[f64], update: &mut [f64]) {
    let k = subdiagonal.len();
    let n = height - k;
    for p in 0..k {
        let column = &own[p * height..][..height];
        let beside = |q: usize, factor: f64| move |i: usize| factor * own[q * height + i];
        let (before, after) = (p.checked_sub(1).map_or(0.0, |q| subdiagonal[q]), subdiagonal[p]);
        let (left, right) = (beside(p.saturating_sub(1), before), beside((p + 1).min(k - 1), after));
        for c in 0..n {
            let factor = column[p] * column[k + c] + left(k + c) + right(k + c);
            let rows = update[c * n + c..][..n - c].iter_mut().zip(&column[k + c..]);
            rows.for_each(|(v, l)| *v -= l * factor);
        }
    }
}
