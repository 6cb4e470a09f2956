//! A captured sheet as a viewer sees it: paths through the virtual faces of Eq. 11, at one place of the sheet.

use std::f32::consts::PI;
use std::sync::Arc;

use glam::{DVec2, DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::walk::mixed;
use crate::effective::{PathEnd, PathKind, ViewLobe, ViewLobes, Viewer};
use crate::math::simd::ln_of_sum;
use crate::slab::capture::lobe::SlopeGrid;
use crate::slab::capture::svbtdf::Svbtdf;
use crate::slab::dual::blend;
use crate::slab::fresnel::{inside, outside, reflectance, refract};
use crate::slab::half_vectors::{jacobian_bottom, jacobian_top, of_bottom, of_top};
use crate::slab::ndf::normal;

/// Steps of an evenly spread sequence in three dimensions (Roberts 2018).
const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_3];
/// Density of slopes below which a node counts as empty.
const LEAST: f32 = 1e-30;

/// A sheet prepared for images. It has no reflection. Light that is reflected inside counts as even.
#[derive(Debug, Clone)]
pub(super) struct SheetView {
    sheet: Arc<Svbtdf>,
    /// Exponentials of the coefficients of each model.
    densities: Vec<Vec<f32>>,
    /// Mean and raw second moments (xx, xy, yy) of the slopes of each model.
    moments: Vec<[f32; 5]>,
    /// Light that each model transmits towards viewers at steps of the polar angle, as a part of that of a level sheet.
    kept: Vec<[f32; ANGLES]>,
}

/// Steps of the polar angle of the viewer, from 0 to 80°, and paths of each step.
const ANGLES: usize = 9;
const STEP_DEG: f32 = 10.0;
const KEPT_PATHS: usize = 128;

/// The sheet at one place: representatives with weights that sum to 1, and the interpolated parameters of Eq. 13.
#[derive(Debug, Clone)]
pub(super) struct SheetPoint<'a> {
    view: &'a SheetView,
    parts: Vec<(usize, f32)>,
    alpha: f32,
    scale: Vec3,
    diffuse: Vec3,
}

impl SheetView {
    pub fn new(sheet: Arc<Svbtdf>) -> Self {
        let densities: Vec<Vec<f32>> =
            sheet.models.iter().map(|model| model.ln_density.iter().map(|ln| ln.exp() as f32).collect()).collect();
        let moments = densities.iter().map(|density| raw_moments(&sheet.grid, density)).collect();
        let view = Self { sheet, densities, moments, kept: Vec::new() };
        let kept = (0..view.densities.len()).into_par_iter().map(|model| view.kept_by(model)).collect();
        Self { kept, ..view }
    }

    /// The light of a model by the angle of the viewer, from paths.
    fn kept_by(&self, model: usize) -> [f32; ANGLES] {
        let alpha = self.sheet.models[model].alpha as f32;
        let point = SheetPoint { view: self, parts: vec![(model, 1.0)], alpha, scale: Vec3::ONE, diffuse: Vec3::ZERO };
        std::array::from_fn(|step| {
            let (sin, cos) = (step as f32 * STEP_DEG).to_radians().sin_cos();
            let mut sum = 0.0;
            for along in [Vec2::X, Vec2::Y] {
                let viewer = Viewer { o: (sin * along).extend(cos), paths: KEPT_PATHS, seed: 0 };
                point.follow(&viewer, |end| sum += 0.5 * end.weight.x);
            }
            sum / self.level(Vec3::new(sin, 0.0, cos))
        })
    }

    /// The part of the light that a level sheet with the masking of this one transmits.
    fn level(&self, o: Vec3) -> f32 {
        let optics = &self.sheet.optics;
        let (up, down) = (o.as_dvec3(), inside(-o.as_dvec3(), optics.eta));
        ((1.0 - reflectance(up.z, optics.eta)).powi(2) * optics.masking(up, down)) as f32
    }

