//! Minimum cuts by augmenting paths along two search trees that are kept from path to path: Y. Boykov, V. Kolmogorov,
//! "An experimental comparison of min-cut/max-flow algorithms for energy minimization in vision", PAMI 26 (2004). Made
//! for graphs of images: many nodes, few arcs each, short paths. Capacities are whole numbers, so that the cut is exact
//! and the same on every machine.

use std::collections::VecDeque;

/// No parent: the node is in neither tree.
const FREE: u32 = u32::MAX;
/// The parent is the source or the sink itself.
const TERMINAL: u32 = u32::MAX - 1;
/// The parent was lost to a saturated arc.
const ORPHAN: u32 = u32::MAX - 2;
const NONE: u32 = u32::MAX;

/// A graph of nodes between a source and a sink.
pub(super) struct Graph {
    /// First arc of each node.
    first: Vec<u32>,
    /// What an arc may take; its sister, the arc back, is the number with the last bit turned.
    residual: Vec<i32>,
    head: Vec<u32>,
    /// Next arc of the same node.
    next: Vec<u32>,
    /// From the source where positive, to the sink where negative.
    terminal: Vec<i32>,
    parent: Vec<u32>,
    sinks: Vec<bool>,
    /// When the distance to the terminal was last known, and what it was.
    stamp: Vec<u32>,
    distance: Vec<u32>,
    time: u32,
    active: VecDeque<u32>,
    is_active: Vec<bool>,
    orphans: VecDeque<u32>,
}

impl Graph {
    /// A graph of `nodes` without arcs.
    pub fn new(nodes: usize, arcs: usize) -> Self {
        Self {
            first: vec![NONE; nodes],
            residual: Vec::with_capacity(2 * arcs),
            head: Vec::with_capacity(2 * arcs),
            next: Vec::with_capacity(2 * arcs),
            terminal: vec![0; nodes],
            parent: vec![FREE; nodes],
            sinks: vec![false; nodes],
            stamp: vec![0; nodes],
            distance: vec![0; nodes],
            time: 0,
            active: VecDeque::new(),
            is_active: vec![false; nodes],
            orphans: VecDeque::new(),
        }
    }

    /// Adds to what the source (positive) or the sink (negative) may give or take at node `i`.
    pub fn add_terminal(&mut self, i: usize, capacity: i32) {
        self.terminal[i] = self.terminal[i].saturating_add(capacity);
    }

    /// Adds an arc of this capacity in both directions.
    pub fn add_arcs(&mut self, i: usize, j: usize, capacity: i32) {
        for (from, to) in [(i, j), (j, i)] {
            let arc = self.head.len() as u32;
            self.head.push(to as u32);
            self.residual.push(capacity);
            self.next.push(self.first[from]);
            self.first[from] = arc;
        }
    }

    /// Cuts: true for the nodes on the source's side. What hangs on neither side is the sink's.
    pub fn cut(mut self) -> Vec<bool> {
        self.solve();
        (0..self.first.len()).map(|i| self.parent[i] != FREE && !self.sinks[i]).collect()
    }

    fn solve(&mut self) {
        for i in 0..self.first.len() {
            if self.terminal[i] != 0 {
                self.sinks[i] = self.terminal[i] < 0;
                self.parent[i] = TERMINAL;
                self.distance[i] = 1;
                self.activate(i);
            }
        }
        while let Some(&i) = self.active.front() {
            let i = i as usize;
            let bridge = if self.parent[i] == FREE { None } else { self.grow(i) };
            self.time += 1;
            if let Some(arc) = bridge {
                self.augment(arc);
                while let Some(orphan) = self.orphans.pop_front() {
                    self.adopt(orphan as usize);
                }
            } else {
                self.active.pop_front();
                self.is_active[i] = false;
            }
        }
    }

    fn activate(&mut self, i: usize) {
        if !std::mem::replace(&mut self.is_active[i], true) {
            self.active.push_back(i as u32);
        }
    }

    /// Whether flow from the source's side towards the sink's may still go from the node's parent side to its
    /// child side along `arc`, an arc that leaves a node of this tree.
    fn is_open(&self, arc: u32, sink: bool) -> bool {
        self.residual[if sink { arc ^ 1 } else { arc } as usize] > 0
    }

