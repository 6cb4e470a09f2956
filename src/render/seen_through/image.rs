//! Images of objects that a viewer sees through.

use std::time::Instant;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::{Backdrop, BackdropFootprint, BackdropKernel};
use crate::base::{Cancel, Result};
use crate::effective::{PathKind, Reflectance, Transmittance, VaryingSurface, ViewLobe, ViewPaths, Viewer};
use crate::render::image::render::{RenderTimes, check_size};
use crate::render::image::shading::gather_over;
use crate::render::image::shading_points::ShadingPoints;
use crate::render::{CameraView, DirectionalLight, ObjectMesh, Rendered};
use crate::scene;

/// Everything that an image depends on.
pub struct SeenThrough<'a, S: VaryingSurface> {
    pub mesh: &'a ObjectMesh,
    pub camera: &'a scene::Camera,
    pub backdrop: &'a Backdrop,
    pub surface: &'a S,
    /// Where positions lie on the surface.
    pub places: Places,
    /// The BRDF by which the surface reflects directional lights.
    pub reflectance: &'a dyn Reflectance,
    pub transmittance: &'a dyn Transmittance,
    /// Lights that are not part of the backdrop.
    pub lights: &'a [DirectionalLight],
    /// Width and height in pixels.
    pub size: [usize; 2],
    pub samples_per_side: usize,
    /// Paths per point; 0 for one filtered read per lobe.
    pub paths: usize,
    pub seed: u64,
    pub cancel: Cancel,
}

/// Places on a surface, by the x and y of positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Places {
    /// Position of the place (0, 0).
    pub origin: Vec2,
    /// Places per world unit.
    pub scale: Vec2,
}

/// Points per task.
const CHUNK: usize = 256;
/// Part of the light below which the tail of a lobe is not read.
const LEAST_TAIL: f32 = 0.02;
/// Deviation of an even distribution over an interval of width 1.
const BOX: f32 = 0.288_675_13;

/// Renders on the CPU. The same input gives the same bits with any number of threads.
///
/// # Errors
/// The camera cannot frame the object, the size is out of range, or [`crate::base::Error::Cancelled`].
pub fn render<S: VaryingSurface>(input: &SeenThrough<'_, S>) -> Result<Rendered> {
    check_size(input.size, input.samples_per_side)?;
    let view = CameraView::new(input.camera, input.mesh, input.size)?;
    let start = Instant::now();
    let points = ShadingPoints::new(input.mesh, &view, input.samples_per_side);
    let after_gbuffer = Instant::now();
    let mut radiance = vec![Vec3::ZERO; points.len()];
    radiance.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, radiance)| {
        if input.cancel.is_set() {
            return;
        }
        for (k, radiance) in radiance.iter_mut().enumerate() {
            *radiance = Point::new(input, &view, &points, chunk * CHUNK + k).radiance();
        }
    });
    input.cancel.check()?;
    let image = gather_over(&points, &radiance, view.size, |pixel| behind_pixel(input.backdrop, &view, pixel));
    let times = RenderTimes::without_shadows(start, after_gbuffer);
    Ok(Rendered { image, times, points: points.len() })
}

/// The backdrop in a pixel, as the camera sees it.
pub(super) fn behind_pixel(backdrop: &Backdrop, view: &CameraView, pixel: usize) -> Vec3 {
    let [width, height] = view.size;
    let at = Vec2::new((pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5);
    let ndc = (2.0 * at / Vec2::new(width as f32, height as f32) - 1.0) * view.tan_half_fov;
    let d = view.right * ndc.x - view.up * ndc.y - view.back;
    let scale = BOX * view.pixel_extent() / d.length();
    let footprint =
        BackdropFootprint { direction: [scale * view.right, scale * view.up], ..BackdropFootprint::default() };
    let d = d.normalize_or(-view.back);
    backdrop.read(view.eye, d, &backdrop.kernel(view.eye, d, &footprint))
}

/// A point of the surface with its viewer.
struct Point<'a, S: VaryingSurface> {
    input: &'a SeenThrough<'a, S>,
    surface: S::Point<'a>,
    view: &'a CameraView,
    number: usize,
    pixel: usize,
    position: Vec3,
    /// Tangent, bitangent and normal.
    axes: [Vec3; 3],
    /// Direction to the viewer in the tangent frame.
    o: Vec3,
    /// Deviations of the position within the pixel.
    spread: [Vec3; 2],
}