    /// The sheet at a place, 0 to 1 along both axes, interpolated between four pixels. The sheet repeats.
    pub fn at(&self, place: Vec2) -> SheetPoint<'_> {
        let [columns, rows] = self.sheet.size;
        let size = Vec2::new(columns as f32, rows as f32);
        let at = (place - place.floor()) * size - 0.5;
        let (base, t) = (at.floor(), at - at.floor());
        let wrapped = |k: f32, count: usize| (k as i64).rem_euclid(count as i64) as usize;
        let (x, y) = (wrapped(base.x, columns), wrapped(base.y, rows));
        let (right, below) = ((x + 1) % columns, (y + 1) % rows);
        let mut point = SheetPoint {
            view: self,
            parts: Vec::with_capacity(24),
            alpha: 0.0,
            scale: Vec3::ZERO,
            diffuse: Vec3::ZERO,
        };
        for (column, row, share) in [
            (x, y, (1.0 - t.x) * (1.0 - t.y)),
            (right, y, t.x * (1.0 - t.y)),
            (x, below, (1.0 - t.x) * t.y),
            (right, below, t.x * t.y),
        ] {
            point.add(row * columns + column, share);
        }
        point.alpha = point.alpha.clamp(0.0, 1.0);
        point
    }
}

/// Mean and raw second moments of the slopes of a density at the nodes of a grid.
fn raw_moments(grid: &SlopeGrid, density: &[f32]) -> [f32; 5] {
    let (mut mass, mut sums) = (0.0, [0.0; 5]);
    for (k, value) in density.iter().enumerate() {
        let (m, value) = (grid.node(k), f64::from(*value));
        mass += value;
        let terms = [m.x, m.y, m.x * m.x, m.x * m.y, m.y * m.y];
        sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += value * term);
    }
    sums.map(|sum| if mass > 0.0 { (sum / mass) as f32 } else { 0.0 })
}

