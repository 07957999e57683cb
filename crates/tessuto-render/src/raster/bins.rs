//! Triangles sorted into fixed bands of rows, the units of parallel work.

use super::projected::Projected;
use tessuto_core::camera::Rect;

/// Rows per band. A band is always handled by one thread from its first row to its last, and results
/// of bands are summed in their order, so that the number of threads changes nothing. 16 rows keep the
/// band of a 1000-pixel-wide image in a core's second-level cache.
pub(super) const BAND_ROWS: usize = 16;

/// For each band, the triangles whose bounding box touches it, ascending.
#[derive(Debug, Clone, Default)]
pub(super) struct Bins {
    /// Band b has `triangles[starts[b]..starts[b + 1]]`.
    starts: Vec<u32>,
    triangles: Vec<u32>,
    /// Bounding box of all triangles, `None` if no triangle is in the image.
    pub bounds: Option<Rect>,
}

impl Bins {
    /// Sorts the triangles of an image of `height` rows, into the existing memory.
    pub fn update(&mut self, projected: &[Projected], height: usize) {
        self.starts.clear();
        self.starts.resize(height.div_ceil(BAND_ROWS) + 1, 0);
        self.bounds = None;
        for p in projected.iter().filter(|p| !is_empty(p)) {
            self.bounds = Some(self.bounds.map_or(rect(p), |b| b.union(rect(p))));
            for band in bands(p) {
                self.starts[band + 1] += 1;
            }
        }
        for band in 1..self.starts.len() {
            self.starts[band] += self.starts[band - 1];
        }
        self.triangles.clear();
        self.triangles.resize(*self.starts.last().expect("there is always a first start") as usize, 0);
        // Use each band's start as its write position, then move the positions back by one band.
        for (t, p) in projected.iter().enumerate().filter(|(_, p)| !is_empty(p)) {
            for band in bands(p) {
                self.triangles[self.starts[band] as usize] = t as u32;
                self.starts[band] += 1;
            }
        }
        self.starts.rotate_right(1);
        self.starts[0] = 0;
    }

    /// Triangles of band `band`.
    pub fn band(&self, band: usize) -> &[u32] {
        &self.triangles[self.starts[band] as usize..self.starts[band + 1] as usize]
    }
}

fn is_empty(p: &Projected) -> bool {
    p.rows[0] >= p.rows[1] || p.columns[0] >= p.columns[1]
}

fn rect(p: &Projected) -> Rect {
    let ([x0, x1], [y0, y1]) = (p.columns.map(|c| c as usize), p.rows.map(|r| r as usize));
    Rect { x0, y0, x1, y1 }
}

fn bands(p: &Projected) -> std::ops::RangeInclusive<usize> {
    p.rows[0] as usize / BAND_ROWS..=(p.rows[1] as usize - 1) / BAND_ROWS
}
