//! The reference: the effective BRDF with exact ray-cast visibility and exact BRDFs. Independent passes give its
//! standard error.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::paths::Paths;
use crate::base::Cancel;
use crate::brdf::Material;
use crate::effective::FacetSum;
use crate::geometry::{FacetSampler, Facets, PeriodicGrid, SampleShift, TileMesh, lifted_origins};
use crate::interreflection::{LobeSampler, WalkedTile};
use crate::metrics::Pair;

/// Work and accuracy of a reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceSettings {
    /// Facets per pass.
    pub facets: usize,
    /// Largest number of independent passes. At least four are computed.
    pub max_passes: usize,
    /// Relative L2 of the standard errors at which the passes end.
    pub target: f64,
    pub seed: u64,
}

impl Default for ReferenceSettings {
    fn default() -> Self {
        Self { facets: 8192, max_passes: 16, target: 2e-3, seed: 1 }
    }
}

/// Smallest number of passes. The spread of fewer passes is a poor estimate of the error of their mean.
const MIN_PASSES: usize = 4;

/// `f̄` of one pair with its standard error, per channel [1/sr].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Estimate {
    pub f_bar: Vec3,
    pub standard_error: Vec3,
}

/// Inputs of the reference. Each pass draws its own facets.
#[derive(Debug)]
pub struct Reference<'a> {
    pub(super) mesh: &'a TileMesh,
    pub(super) grid: PeriodicGrid,
    pub(super) material_of_slot: Vec<usize>,
    pub(super) materials: Vec<Material>,
    /// Number of reflections between facets. The paper's definition has none.
    pub(super) bounces: usize,
    /// Samplers of the materials' lobes, for bounces.
    samplers: Vec<LobeSampler>,
    cancel: Cancel,
}

/// Sums over the passes of one pair: `S = Σ ΔA V V f`, `a_v`, and their second moments.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moments {
    s: DVec3,
    a: f64,
    ss: DVec3,
    sa: DVec3,
    aa: f64,
}

impl Moments {
    /// Adds the sums of one pass.
    pub(super) fn add(&mut self, s: DVec3, a: f64) {
        self.s += s;
        self.a += a;
        self.ss += s * s;
        self.sa += s * a;
        self.aa += a * a;
    }

    fn estimate(&self, passes: usize) -> Estimate {
        if self.a <= 0.0 {
            return Estimate::default();
        }
        let n = passes as f64;
        let ratio = self.s / self.a;
        // Variance of the ratio estimate: that of S_p - ratio a_p, divided by n(n-1) and the squared mean of a.
        let residual = (self.ss - 2.0 * ratio * self.sa + ratio * ratio * self.aa).max(DVec3::ZERO);
        let error = (residual / (n * (n - 1.0).max(1.0))).map(f64::sqrt) / (self.a / n);
        Estimate { f_bar: ratio.as_vec3(), standard_error: error.as_vec3() }
    }
}

/// Number of shifts between the first passes of two successive seeds.
const PASSES_PER_SEED: u64 = 4096;

/// Runs passes until their standard error is below the target or `progress` returns false. `pass(number, shift, moments)`
/// adds the sums of one pass.
///
/// The passes shift one low-discrepancy sequence. Together they are more accurate than independent passes, so the
/// standard error is an upper estimate.
pub(super) fn in_passes(
    pairs: &[Pair],
    settings: &ReferenceSettings,
    mut progress: impl FnMut(usize, f64) -> bool,
    mut pass: impl FnMut(u64, SampleShift, &mut [Moments]),
) -> Vec<Estimate> {
    let mut moments = vec![Moments::default(); pairs.len()];
    let mut estimates = vec![Estimate::default(); pairs.len()];
    for passes in 1..=settings.max_passes.max(MIN_PASSES) {
        let number = passes as u64 - 1;
        let shift = SampleShift::from_seed(settings.seed.wrapping_mul(PASSES_PER_SEED).wrapping_add(number));
        pass(number, shift, &mut moments);
        let (mut error, mut norm) = (0.0, 0.0);
        for (estimate, moments) in estimates.iter_mut().zip(&moments) {
            *estimate = moments.estimate(passes);
            error += estimate.standard_error.as_dvec3().length_squared();
            norm += estimate.f_bar.as_dvec3().length_squared();
        }
        let relative = if error == 0.0 { 0.0 } else { (error / norm).sqrt() };
        if !progress(passes, relative) || (passes >= MIN_PASSES && relative < settings.target) {
            break;
        }
    }
    estimates
}