impl SheetPoint<'_> {
    fn add(&mut self, pixel: usize, share: f32) {
        if share <= 0.0 {
            return;
        }
        let sheet = &self.view.sheet;
        let range = pixel * sheet.neighbours..(pixel + 1) * sheet.neighbours;
        for (model, weight) in sheet.index[range.clone()].iter().zip(&sheet.weight[range]) {
            let (model, weight) = (*model as usize, share * weight);
            self.alpha += weight * sheet.models[model].alpha as f32;
            match self.parts.iter_mut().find(|part| part.0 == model) {
                Some(part) => part.1 += weight,
                None => self.parts.push((model, weight)),
            }
        }
        self.scale += share * sheet.scale[pixel];
        self.diffuse += share * sheet.diffuse[pixel];
    }

    /// Roughness of the virtual face along both axes together, from moments of its slopes.
    fn roughness([x, y, xx, _, yy]: [f32; 5]) -> f64 {
        f64::from(xx + yy - x * x - y * y).max(0.0).sqrt()
    }

    /// The parts of even light towards a viewer: the diffuse part and the light that is reflected inside, from behind.
    fn even(&self, o: Vec3) -> [Vec3; 2] {
        let bounced = self.view.sheet.bounced.as_ref().map_or(0.0, |bounced| {
            bounced.light.total(Self::roughness(self.moments()), self.alpha.into(), o.as_dvec3()) as f32
        });
        [PI * self.diffuse + self.scale * bounced, Vec3::ZERO]
    }

    /// Mean and raw second moments of the slopes.
    fn moments(&self) -> [f32; 5] {
        let mut sums = [0.0; 5];
        for (model, weight) in &self.parts {
            sums.iter_mut().zip(self.view.moments[*model]).for_each(|(sum, value)| *sum += weight * value);
        }
        sums
    }

    /// The lobe to first order in the slopes: a facet of slope `m` deflects the tangential direction by
    /// `(√(η² - sin²θ) - cos θ) m`.
    pub fn lobes(&self, o: Vec3) -> ViewLobes {
        let optics = &self.view.sheet.optics;
        let [x, y, xx, xy, yy] = self.moments();
        let eta = optics.eta as f32;
        let turn = (eta * eta - 1.0 + o.z * o.z).max(0.0).sqrt() - o.z;
        let wide = turn * turn;
        let step = o.z.clamp(0.0, 1.0).acos().to_degrees() / STEP_DEG;
        let low = (step as usize).min(ANGLES - 2);
        let t = (step - low as f32).min(1.0);
        let kept = |kept: &[f32; ANGLES]| (1.0 - t) * kept[low] + t * kept[low + 1];
        let kept: f32 = self.parts.iter().map(|(model, weight)| weight * kept(&self.view.kept[*model])).sum();
        let transmitted = ViewLobe {
            part: self.scale * (self.view.level(o) * kept),
            mean: -o.truncate() - turn * Vec2::new(x, y),
            covariance: [wide * (xx - x * x).max(0.0), wide * (xy - x * y), wide * (yy - y * y).max(0.0)],
            tail: 0.0,
        };
        ViewLobes { transmitted, even: self.even(o), ..ViewLobes::default() }
    }

    /// Reports the ends of the paths of a viewer above. Slopes are drawn from the interpolated density, and refracted at the
    /// top or the bottom with the parts α and 1 - α.
    pub fn follow(&self, viewer: &Viewer, mut end: impl FnMut(PathEnd)) -> [Vec3; 2] {
        let o = viewer.o.as_dvec3();
        if o.z <= 0.0 || viewer.paths == 0 {
            return [Vec3::ZERO; 2];
        }
        if let Some(slopes) = Slopes::new(self) {
            let shift = [0, 1, 2].map(|axis| (mixed(viewer.seed, axis) >> 11) as f64 / (1u64 << 53) as f64);
            for path in 0..viewer.paths {
                let [u, v, side] = [0, 1, 2].map(|axis| (shift[axis] + (path + 1) as f64 * STEPS[axis]).fract());
                let slope = slopes.draw(u, v);
                let direction = self.refracted(o, slope, side < f64::from(self.alpha));
                let Some((direction, weight)) = direction.and_then(|d| Some((d, self.weight(&slopes, o, d)?))) else {
                    continue;
                };
                let weight = self.scale * (weight / viewer.paths as f64) as f32;
                end(PathEnd { kind: PathKind::Transmitted, direction: direction.as_vec3(), weight });
            }
        }
        self.even(viewer.o)
    }

    /// The direction of light from the viewer that meets a facet of the virtual slope at the top, or at the bottom.
    fn refracted(&self, o: DVec3, slope: DVec2, at_top: bool) -> Option<DVec3> {
        let eta = self.view.sheet.optics.eta;
        let direction = if at_top {
            outside(refract(-o, normal(slope), eta)?, eta)
        } else {
            // One ray has opposite slopes in the two configurations.
            refract(inside(-o, eta), normal(-slope), 1.0 / eta)
        };
        direction.filter(|d| d.z < 0.0)
    }

    /// The lobe times the cosine, over the density with which [`Self::follow`] draws the direction.
    fn weight(&self, slopes: &Slopes, o: DVec3, d: DVec3) -> Option<f64> {
        let optics = &self.view.sheet.optics;
        let terms = optics.terms(o, d)?;
        let (top, bottom) = (of_top(o, d, optics.eta)?, of_bottom(o, d, optics.eta)?);
        let alpha = f64::from(self.alpha);
        let drawn = alpha * slopes.drawn(terms.slope_top) * jacobian_top(o, d, &top) / top.h.z.powi(3)
            + (1.0 - alpha) * slopes.drawn(terms.slope_bottom) * jacobian_bottom(d, &bottom) / bottom.h.z.powi(3);
        let part = |ln_factor: f64, slope: DVec2| slopes.ln_density(slope).map_or(0.0, |ln| (ln_factor + ln).exp());
        let lobe = blend(part(terms.ln_top, terms.slope_top), part(terms.ln_bottom, terms.slope_bottom), alpha);
        let weight = lobe * d.z.abs() / drawn;
        (weight > 0.0 && weight.is_finite()).then_some(weight)
    }
}