impl<'a, S: VaryingSurface> Point<'a, S> {
    fn new(input: &'a SeenThrough<'a, S>, view: &'a CameraView, points: &ShadingPoints, number: usize) -> Self {
        let (z, x) = (points.normals[number], points.tangents[number]);
        let position = points.positions[number];
        let to_eye = view.eye - position;
        let extent = BOX * view.pixel_extent() * to_eye.length();
        let axes = [x, z.cross(x), z];
        let o = Vec3::from_array(axes.map(|axis| axis.dot(to_eye))).try_normalize().unwrap_or(Vec3::Z);
        let pixel = points.pixels[number] as usize;
        let surface = input.surface.at((position.truncate() - input.places.origin) * input.places.scale);
        let spread = [extent * view.right, extent * view.up];
        Self { input, surface, view, number, pixel, position, axes, o, spread }
    }

    fn in_world(&self, d: Vec3) -> Vec3 {
        self.axes[0] * d.x + self.axes[1] * d.y + self.axes[2] * d.z
    }

    /// The radiance towards the viewer.
    fn radiance(&self) -> Vec3 {
        let Self { input, o, .. } = self;
        let backdrop = input.backdrop;
        let lobes = self.surface.lobes(*o);
        let is_draft = input.paths == 0;
        let straight = if is_draft { lobes.straight } else { self.surface.straight(*o) };
        let mut sum = Vec3::ZERO;
        if straight[0] != Vec3::ZERO {
            sum += straight[0] * behind_pixel(backdrop, self.view, self.pixel);
        }
        if straight[1] != Vec3::ZERO {
            let mirror = Vec3::new(-o.x, -o.y, o.z);
            sum += straight[1] * self.read(mirror, &self.kernel(mirror, [0.0; 3]));
        }
        let even = if is_draft {
            for (lobe, side) in [(&lobes.transmitted, -1.0), (&lobes.reflected, 1.0)] {
                if lobe.part == Vec3::ZERO {
                    continue;
                }
                let mean = direction(lobe, side);
                let mut value = self.read(mean, &self.kernel(mean, lobe.covariance));
                if lobe.tail * lobe.part.max_element() > LEAST_TAIL {
                    let wide = lobe.covariance.map(|value| value * ViewLobe::TAIL);
                    value += lobe.tail * (self.read(mean, &self.kernel(mean, wide)) - value);
                }
                sum += lobe.part * value;
            }
            lobes.even
        } else {
            let (light, even) = self.by_paths(&lobes.transmitted, &lobes.reflected);
            sum += light;
            even
        };
        for (even, side) in even.into_iter().zip([-1.0, 1.0]) {
            if even != Vec3::ZERO {
                sum += even * backdrop.even(self.axes[2] * side);
            }
        }
        sum + self.of_lights()
    }

    /// The mean over the paths, and the parts of even light.
    fn by_paths(&self, transmitted: &ViewLobe, reflected: &ViewLobe) -> (Vec3, [Vec3; 2]) {
        let paths = self.input.paths;
        // At most every second path follows reflected light.
        let bounce_paths = paths.div_ceil(2);
        let (below, above) = (direction(transmitted, -1.0), direction(reflected, 1.0));
        let wide = WIDE * WIDE * part_of(bounce_paths);
        let wide = [wide, 0.0, wide];
        let kernel = |d: Vec3, covariance: [f32; 3]| self.narrow_kernel(d, covariance);
        let through = PathKernels::new(transmitted, paths, true, |covariance| kernel(below, covariance));
        let back = PathKernels::new(reflected, bounce_paths, false, |covariance| kernel(above, covariance));
        let bounced = [kernel(below, wide), kernel(above, wide)];
        let seed = self.input.seed.wrapping_mul(1 << 32).wrapping_add(self.number as u64);
        let mut sum = Vec3::ZERO;
        let even = self.surface.follow(&Viewer { o: self.o, paths, seed }, |end| {
            let (direction, kernel) = match end.kind {
                PathKind::Transmitted => through.at(end.direction),
                PathKind::Reflected => back.at(end.direction),
                PathKind::Bounced => (end.direction, &bounced[usize::from(end.direction.z > 0.0)]),
            };
            sum += end.weight * self.read(direction, kernel);
        });
        (sum, even)
    }

    fn read(&self, d: Vec3, kernel: &BackdropKernel) -> Vec3 {
        self.input.backdrop.read(self.position, self.in_world(d), kernel)
    }

    fn kernel(&self, d: Vec3, covariance: [f32; 3]) -> BackdropKernel {
        self.input.backdrop.kernel(self.position, self.in_world(d), &self.footprint(d, covariance))
    }

    fn narrow_kernel(&self, d: Vec3, covariance: [f32; 3]) -> BackdropKernel {
        self.input.backdrop.narrow_kernel(self.position, self.in_world(d), &self.footprint(d, covariance))
    }

    /// The footprint of a lobe around `d` with this covariance of tangential components.
    fn footprint(&self, d: Vec3, [xx, xy, yy]: [f32; 3]) -> BackdropFootprint {
        let first = xx.max(0.0).sqrt();
        let across = if first > 0.0 { xy / first } else { 0.0 };
        let deviations = [Vec2::new(first, across), Vec2::new(0.0, (yy - across * across).max(0.0).sqrt())];
        // The vertical component keeps the length at 1.
        let z = d.z.abs().max(0.1).copysign(d.z);
        let turn = |at: Vec2| self.in_world(at.extend(-(d.x * at.x + d.y * at.y) / z));
        BackdropFootprint { position: self.spread, direction: deviations.map(turn) }
    }

