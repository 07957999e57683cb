//! Tree of axis-aligned boxes: which item is nearest to a query, for any exact distance.

use glam::DVec3;

/// Items per leaf.
const LEAF: usize = 4;

/// Axis-aligned box, `low <= high`.
#[derive(Debug, Clone, Copy)]
pub struct Bounds {
    low: DVec3,
    high: DVec3,
}

impl Bounds {
    /// The smallest box around `points`; there must be one.
    pub fn around(points: impl IntoIterator<Item = DVec3>) -> Self {
        let empty = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };
        points.into_iter().fold(empty, |b, p| Self { low: b.low.min(p), high: b.high.max(p) })
    }

    /// Centre, and half of the size.
    pub fn centre(&self) -> (DVec3, DVec3) {
        (0.5 * (self.low + self.high), 0.5 * (self.high - self.low))
    }

    fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Squared distance between two boxes; never above that of anything inside them.
    fn distance_squared(&self, other: &Self) -> f64 {
        (self.low - other.high).max(other.low - self.high).max(DVec3::ZERO).length_squared()
    }
}

enum Node {
    /// Two children: indices of nodes.
    Inner(Bounds, [u32; 2]),
    /// Items `order[start..end]`.
    Leaf(Bounds, [u32; 2]),
}

impl Node {
    fn bounds(&self) -> &Bounds {
        match self {
            Self::Inner(b, _) | Self::Leaf(b, _) => b,
        }
    }
}

/// Binary tree over items with boxes, split at the median of the longest side.
pub struct BoxTree {
    nodes: Vec<Node>,
    order: Vec<u32>,
    items: Vec<Bounds>,
}

impl BoxTree {
    /// Tree over `items`; there must be one.
    pub fn new(items: Vec<Bounds>) -> Self {
        let order = (0..items.len() as u32).collect();
        let mut tree = Self { nodes: Vec::new(), order, items };
        tree.build(0, tree.items.len());
        tree
    }

    /// Tree over points.
    pub fn of_points(points: &[DVec3]) -> Self {
        Self::new(points.iter().map(|p| Bounds::around([*p])).collect())
    }

    /// The items, those that are near each other close together.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    fn build(&mut self, start: usize, end: usize) -> u32 {
        let order = &mut self.order[start..end];
        let bounds =
            order.iter().map(|i| self.items[*i as usize]).reduce(Bounds::union).expect("a node has items");
        let node = self.nodes.len();
        self.nodes.push(Node::Leaf(bounds, [start as u32, end as u32]));
        if end - start > LEAF {
            let size = bounds.high - bounds.low;
            let axis = size.max_position();
            let middle = (end - start) / 2;
            let key = |i: &u32| self.items[*i as usize].low[axis] + self.items[*i as usize].high[axis];
            order.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)));
            let children = [self.build(start, start + middle), self.build(start + middle, end)];
            self.nodes[node] = Node::Inner(bounds, children);
        }
        node as u32
    }

    /// Smallest `distance_squared(item)` over all items, where that is the exact squared distance
    /// of the item to something inside `query`.
    pub fn nearest(&self, query: &Bounds, distance_squared: impl Fn(usize) -> f64) -> f64 {
        let mut best = f64::INFINITY;
        let mut stack = [(0u32, 0.0); 64];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let (node, bound) = stack[height];
            if bound >= best {
                continue;
            }
            match &self.nodes[node as usize] {
                Node::Leaf(_, [start, end]) => {
                    for i in &self.order[*start as usize..*end as usize] {
                        if self.items[*i as usize].distance_squared(query) < best {
                            best = best.min(distance_squared(*i as usize));
                        }
                    }
                }
                Node::Inner(_, children) => {
                    // One by one: a map over the pair would not be inlined.
                    let below = |c: u32| (c, self.nodes[c as usize].bounds().distance_squared(query));
                    let mut next = [below(children[0]), below(children[1])];
                    // The nearer child comes off the stack first.
                    if next[0].1 < next[1].1 {
                        next.swap(0, 1);
                    }
                    stack[height..height + 2].copy_from_slice(&next);
                    height += 2;
                }
            }
        }
        best
    }
}
