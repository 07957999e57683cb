//! Terms of the objective of one frame, one in each file.
//!
//! A [`Term`] gives its value and, at a point, a gradient and a positive semi-definite second-order system.
//! `terms!` below holds the one list of them: the search sums over it ([`FrameTerms::list`]), and so does the test that
//! compares every term's gradient with finite differences, so that a new term cannot come without proof.

pub mod bend;
pub mod colour;
pub mod depth;
pub mod low_rank;
pub mod outline;
pub mod plane;
pub mod robust;
pub mod shading;
pub mod shear;
pub mod signed_bend;
pub mod still;
pub mod strain;

use std::borrow::Cow;

use glam::{DMat3, DVec3};

use bend::Bend;
use colour::Colour;
use depth::Depth;
use low_rank::LowRank;
use outline::Outline;
use plane::Planes;
use shading::Shading;
use shear::Shear;
use signed_bend::SignedBend;
use still::Still;
use strain::Strain;
use tessuto_core::math::block_matrix::BlockMatrix;
use tessuto_core::mesh::Positions;
use tessuto_sim::Cloth;

/// A function of the positions of a frame.
#[cfg(test)]
pub type Function<'a> = Box<dyn Fn(&[DVec3]) -> f64 + 'a>;

/// One term of the objective of one frame, a function of its positions x `[m]`, shape `[V]`.
pub trait Term: Sync {
    /// Its name in the history of losses.
    fn name(&self) -> &'static str;

    /// The term at `x`.
    fn value(&self, x: &[DVec3]) -> f64;

    /// Adds ∂/∂x of [`value`](Self::value) and a positive semi-definite stand-in for its second derivative to `system`;
    /// returns the value. What the derivatives hold fixed is `held`, which their proof alone needs.
    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64;

    /// The function that the gradient at `x` belongs to, where that is not [`value`](Self::value) because something
    /// that depends on the positions is held fixed.
    #[cfg(test)]
    fn held<'s>(&'s self, _x: &[DVec3]) -> Option<Function<'s>> {
        None
    }
}

/// Second-order model of one frame's objective: gradient, shape `[V]`, and matrix, shape [3V, 3V].
pub struct FrameSystem {
    /// ∂E/∂x.
    pub gradient: Positions,
    /// Positive semi-definite stand-in for ∂²E/∂x².
    pub matrix: BlockMatrix,
    /// What a term takes off the matrix again.
    pub low_rank: Option<LowRank>,
}

impl FrameSystem {
    /// All zeros.
    pub fn zeros(cloth: &Cloth) -> Self {
        Self {
            gradient: vec![DVec3::ZERO; cloth.vertex_count()],
            matrix: BlockMatrix::zeros(&cloth.pattern),
            low_rank: None,
        }
    }

    /// Product of the whole matrix with `p`.
    pub fn multiply(&self, cloth: &Cloth, p: &[DVec3]) -> Positions {
        let mut out = self.matrix.multiply(&cloth.pattern, p);
        if let Some(low) = &self.low_rank {
            low.add_product(p, &mut out);
        }
        out
    }
}

/// a bᵀ.
pub(super) fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// A term of every camera's image, one for each: they add up.
pub struct OfViews<'a, T> {
    /// The terms.
    pub of: Vec<T>,
    /// How far the vertices go until each camera takes its image `[m]`, shape `[V]`; held fixed.
    ways: Vec<Option<&'a [DVec3]>>,
}

impl<'a, T> OfViews<'a, T> {
    /// Of as many `terms` as `ways`.
    pub fn new(terms: impl Iterator<Item = T>, ways: impl Iterator<Item = Option<&'a [DVec3]>>) -> Self {
        Self { of: terms.collect(), ways: ways.collect() }
    }

    /// Every term, and where the mesh at `x` is when its image is taken.
    pub fn at<'x>(&'x self, x: &'x [DVec3]) -> impl Iterator<Item = (&'x T, Cow<'x, [DVec3]>)> {
        self.of.iter().zip(&self.ways).map(|(term, way)| {
            let then = way.map(|way| x.iter().zip(way).map(|(x, way)| *x + *way).collect());
            (term, then.map_or(Cow::Borrowed(x), Cow::Owned))
        })
    }
}

