//! Examination of the cases with every evaluator. The tests share its rows.

use std::path::Path;
use std::sync::LazyLock;

use biscale::effective::{EffectiveBrdf, Reflectance};
use biscale::math::directions::from_angles;
use biscale::metrics::{Pair, compare, mirror_biased_pairs};
use biscale::pipeline::Pipeline;
use biscale::reference::{Reference, ReferenceSettings};
use biscale::scene;
use biscale::scene::{LoadedScene, Painted};
use glam::Vec3;
use rayon::prelude::*;

use crate::cases::{Case, brdfs, geometries};
use crate::evaluators;
use crate::evaluators::Evaluator;

/// Deviations of one evaluator on one case. A deviation is zero if the invariant holds exactly.
#[derive(Debug, Clone)]
pub struct Row {
    pub family: &'static str,
    pub case: &'static str,
    pub evaluator: &'static str,
    /// Values that are not finite, or negative.
    pub unsound: usize,
    /// Values above 0 with light or viewer at or below the horizon.
    pub below_horizon: usize,
    /// The largest `f̄ cos θ_o` within a hundredth of a degree of the horizon, over the largest elsewhere.
    pub grazing: f64,
    pub reciprocity: f64,
    /// Deviation of `a_v / (A cos θ)` from 1 and its bound; `None` for a tile with holes or with normals of its own.
    pub area: Option<[f64; 2]>,
    /// Largest directional albedo of the result and its bound; `None` if lobes are too narrow to integrate.
    pub albedo: Option<[f64; 2]>,
    /// Relative L2 against the direct sum; for the reference, its standard errors divided by its values.
    pub against_direct: f64,
}

pub fn open(case: &Case, method: &str, folder: &Path) -> LoadedScene {
    if let Some(mesh) = &case.mesh {
        std::fs::write(folder.join("tile.obj"), mesh).unwrap();
    }
    let text = format!(
        "[tile]\n{}\n[[material]]\nname = \"default\"\nbrdf = {}\n[quality]\npreset = \"draft\"\nbackend = \"cpu\"\nmethod = \
         \"{method}\"\n[effects]\ninterreflection = \"off\"\n",
        case.tile, case.brdf
    );
    let scene = scene::parse(&text).unwrap_or_else(|error| panic!("{}: {error}", case.name));
    LoadedScene { scene, base_dir: folder.to_owned(), name: case.name.to_owned(), painted: Painted::default() }
}

/// Returns directions at exactly 0 and 90°, between the last ring and the horizon, beside the pole, and on the seam.
pub fn hard_directions() -> Vec<Vec3> {
    let thetas = [0.0_f32, 1e-7, 1e-3, 0.7, 1.2, 89.9_f32.to_radians(), 89.999_9_f32.to_radians()];
    let phis = [0.0_f32, -0.0, 1e-7, -1e-7, 1.0, std::f32::consts::PI, -std::f32::consts::PI, std::f32::consts::TAU];
    let mut all: Vec<Vec3> = thetas.iter().flat_map(|&t| phis.iter().map(move |&p| from_angles(t, p))).collect();
    all.extend([Vec3::Z, Vec3::new(1.0, 0.0, 1e-12), Vec3::new(0.0, -1.0, f32::MIN_POSITIVE)]);
    all.dedup();
    all
}

/// Returns directions at and below the horizon.
fn below() -> [Vec3; 4] {
    [Vec3::X, Vec3::NEG_Y, Vec3::NEG_Z, from_angles(1.7, 0.4)]
}

pub fn pairs() -> Vec<Pair> {
    let mut pairs = mirror_biased_pairs(160, 5);
    // Pairs with i = o, and mirrored pairs.
    for k in 0..24 {
        let i = from_angles(k as f32 / 24.0 * 1.56, k as f32 * 0.9);
        pairs.extend([Pair { i, o: i }, Pair { i, o: Vec3::new(-i.x, -i.y, i.z) }]);
    }
    pairs
}

/// Cases of the ordinary tests; each takes seconds.
const QUICK: [&str; 7] = ["flat", "height 0", "one triangle", "overhang", "tile with holes", "tile of 1e-6", "black"];

