//! A slab whose transmitted light is that of its BTDF, so that images show a model and not paths through both faces.

use std::f32::consts::PI;
use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::walk::mixed;
use super::{SlabPoint, SlabView};
use crate::effective::{PathEnd, PathKind, VaryingSurface, ViewLobe, ViewLobes, ViewPaths, Viewer};
use crate::slab::Slab;

/// Parts of the directions that are drawn from the core of the lobe, and from its tail; the rest is even over the disc.
const PARTS: [f32; 2] = [0.6, 0.25];
/// Factor of the covariances from which directions are drawn: a density wider than the lobe bounds the weights.
const WIDER: f32 = 1.5;
/// Smallest variance of the drawn directions.
const LEAST_VARIANCE: f32 = 1e-6;
/// Steps of an evenly spread sequence in three dimensions (Roberts 2018).
const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_3];

/// A slab as a viewer sees it by its BTDF. Reflected light is that of paths.
#[derive(Debug, Clone)]
pub struct BtdfView {
    slab: Arc<Slab>,
    /// The same faces, whose lobes say where light comes from.
    view: Arc<SlabView>,
}

impl BtdfView {
    pub fn new(slab: Arc<Slab>, view: Arc<SlabView>) -> Self {
        Self { slab, view }
    }
}

/// A [`BtdfView`] at one place.
#[derive(Debug, Clone)]
pub struct BtdfPoint<'a> {
    slab: &'a Slab,
    point: SlabPoint<'a>,
}

impl VaryingSurface for BtdfView {
    type Point<'a> = BtdfPoint<'a>;

    fn at(&self, place: Vec2) -> BtdfPoint<'_> {
        BtdfPoint { slab: &self.slab, point: self.view.at(place) }
    }
}

impl ViewPaths for BtdfPoint<'_> {
    fn follow(&self, viewer: &Viewer, mut end: impl FnMut(PathEnd)) -> [Vec3; 2] {
        // The BTDF holds all light from below.
        let [_, even] = self.point.follow(viewer, |path| {
            if path.direction.z > 0.0 {
                end(path);
            }
        });
        let row = self.slab.row(viewer.o.as_dvec3());
        let draws = Draws::new(&self.point.lobes(viewer.o).transmitted);
        let shift = [0, 1, 2].map(|axis| (mixed(viewer.seed, axis) >> 11) as f64 / (1u64 << 53) as f64);
        for path in 0..viewer.paths {
            let [u, v, w] = [0, 1, 2].map(|axis| (shift[axis] + (path + 1) as f64 * STEPS[axis]).fract() as f32);
            let at = draws.draw(u, v, w);
            let square = at.length_squared();
            if square >= 1.0 {
                continue;
            }
            let direction = at.extend(-(1.0 - square).sqrt());
            // Radiance is the integral of the BTDF over the disc of directions.
            let value = row.btdf(direction.as_dvec3()).as_vec3();
            let weight = value / (draws.density(at) * viewer.paths as f32);
            if weight != Vec3::ZERO && weight.is_finite() {
                end(PathEnd { kind: PathKind::Transmitted, direction, weight });
            }
        }
        [Vec3::ZERO, even]
    }

    fn lobes(&self, o: Vec3) -> ViewLobes {
        self.point.lobes(o)
    }

    fn straight(&self, o: Vec3) -> [Vec3; 2] {
        self.point.straight(o)
    }
}

/// A density over the disc of directions: two Gaussians around the mean of a lobe, and an even part.
struct Draws {
    mean: Vec2,
    /// Columns of a root of the covariance of the core.
    root: [Vec2; 2],
}

impl Draws {
    fn new(lobe: &ViewLobe) -> Self {
        let [xx, xy, yy] = lobe.covariance.map(|value| value * WIDER);
        let first = xx.max(LEAST_VARIANCE).sqrt();
        let across = xy / first;
        let second = (yy - across * across).max(LEAST_VARIANCE).sqrt();
        Self { mean: lobe.mean, root: [Vec2::new(first, across), Vec2::new(0.0, second)] }
    }

    fn draw(&self, u: f32, v: f32, w: f32) -> Vec2 {
        let angle = Vec2::from_angle(2.0 * PI * v);
        if w >= PARTS[0] + PARTS[1] {
            return u.sqrt() * angle;
        }
        let scale = if w < PARTS[0] { 1.0 } else { ViewLobe::TAIL.sqrt() };
        let normal = angle * (scale * (-2.0 * (1.0 - u).max(f32::MIN_POSITIVE).ln()).sqrt());
        self.mean + self.root[0] * normal.x + self.root[1] * normal.y
    }

    fn density(&self, at: Vec2) -> f32 {
        let [first, second] = self.root;
        let d = at - self.mean;
        let x = d.x / first.x;
        let y = (d.y - x * first.y) / second.y;
        let (square, area) = (x * x + y * y, 2.0 * PI * first.x * second.y);
        let normal = |variance: f32| (-0.5 * square / variance).exp() / (area * variance);
        PARTS[0] * normal(1.0) + PARTS[1] * normal(ViewLobe::TAIL) + (1.0 - PARTS[0] - PARTS[1]) / PI
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::slab::{Ndf, Optics, Profile};

    #[test]
    fn the_light_of_a_viewer_is_the_integral_of_the_btdf_by_either_method() {
        let face = |roughness: f64| Arc::new(Ndf::analytic(Profile::Beckmann, glam::DVec2::splat(roughness), 0.0));
        let optics = Optics { eta: DVec3::splat(1.5), ..Optics::default() };
        let dual = Slab::new(face(0.2), face(0.1), optics, 128);
        for slab in [dual.clone(), dual.by_faces(64)] {
            let slab = Arc::new(slab);
            let view = BtdfView::new(slab.clone(), Arc::new(SlabView::new(slab.clone())));
            for degrees in [0.0, 50.0_f32] {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let o = Vec3::new(sin, 0.0, cos);
                let side = 300;
                let mut expected = 0.0;
                let row = slab.row(o.as_dvec3());
                for k in 0..side * side {
                    let p = (Vec2::new((k % side) as f32, (k / side) as f32) + 0.5) * (2.0 / side as f32) - 1.0;
                    if p.length_squared() < 1.0 {
                        let d = p.extend(-(1.0 - p.length_squared()).sqrt());
                        expected += row.btdf(d.as_dvec3()).x as f32 * (1.0 + d.x) * (2.0 / side as f32).powi(2);
                    }
                }
                let mut found = 0.0;
                view.at(Vec2::ZERO).follow(&Viewer { o, paths: 8192, seed: 3 }, |path| {
                    if path.direction.z < 0.0 {
                        found += path.weight.x * (1.0 + path.direction.x);
                    }
                });
                assert!((found / expected - 1.0).abs() < 0.01, "{:?} {degrees}: {found} {expected}", slab.method);
            }
        }
    }
}