    /// The light of directional lights on both sides.
    fn of_lights(&self) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for light in self.input.lights {
            let i = Vec3::from_array(self.axes.map(|axis| axis.dot(light.direction)));
            let mut value = [Vec3::ZERO];
            if i.z > 0.0 {
                self.input.reflectance.eval_lights(&[i], self.o, &mut value);
            } else {
                self.input.transmittance.eval_transmitted(&[i], self.o, &mut value);
            }
            sum += value[0] * light.irradiance;
        }
        sum
    }
}

/// Number of paths whose footprints together are as wide as the lobe.
const COVER: f32 = 8.0;

/// The part of a lobe's covariance that one of many paths stands for. It vanishes as paths are added.
fn part_of(paths: usize) -> f32 {
    (COVER / paths as f32).min(1.0)
}

/// Deviation of the directions of light that is reflected inside, for the footprint of its paths.
const WIDE: f32 = 0.5;
/// Squared distances from the mean of a lobe, in deviations, from which paths are sparser and their footprints wider.
const SPARSE: [f32; 3] = [2.0, 8.0, 32.0];

/// Footprints of the paths of a lobe, by the distance from its mean. Paths are drawn towards the mean, so that paths and
/// footprints together have the covariance of the lobe.
struct PathKernels {
    mean: Vec2,
    /// Inverse of the covariance: xx, xy and yy.
    inverse: [f32; 3],
    /// The symmetric matrix that draws paths towards the mean: xx, xy and yy.
    contraction: [f32; 3],
    kernels: [BackdropKernel; SPARSE.len() + 1],
}

impl PathKernels {
    fn new(lobe: &ViewLobe, paths: usize, below: bool, kernel: impl Fn([f32; 3]) -> BackdropKernel) -> Self {
        let [xx, xy, yy] = lobe.covariance;
        let determinant = xx * yy - xy * xy;
        let inverse = if determinant > 0.0 { [yy, -xy, xx].map(|value| value / determinant) } else { [0.0; 3] };
        let of_step = |step: usize| {
            // The density of GGX falls with the fourth power of the distance, so that spacings grow with its square.
            let scale = part_of(paths) * (1 << (2 * step)) as f32;
            kernel(lobe.covariance.map(|value| value * scale.min(ViewLobe::TAIL)))
        };
        let kernels: [BackdropKernel; SPARSE.len() + 1] = std::array::from_fn(of_step);
        let contraction = contraction(lobe.covariance, part_of(paths) * kernels[0].share(below));
        Self { mean: lobe.mean, inverse, contraction, kernels }
    }

    fn at(&self, direction: Vec3) -> (Vec3, &BackdropKernel) {
        let d = direction.truncate() - self.mean;
        let [xx, xy, yy] = self.inverse;
        let square = xx * d.x * d.x + 2.0 * xy * d.x * d.y + yy * d.y * d.y;
        let kernel = &self.kernels[SPARSE.iter().filter(|bound| square > **bound).count()];
        let [xx, xy, yy] = self.contraction;
        let at = self.mean + Vec2::new(xx * d.x + xy * d.y, xy * d.x + yy * d.y);
        (at.extend((1.0 - at.length_squared()).max(1e-6).sqrt().copysign(direction.z)), kernel)
    }
}

/// The matrix M that contracts directions of paths about the mean, with `M C Mᵀ = C - part λ I`, for the covariance C and
/// its smaller variance λ: the variance that round footprints of this size add.
fn contraction([xx, xy, yy]: [f32; 3], part: f32) -> [f32; 3] {
    let (middle, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
    let radius = (half * half + xy * xy).sqrt();
    let (major, minor) = (middle + radius, (middle - radius).max(0.0));
    if major.is_nan() || major <= 0.0 {
        return [1.0, 0.0, 1.0];
    }
    let (along, across) = ((1.0 - part * minor / major).max(0.0).sqrt(), (1.0 - part).max(0.0).sqrt());
    let (cosine, sine) = if radius > 0.0 { (half / radius, xy / radius) } else { (1.0, 0.0) };
    let (mean, difference) = (0.5 * (along + across), 0.5 * (along - across));
    [mean + difference * cosine, difference * sine, mean - difference * cosine]
}

/// The mean direction of a lobe below (-1) or above (1) the surface.
fn direction(lobe: &ViewLobe, side: f32) -> Vec3 {
    let at = lobe.mean.clamp_length_max(0.999);
    at.extend(side * (1.0 - at.length_squared()).sqrt())
}