/// The interpolated density of slopes at one place, and its distribution over cells.
struct Slopes {
    grid: SlopeGrid,
    /// Logarithms of the densities of the nodes, which are coefficients of a spline.
    ln: Vec<f32>,
    /// Cumulative sums over rows, and within each row, of the nodes that a spline surrounds.
    rows: Vec<f32>,
    columns: Vec<f32>,
    density: Vec<f32>,
}

impl Slopes {
    /// `None` without any density.
    fn new(point: &SheetPoint<'_>) -> Option<Self> {
        let grid = point.view.sheet.grid;
        let side = grid.side;
        let mut density = vec![0.0; side * side];
        let mut ln = vec![0.0; side * side];
        let parts: Vec<(&[f32], f32)> =
            point.parts.iter().map(|(model, weight)| (point.view.densities[*model].as_slice(), *weight)).collect();
        ln_of_sum(&parts, LEAST, &mut density, &mut ln);
        let (mut columns, mut rows) = (vec![0.0; side * side], vec![0.0; side]);
        let mut all = 0.0;
        for row in 1..side - 1 {
            let mut sum = 0.0;
            for column in 1..side - 1 {
                sum += density[row * side + column];
                columns[row * side + column] = sum;
            }
            columns[row * side + side - 1] = sum;
            all += sum;
            rows[row] = all;
        }
        rows[side - 1] = all;
        (all > 0.0 && all.is_finite()).then_some(Self { grid, ln, rows, columns, density })
    }

    /// The slope at a point of the unit square; points spread evenly give slopes spread as the densities of the cells.
    fn draw(&self, u: f64, v: f64) -> DVec2 {
        let side = self.grid.side;
        let (row, y) = pick(&self.rows, u as f32);
        let (column, x) = pick(&self.columns[row * side..(row + 1) * side], v as f32);
        self.grid.node(row * side + column) + (DVec2::new(x.into(), y.into()) - 0.5) * self.grid.cell()
    }

    /// Density with which [`Self::draw`] draws a slope.
    fn drawn(&self, m: DVec2) -> f64 {
        let side = self.grid.side;
        let at = (m + self.grid.span) / self.grid.cell();
        let last = (side - 1) as f64;
        // NaN fails this comparison.
        if !(at.min_element() >= 1.0 && at.max_element() < last) {
            return 0.0;
        }
        let all = f64::from(self.rows[side - 1]) * self.grid.cell() * self.grid.cell();
        f64::from(self.density[at.y as usize * side + at.x as usize]) / all
    }

    /// The logarithm of the density of a slope; `None` outside the grid.
    fn ln_density(&self, m: DVec2) -> Option<f64> {
        let stencil = self.grid.stencil(m)?;
        Some(
            stencil
                .nodes
                .iter()
                .zip(&stencil.weights)
                .map(|(k, weight)| weight * f64::from(self.ln[*k as usize]))
                .sum(),
        )
    }
}

/// Index of the entry of a cumulative list in which the part `u` of its sum lies, and the place inside it, 0 to 1.
fn pick(cumulative: &[f32], u: f32) -> (usize, f32) {
    let last = cumulative.len() - 1;
    let wanted = u * cumulative[last];
    let at = cumulative.partition_point(|sum| *sum <= wanted).min(last);
    let before = if at == 0 { 0.0 } else { cumulative[at - 1] };
    let width = cumulative[at] - before;
    (at, if width > 0.0 { ((wanted - before) / width).clamp(0.0, 0.999_999) } else { 0.5 })
}

#[cfg(test)]
#[path = "sheet_tests.rs"]
mod tests;