pub static ROWS: LazyLock<Vec<Row>> = LazyLock::new(|| {
    let quick = |case: &Case| QUICK.contains(&case.name);
    let cases: Vec<Case> = [geometries(), brdfs()].concat().into_iter().filter(quick).collect();
    cases.par_iter().with_max_len(1).flat_map_iter(|case| examine(case, Some(60))).collect()
});

/// Returns the rows of all evaluators on a case. The paper's basis has `m_directions`, or its full number with `None`.
pub fn examine(case: &Case, m_directions: Option<usize>) -> Vec<Row> {
    let folder = tempfile::tempdir().unwrap();
    let start = std::time::Instant::now();
    let pairs = pairs();
    let evaluators = evaluators::all(case, folder.path(), m_directions);
    let built = start.elapsed().as_secs_f64();
    let direct: Vec<Vec3> = pairs.iter().map(|p| evaluators[0].brdf.eval(p.i, p.o)).collect();
    let mut rows: Vec<Row> = evaluators.iter().map(|evaluator| measured(case, evaluator, &pairs, &direct)).collect();
    let evaluated = start.elapsed().as_secs_f64();
    rows.push(reference(case, folder.path(), &pairs, &evaluators[0]));
    let all = start.elapsed().as_secs_f64();
    if all > 3.0 {
        eprintln!(
            "{}, {}: {all:.1} s, of which {built:.1} s to build and {:.1} s for the reference",
            case.family,
            case.name,
            all - evaluated
        );
    }
    rows
}

pub fn measured(case: &Case, evaluator: &Evaluator, pairs: &[Pair], direct: &[Vec3]) -> Row {
    let brdf: &EffectiveBrdf = &evaluator.brdf;
    let (mut unsound, mut below_horizon) = (0, 0);
    let is_sound = |v: Vec3| v.is_finite() && v.min_element() >= 0.0;
    let directions = hard_directions();
    // f̄ cos θ_o is G divided by a_v, and is bounded.
    let (mut near, mut elsewhere) = (0.0_f64, 0.0_f64);
    for &o in &directions {
        let mut values = vec![Vec3::ZERO; directions.len()];
        brdf.eval_lights(&directions, o, &mut values);
        for (&i, &value) in directions.iter().zip(&values) {
            unsound += usize::from(!is_sound(value)) + usize::from(!is_sound(brdf.g(i, o)));
            let bounded = f64::from(value.max_element() * o.z);
            if i.z.min(o.z) < 1.7e-4 { near = near.max(bounded) } else { elsewhere = elsewhere.max(bounded) }
        }
        unsound += usize::from(!(0.0..).contains(&brdf.relative_projected_area(o)));
        for below in below() {
            below_horizon +=
                usize::from(brdf.eval(below, o) != Vec3::ZERO) + usize::from(brdf.eval(o, below) != Vec3::ZERO);
        }
    }
    let values: Vec<Vec3> = pairs.iter().map(|p| brdf.eval(p.i, p.o)).collect();
    unsound += values.iter().filter(|value| !is_sound(**value)).count();
    let (mut difference, mut largest) = (0.0_f64, 0.0_f64);
    for p in pairs {
        let [there, back] = [brdf.g(p.i, p.o), brdf.g(p.o, p.i)];
        difference = difference.max(f64::from((there - back).abs().max_element()));
        largest = largest.max(f64::from(there.max_element()));
        elsewhere = elsewhere.max(f64::from((brdf.eval(p.i, p.o) * p.o.z).max_element()));
    }
    let health = &evaluator.health;
    let visible = health.surface.fewest_visible_facets.max(1) as f64;
    // The noise of the visible facets, and the error of maps and soft horizons.
    let area = health.result.projected_area_error.map(|error| [error, 0.05 + 3.0 / visible.sqrt()]);
    let error = compare(&values, direct).rel_l2;
    let error = if error.is_finite() { error } else { 0.0 };
    let materials = health.materials.iter().map(|m| f64::from(m.largest_albedo)).fold(1.0, f64::max);
    // With holes, G and the projected area are interpolated independently, and one can vanish without the other.
    let allowed = if health.surface.has_holes { 4.0 * error } else { error };
    let albedo = health.result.largest_albedo.map(|albedo| [f64::from(albedo), materials * 1.03 * (1.0 + allowed)]);
    Row {
        family: case.family,
        case: case.name,
        evaluator: evaluator.name,
        unsound: unsound + health.result.unsound_values,
        below_horizon,
        grazing: if near > 0.0 { near / elsewhere.max(1e-30) } else { 0.0 },
        reciprocity: if difference > 0.0 { difference / largest } else { 0.0 },
        area,
        albedo,
        against_direct: error,
    }
}

