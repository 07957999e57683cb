//! A mesh in motion.

use std::ops::Deref;

use super::Positions;
use crate::error::{Error, Result};

/// Positions `[m]` at every frame, shape [N, V]: at least one frame, all of as many vertices, all finite. This is
/// checked where a motion is made, and nowhere else.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion(Vec<Positions>);

impl Motion {
    /// A motion of these frames.
    ///
    /// # Errors
    /// [`Error::Input`] naming the frame that cannot be one.
    pub fn new(frames: Vec<Positions>) -> Result<Self> {
        let fail = |place: String, problem: String| {
            Err(Error::input(place, problem, "give as many finite positions [m] in every frame"))
        };
        let Some(first) = frames.first() else {
            return fail("motion".to_owned(), "it has no frames".to_owned());
        };
        for (n, positions) in frames.iter().enumerate() {
            let place = format!("motion, frame {n}");
            if positions.len() != first.len() {
                let problem = format!("it has {} vertices, frame 0 has {}", positions.len(), first.len());
                return fail(place, problem);
            }
            if let Some(v) = positions.iter().position(|p| !p.is_finite()) {
                return fail(place, format!("vertex {v} is not finite: {}", positions[v]));
            }
        }
        Ok(Self(frames))
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.0[0].len()
    }

    /// Refuses a mesh of another number of vertices; `place` is where the motion is from.
    ///
    /// # Errors
    /// [`Error::Input`].
    pub fn check_vertices(&self, expected: usize, place: &str) -> Result<()> {
        if self.vertex_count() == expected {
            return Ok(());
        }
        let problem = format!("has {} vertices, the mesh has {expected}", self.vertex_count());
        Err(Error::input(place, problem, "give the motion of this mesh"))
    }

    /// The frames in `range`, which is not empty and within the motion.
    pub fn frames(&self, range: std::ops::Range<usize>) -> Self {
        assert!(!range.is_empty());
        Self(self.0[range].to_vec())
    }

    /// The positions alone.
    pub fn into_frames(self) -> Vec<Positions> {
        self.0
    }
}

impl Deref for Motion {
    type Target = [Positions];

    fn deref(&self) -> &[Positions] {
        &self.0
    }
}

impl<'a> IntoIterator for &'a Motion {
    type Item = &'a Positions;
    type IntoIter = std::slice::Iter<'a, Positions>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn what_is_no_motion_is_refused_with_its_frame() {
        let frame = vec![DVec3::Z; 3];
        let motion = Motion::new(vec![frame.clone(); 2]).unwrap();
        assert_eq!((motion.len(), motion.vertex_count()), (2, 3));
        motion.check_vertices(3, "motion.npy").unwrap();
        assert!(
            motion.check_vertices(4, "motion.npy").unwrap_err().to_string().contains("motion.npy: has 3")
        );
        let mut broken = frame.clone();
        broken[2].y = f64::NAN;
        for (frames, fragment) in [
            (vec![], "no frames"),
            (vec![frame.clone(), frame[..2].to_vec()], "frame 1: it has 2 vertices, frame 0 has 3"),
            (vec![frame, broken], "frame 1: vertex 2 is not finite"),
        ] {
            assert!(Motion::new(frames).unwrap_err().to_string().contains(fragment), "{fragment}");
        }
    }
}