    /// Takes the neighbours of `i` into its tree; the arc to the other tree, in the direction of flow, if it meets it.
    fn grow(&mut self, i: usize) -> Option<u32> {
        let sink = self.sinks[i];
        let mut arc = self.first[i];
        while arc != NONE {
            if self.is_open(arc, sink) {
                let j = self.head[arc as usize] as usize;
                if self.parent[j] == FREE {
                    self.sinks[j] = sink;
                    self.hang(j, arc ^ 1, i);
                    self.activate(j);
                } else if self.sinks[j] != sink {
                    return Some(if sink { arc ^ 1 } else { arc });
                } else if self.stamp[j] <= self.stamp[i] && self.distance[j] > self.distance[i] {
                    // A shorter way to the terminal.
                    self.hang(j, arc ^ 1, i);
                }
            }
            arc = self.next[arc as usize];
        }
        None
    }

    fn hang(&mut self, child: usize, arc: u32, parent: usize) {
        self.parent[child] = arc;
        self.stamp[child] = self.stamp[parent];
        self.distance[child] = self.distance[parent] + 1;
    }

    /// Sends what the path over `bridge` takes.
    fn augment(&mut self, bridge: u32) {
        let ends = [self.head[(bridge ^ 1) as usize] as usize, self.head[bridge as usize] as usize];
        let mut amount = self.residual[bridge as usize];
        for (side, &end) in ends.iter().enumerate() {
            let mut i = end;
            while self.parent[i] != TERMINAL {
                let arc = self.parent[i];
                amount = amount.min(self.residual[(arc ^ u32::from(side == 0)) as usize]);
                i = self.head[arc as usize] as usize;
            }
            amount = amount.min(self.terminal[i].abs());
        }
        self.residual[bridge as usize] -= amount;
        self.residual[(bridge ^ 1) as usize] += amount;
        for (side, &end) in ends.iter().enumerate() {
            let mut i = end;
            while self.parent[i] != TERMINAL {
                let forward = self.parent[i] ^ u32::from(side == 0);
                let up = self.head[self.parent[i] as usize] as usize;
                self.residual[forward as usize] -= amount;
                self.residual[(forward ^ 1) as usize] += amount;
                if self.residual[forward as usize] == 0 {
                    self.parent[i] = ORPHAN;
                    self.orphans.push_front(i as u32);
                }
                i = up;
            }
            self.terminal[i] -= if side == 0 { amount } else { -amount };
            if self.terminal[i] == 0 {
                self.parent[i] = ORPHAN;
                self.orphans.push_front(i as u32);
            }
        }
    }

    /// Distance of `j` from its terminal; `None` if it hangs on an orphan.
    fn way_up(&mut self, mut j: usize) -> Option<u32> {
        let mut steps = 0;
        loop {
            if self.stamp[j] == self.time {
                return Some(steps + self.distance[j]);
            }
            steps += 1;
            match self.parent[j] {
                TERMINAL => {
                    self.stamp[j] = self.time;
                    self.distance[j] = 1;
                    return Some(steps);
                }
                ORPHAN | FREE => return None,
                arc => j = self.head[arc as usize] as usize,
            }
        }
    }