impl<'a> Reference<'a> {
    pub fn new(mesh: &'a TileMesh, material_of_slot: &[usize], materials: &[Material]) -> Self {
        let grid = PeriodicGrid::new(mesh);
        grid.prepare_rays();
        Self {
            mesh,
            grid,
            material_of_slot: material_of_slot.to_vec(),
            materials: materials.to_vec(),
            bounces: 0,
            samplers: Vec::new(),
            cancel: Cancel::default(),
        }
    }

    /// After `cancel` is set, estimates end early and must not be used.
    pub fn with_cancel(self, cancel: Cancel) -> Self {
        Self { cancel, ..self }
    }

    /// Adds light that is reflected between facets up to `bounces` times.
    pub fn with_bounces(self, bounces: usize) -> Self {
        let brdfs = self.materials.iter().filter(|_| bounces > 0).map(|material| &material.brdf);
        Self { bounces, samplers: brdfs.map(LobeSampler::new).collect(), ..self }
    }

    /// Estimates `f̄` at each pair. After each pass it calls `progress(passes, relative L2 of the standard errors)`,
    /// which returns whether to continue.
    pub fn estimate(
        &self,
        pairs: &[Pair],
        settings: &ReferenceSettings,
        progress: impl FnMut(usize, f64) -> bool,
    ) -> Vec<Estimate> {
        let sampler = FacetSampler::new(self.mesh);
        in_passes(pairs, settings, progress, |pass, shift, all_moments| {
            let mut facets = sampler.sample(self.mesh, settings.facets, shift);
            facets.sort_for_sums();
            let sum = FacetSum::new(&facets, &self.material_of_slot, &self.materials);
            let origins = lifted_origins(&facets, self.mesh.size);
            let paths = self.paths();
            all_moments.par_iter_mut().zip(pairs).enumerate().for_each_init(
                || (vec![0.0_f32; facets.len()], vec![0.0_f32; facets.len()]),
                |(v_i, v_o), (at, (moments, pair))| {
                    if self.cancel.is_set() {
                        return;
                    }
                    let (mut s, a) = self.one_pass(&facets, &sum, &origins, *pair, v_i, v_o);
                    if let Some(paths) = &paths {
                        let seed = settings.seed ^ pass << 40 ^ (at as u64) << 8;
                        s += paths.trace(&facets, &origins, v_o, *pair, seed);
                    }
                    moments.add(s, a);
                },
            );
        })
    }

    /// The tracer of light that facets send to each other, if it is followed.
    pub(super) fn paths(&self) -> Option<Paths<'_>> {
        let Self { mesh, grid, material_of_slot, materials, samplers, .. } = self;
        (self.bounces > 0)
            .then(|| Paths::new(WalkedTile { mesh, grid, material_of_slot, materials, samplers }, self.bounces))
    }

    /// Computes `(Σ ΔA V V f, a_v)` over one set of facets.
    fn one_pass(
        &self,
        facets: &Facets,
        sum: &FacetSum,
        origins: &[Vec3],
        pair: Pair,
        v_i: &mut [f32],
        v_o: &mut [f32],
    ) -> (DVec3, f64) {
        let Pair { i, o } = pair;
        if i.z <= 0.0 || o.z <= 0.0 {
            return (DVec3::ZERO, 0.0);
        }
        for s in 0..facets.len() {
            let normal = facets.normals[s];
            let is_visible =
                |to: Vec3| normal.dot(to) > 0.0 && !self.grid.is_blocked(origins[s], to, facets.triangles[s]);
            v_o[s] = f32::from(is_visible(o));
            v_i[s] = f32::from(v_o[s] > 0.0 && is_visible(i));
        }
        (sum.sum(i, o, v_i, v_o), sum.projected_area(v_o, o))
    }
}
