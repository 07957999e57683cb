//! How often colours occur somewhere.

/// Colours are counted in cells this wide `[grey levels]`.
const CELL: usize = 8;
const CELLS: usize = 256 / CELL;

/// How often colours occur.
pub(super) struct Palette {
    cells: Vec<f32>,
}

impl Palette {
    pub fn new() -> Self {
        Self { cells: vec![0.0; CELLS * CELLS * CELLS] }
    }

    fn cell(colour: [f32; 3]) -> [usize; 3] {
        colour.map(|c| (c.clamp(0.0, 255.0) as usize) / CELL)
    }

    pub fn add(&mut self, colour: [f32; 3], weight: f32) {
        let [r, g, b] = Self::cell(colour);
        self.cells[(r * CELLS + g) * CELLS + b] += weight;
    }

    pub fn count(&self, colour: [f32; 3]) -> f32 {
        let [r, g, b] = Self::cell(colour);
        self.cells[(r * CELLS + g) * CELLS + b]
    }

    /// Each cell with those beside it.
    pub fn spread(mut self) -> Self {
        for step in [1, CELLS, CELLS * CELLS] {
            let before = self.cells.clone();
            for (i, cell) in self.cells.iter_mut().enumerate() {
                let k = i / step % CELLS;
                *cell += if k > 0 { before[i - step] } else { 0.0 };
                *cell += if k + 1 < CELLS { before[i + step] } else { 0.0 };
            }
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_colour_counts_for_those_a_cell_beside_it() {
        let mut palette = Palette::new();
        palette.add([100.0, 40.0, 250.0], 2.0);
        palette.add([108.0, 40.0, 250.0], 1.0);
        let palette = palette.spread();
        let counts = [[100.0, 47.0, 255.0], [92.0, 40.0, 250.0], [118.0, 33.0, 243.0], [100.0, 60.0, 250.0]];
        assert_eq!(counts.map(|c| palette.count(c)), [3.0, 2.0, 1.0, 0.0]);
    }
}