impl<T: Term> Term for OfViews<'_, T> {
    fn name(&self) -> &'static str {
        self.of[0].name()
    }

    fn value(&self, x: &[DVec3]) -> f64 {
        self.at(x).map(|(term, x)| term.value(&x)).sum()
    }

    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64 {
        self.at(x).map(|(term, x)| term.add_system(&x, system)).sum()
    }

    #[cfg(test)]
    fn held<'s>(&'s self, x: &[DVec3]) -> Option<Function<'s>> {
        let held: Option<Vec<Function>> = self.of.iter().map(|term| term.held(x)).collect();
        held.map(|held| Box::new(move |x: &[DVec3]| held.iter().map(|of| of(x)).sum()) as Function)
    }
}

/// One list makes the fields, the number and the order of the terms. A field holds what its term needs; who fills it
/// in is the level of the search ([`super::spacetime`]).
macro_rules! terms {
    (
        priors { $($(#[$prior_doc:meta])* $prior:ident: $Prior:ident,)* }
        views { $($(#[$view_doc:meta])* $view:ident: $View:ident,)* }
        frame { $($(#[$doc:meta])* $term:ident: $Term:ident,)* }
    ) => {
        /// The terms that do not depend on the frame.
        #[derive(Clone)]
        pub struct PriorTerms<'a> {
            $($(#[$prior_doc])* pub $prior: $Prior<'a>,)*
        }

        /// All terms of one frame at one resolution.
        pub struct FrameTerms<'a> {
            /// What the cloth is like.
            pub priors: &'a PriorTerms<'a>,
            $($(#[$view_doc])* pub $view: OfViews<'a, $View<'a>>,)*
            $($(#[$doc])* pub $term: $Term<'a>,)*
        }

        /// Number of terms.
        pub const TERMS: usize = [$(stringify!($prior),)* $(stringify!($view),)* $(stringify!($term),)*].len();

        impl FrameTerms<'_> {
            /// The terms, in the order in which they are summed.
            pub fn list(&self) -> [&dyn Term; TERMS] {
                [$(&self.priors.$prior,)* $(&self.$view,)* $(&self.$term,)*]
            }
        }
    };
}

terms! {
    priors {
        /// Lengths of edges.
        strain: Strain,
        /// Bending with its sign.
        signed_bend: SignedBend,
        /// Bending angles, without sign.
        bend: Bend,
        /// Shearing angles.
        shear: Shear,
    }
    views {
        /// Against the colours of other frames.
        colour: Colour,
        /// Against the outline of the mask.
        outline: Outline,
        /// Against the light.
        shading: Shading,
        /// Against measured depth.
        depth: Depth,
    }
    frame {
        /// Against where it is fixed.
        still: Still,
        /// Against what it lies on.
        planes: Planes,
    }
}

impl PriorTerms<'_> {
    /// Closer to least squares: spreads of strain and shear times the first of `spreads`, that of signed bending
    /// times the second, all tails times `tail`.
    pub fn loosen(&mut self, spreads: [f64; 2], tail: f64) {
        self.strain.sigma *= spreads[0];
        self.shear.sigma *= spreads[0];
        self.signed_bend.loosen(spreads[1]);
        for own in [&mut self.strain.tail, &mut self.signed_bend.tail, &mut self.shear.tail] {
            *own *= tail;
        }
    }
}

impl FrameTerms<'_> {
    /// Sum of the terms.
    pub fn value(&self, x: &[DVec3]) -> f64 {
        self.list().iter().map(|term| term.value(x)).sum()
    }

    /// Sum of the terms that compare with the images.
    pub fn of_pictures(&self, x: &[DVec3]) -> f64 {
        self.colour.value(x) + self.outline.value(x) + self.shading.value(x) + self.depth.value(x)
    }

    /// What of the terms that compare with the images every vertex bears, shape `[V]`.
    pub fn shares_of_pictures(&self, x: &[DVec3]) -> Vec<f64> {
        let mut shares = vec![0.0; x.len()];
        self.colour.at(x).for_each(|(term, x)| term.add_shares(&x, &mut shares));
        self.outline.at(x).for_each(|(term, x)| term.add_shares(&x, &mut shares));
        self.shading.at(x).for_each(|(term, x)| term.add_shares(&x, &mut shares));
        self.depth.at(x).for_each(|(term, x)| term.add_shares(&x, &mut shares));
        shares
    }

    /// The value of every term at `x`, and the system of their sum.
    pub fn linearise(&self, cloth: &Cloth, x: &[DVec3]) -> ([f64; TERMS], FrameSystem) {
        let mut system = FrameSystem::zeros(cloth);
        let values = self.list().map(|term| term.add_system(x, &mut system));
        (values, system)
    }
}
