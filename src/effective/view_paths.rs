//! Light that reaches a viewer from both sides of a surface, followed backwards from the viewer.

use glam::{Vec2, Vec3};

/// A bundle of directions away from the surface.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ViewLobe {
    /// Part of the light of this bundle that reaches the viewer.
    pub part: Vec3,
    /// Mean of the tangential components of the directions.
    pub mean: Vec2,
    /// Covariance of their core: xx, xy and yy.
    pub covariance: [f32; 3],
    /// Part of the bundle that forms its tail, whose covariance is [`ViewLobe::TAIL`] times that of the core.
    pub tail: f32,
}

impl ViewLobe {
    /// Covariance of the tail over that of the core.
    pub const TAIL: f32 = 8.0;
}

/// The light that reaches a viewer, in a few numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ViewLobes {
    /// Light from behind that is refracted once at each face.
    pub transmitted: ViewLobe,
    /// Light from the viewer's side.
    pub reflected: ViewLobe,
    /// Parts of the mean radiance behind, and on the viewer's side, that arrive spread over all directions.
    pub even: [Vec3; 2],
    /// Parts that arrive straight from behind, and mirrored by level facets.
    pub straight: [Vec3; 2],
}

/// Kinds of light that a path leads to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PathKind {
    /// Light from behind, refracted once at each face.
    Transmitted,
    /// Light that the first face reflects.
    Reflected,
    /// Light that is reflected inside.
    Bounced,
}

/// The end of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathEnd {
    pub kind: PathKind,
    /// Unit direction away from the surface, in the tangent frame.
    pub direction: Vec3,
    /// Factor on the radiance that arrives against the direction.
    pub weight: Vec3,
}

/// A viewer, and the random numbers of its paths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Viewer {
    /// Unit direction to the viewer in the tangent frame; z is above 0.
    pub o: Vec3,
    /// Number of paths that are averaged.
    pub paths: usize,
    pub seed: u64,
}

/// A surface through which a viewer sees.
pub trait ViewPaths: Sync {
    /// Reports the ends of all paths of a viewer. Their sum is the light that is neither straight nor mirrored nor even.
    /// Returns the parts of [`ViewLobes::even`].
    fn follow(&self, viewer: &Viewer, end: impl FnMut(PathEnd)) -> [Vec3; 2];

    /// The lobes of a viewer, from a table.
    fn lobes(&self, o: Vec3) -> ViewLobes;

    /// The parts of [`ViewLobes::straight`], exactly.
    fn straight(&self, o: Vec3) -> [Vec3; 2];
}

/// A surface through which a viewer sees, and which may differ from place to place.
pub trait VaryingSurface: Sync {
    type Point<'a>: ViewPaths
    where
        Self: 'a;

    /// The surface at a place, 0 to 1 along x and y. It repeats outside.
    fn at(&self, place: Vec2) -> Self::Point<'_>;
}