    /// Finds a new parent for `i`, or sets it free and makes its children orphans.
    fn adopt(&mut self, i: usize) {
        let sink = self.sinks[i];
        let mut best: Option<(u32, u32)> = None;
        let mut arc = self.first[i];
        while arc != NONE {
            let j = self.head[arc as usize] as usize;
            if self.is_open(arc ^ 1, sink)
                && self.sinks[j] == sink
                && self.parent[j] != FREE
                && let Some(distance) = self.way_up(j)
            {
                if best.is_none_or(|(_, d)| distance < d) {
                    best = Some((arc, distance));
                }
                let (mut k, mut left) = (j, distance);
                while self.stamp[k] != self.time {
                    self.stamp[k] = self.time;
                    self.distance[k] = left;
                    left -= 1;
                    k = self.head[self.parent[k] as usize] as usize;
                }
            }
            arc = self.next[arc as usize];
        }
        if let Some((arc, distance)) = best {
            self.parent[i] = arc;
            self.stamp[i] = self.time;
            self.distance[i] = distance + 1;
            return;
        }
        self.parent[i] = FREE;
        let mut arc = self.first[i];
        while arc != NONE {
            let j = self.head[arc as usize] as usize;
            if self.sinks[j] == sink && self.parent[j] != FREE {
                if self.is_open(arc ^ 1, sink) {
                    self.activate(j);
                }
                let own = self.parent[j];
                if own != TERMINAL && own != ORPHAN && self.head[own as usize] as usize == i {
                    self.parent[j] = ORPHAN;
                    self.orphans.push_back(j as u32);
                }
            }
            arc = self.next[arc as usize];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::rng::Rng;

    /// Arcs and terminals of a graph.
    type Plain = (Vec<(usize, usize, i32)>, Vec<i32>);

    /// What a cut costs.
    fn cost((arcs, terminals): &Plain, source: &[bool]) -> i64 {
        let across = arcs.iter().filter(|(i, j, _)| source[*i] != source[*j]).map(|a| i64::from(a.2));
        let open =
            terminals.iter().zip(source).filter(|(t, s)| (**t > 0) != **s).map(|(t, _)| i64::from(t.abs()));
        across.sum::<i64>() + open.sum::<i64>()
    }

    /// The plain twin: shortest paths, found anew each time (Edmonds and Karp), on a matrix. Its flow is the least
    /// cost.
    fn flow((arcs, terminals): &Plain) -> i64 {
        let n = terminals.len();
        let mut left = vec![vec![0_i64; n + 2]; n + 2];
        for (i, j, c) in arcs {
            left[*i][*j] += i64::from(*c);
            left[*j][*i] += i64::from(*c);
        }
        for (i, t) in terminals.iter().enumerate() {
            left[n][i] += i64::from((*t).max(0));
            left[i][n + 1] += i64::from((-*t).max(0));
        }
        let mut total = 0;
        loop {
            let mut from = vec![usize::MAX; n + 2];
            let mut queue = VecDeque::from([n]);
            while let Some(i) = queue.pop_front() {
                for j in 0..n + 2 {
                    if from[j] == usize::MAX && j != n && left[i][j] > 0 {
                        from[j] = i;
                        queue.push_back(j);
                    }
                }
            }
            if from[n + 1] == usize::MAX {
                return total;
            }
            let mut path = vec![n + 1];
            while *path.last().unwrap() != n {
                path.push(from[*path.last().unwrap()]);
            }
            let amount = path.windows(2).map(|p| left[p[1]][p[0]]).min().unwrap();
            for p in path.windows(2) {
                left[p[1]][p[0]] -= amount;
                left[p[0]][p[1]] += amount;
            }
            total += amount;
        }
    }

    #[test]
    fn the_cut_costs_what_the_plain_twin_says() {
        let mut random = Rng::new(7, 0);
        let mut below = |n: usize| ((random.uniform() * n as f64) as usize).min(n - 1);
        for round in 0..300 {
            // Grids with some far arcs, terminals of all kinds.
            let (w, h) = (1 + below(6), 1 + below(6));
            let n = w * h;
            let mut arcs = Vec::new();
            for i in 0..n {
                let (x, y) = (i % w, i / w);
                if x + 1 < w {
                    arcs.push((i, i + 1, below(12) as i32));
                }
                if y + 1 < h {
                    arcs.push((i, i + w, below(12) as i32));
                }
                let far = below(n);
                if far != i && below(4) == 0 {
                    arcs.push((i, far, below(20) as i32));
                }
            }
            let terminals: Vec<i32> = (0..n).map(|_| below(41) as i32 - 20).collect();
            let mut graph = Graph::new(n, arcs.len());
            terminals.iter().enumerate().for_each(|(i, t)| graph.add_terminal(i, *t));
            arcs.iter().for_each(|(i, j, c)| graph.add_arcs(*i, *j, *c));
            let plain = (arcs, terminals);
            let source = graph.cut();
            assert_eq!(cost(&plain, &source), flow(&plain), "round {round}");
        }
    }
}