/// The reference evaluates every n-th pair.
const PAIR_STEP: usize = 12;

/// Returns the row of the reference. It has values and standard errors instead of G, so deviations are in units of its
/// error.
fn reference(case: &Case, folder: &Path, pairs: &[Pair], direct: &Evaluator) -> Row {
    let facets = 128;
    let settings = ReferenceSettings { facets, max_passes: 4, target: 0.0, seed: 3 };
    let mut all: Vec<Pair> = pairs.iter().step_by(PAIR_STEP).copied().collect();
    let ordinary = all.len();
    all.extend(all.clone().iter().map(|p| Pair { i: p.o, o: p.i }));
    let swapped = all.len();
    let hard = hard_directions();
    all.extend(hard.iter().zip(hard.iter().rev()).step_by(4).map(|(&i, &o)| Pair { i, o }));
    let above = all.len();
    all.extend(below().map(|i| Pair { i, o: Vec3::Z }));
    all.extend(below().map(|o| Pair { i: Vec3::Z, o }));
    let estimate = |reference: &Reference<'_>| reference.estimate(&all, &settings, |_, _| true);
    let found = Pipeline::new().with_reference(&open(case, "direct", folder), estimate).unwrap();
    let is_sound = |v: Vec3| v.is_finite() && v.min_element() >= 0.0;
    let unsound = found.iter().filter(|e| !is_sound(e.f_bar) || !is_sound(e.standard_error)).count();
    let below_horizon = found[above..].iter().filter(|e| e.f_bar != Vec3::ZERO).count();
    // If the tile has no holes, f̄ cos θ_o is reciprocal. The difference is in units of the standard error.
    let mut reciprocity = 0.0_f64;
    // If no facet of a pass is visible from some direction, the passes have no spread.
    let surface = &direct.health.surface;
    let has_spread = facets * surface.fewest_visible_facets >= surface.facets;
    if has_spread && direct.health.result.projected_area_error.is_some() {
        let scale = found[..ordinary].iter().map(|e| e.f_bar.max_element()).fold(0.0, f32::max);
        for k in 0..ordinary {
            let (there, back, p) = (found[k], found[ordinary + k], pairs[PAIR_STEP * k]);
            let difference = (there.f_bar * p.o.z - back.f_bar * p.i.z).abs().max_element();
            let error = (there.standard_error * p.o.z).hypot_sum(back.standard_error * p.i.z) + 0.02 * scale;
            reciprocity = reciprocity.max(f64::from(difference / error.max(1e-20)));
        }
    }
    let squares = |part: fn(&biscale::reference::Estimate) -> Vec3| -> f64 {
        found[..swapped].iter().map(|e| part(e).as_dvec3().length_squared()).sum()
    };
    let (errors, values) = (squares(|e| e.standard_error), squares(|e| e.f_bar));
    Row {
        family: case.family,
        case: case.name,
        evaluator: "reference",
        unsound,
        below_horizon,
        grazing: 0.0,
        reciprocity: reciprocity * 1e-8,
        area: None,
        albedo: None,
        against_direct: if values > 0.0 { (errors / values).sqrt() } else { 0.0 },
    }
}

trait HypotSum {
    fn hypot_sum(self, other: Self) -> f32;
}

impl HypotSum for Vec3 {
    /// Returns the root of the sum of squares of the largest channels.
    fn hypot_sum(self, other: Self) -> f32 {
        self.max_element().hypot(other.max_element())
    }
}
