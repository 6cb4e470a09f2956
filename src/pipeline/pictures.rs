//! What pictures read: a table of the effective BRDF, or a sum over fewer facets where normals are few, if it is close enough;
//! made when the first picture asks.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::Shape;
use crate::accuracy::{Errors, picture_pairs, upper_errors};
use crate::cancel::Cancel;
use crate::directions::UpperPairs;
use crate::error::Result;
use crate::filtering::{EffectiveBrdf, Form, Interpolation, PairTable};
use crate::geometry::mirror_planes;
use crate::plan::{PICTURE_CHECK_PAIRS, Settings};
use crate::scene::Switch;

/// Steps between the facets that pictures of few normals sum over, from coarse to fine: multiples at which the additive
/// recurrence that placed the facets stays spread out.
const THINNED: [usize; 4] = [27, 17, 10, 3];

/// A table this many times too far off is not helped by the next finer grid, which has half its step.
const HOPELESS: f64 = 2.5;

/// The effective BRDF as pictures read it.
#[derive(Debug, Clone)]
pub struct Pictured {
    /// A table, or the BRDF itself.
    pub brdf: Arc<EffectiveBrdf>,
    /// What the table's error against the BRDF stays below; absent where the BRDF itself is read and none was tried.
    pub errors: Option<Errors>,
    /// Milliseconds that this call spent on it.
    pub ms: f64,
}

/// A BRDF that pictures read before, over the same facets; and whether its lobes are the same too.
pub(super) type Earlier = (Arc<EffectiveBrdf>, bool);

/// Makes the table of one effective BRDF, once.
#[derive(Debug)]
pub(super) struct Pictures {
    exact: Arc<EffectiveBrdf>,
    grids: Vec<UpperPairs>,
    interpolation: Interpolation,
    /// The tile, whose mirror planes spare part of a table; absent where nothing shall be spared.
    mirrored: Option<Arc<Shape>>,
    tolerance: (f64, f64),
    seed: u64,
    earlier: Mutex<Option<Earlier>>,
    made: Mutex<Option<Pictured>>,
}

impl Pictures {
    /// `wanted`: whether the plan expects a table to pay.
    pub(super) fn new(
        exact: Arc<EffectiveBrdf>,
        shape: &Arc<Shape>,
        settings: &Settings,
        wanted: bool,
        earlier: Option<Earlier>,
    ) -> Self {
        Self {
            exact,
            mirrored: (settings.effects.mirror_symmetry != Switch::Off).then(|| shape.clone()),
            grids: if wanted { settings.picture_grids.clone() } else { Vec::new() },
            interpolation: settings.interpolation,
            tolerance: settings.picture_tolerance,
            seed: settings.seed,
            earlier: Mutex::new(earlier),
            made: Mutex::new(None),
        }
    }

    /// What the next edit may reuse.
    pub(super) fn latest(&self, same_lobes: bool) -> Option<Earlier> {
        if let Some(made) = &*lock(&self.made) {
            return Some((made.brdf.clone(), same_lobes));
        }
        lock(&self.earlier).as_ref().map(|(brdf, same)| (brdf.clone(), *same && same_lobes))
    }

    /// The table, if it was made and nobody is making it.
    pub(super) fn made(&self) -> Option<Arc<EffectiveBrdf>> {
        self.made.try_lock().ok()?.as_ref().map(|made| made.brdf.clone())
    }

    /// The table, made now if it was not yet.
    pub(super) fn get(&self, cancel: &Cancel) -> Result<Pictured> {
        let mut made = lock(&self.made);
        if let Some(made) = &*made {
            return Ok(Pictured { ms: 0.0, ..made.clone() });
        }
        let start = Instant::now();
        let (brdf, errors) = self.make(cancel)?;
        let pictured = Pictured { brdf, errors, ms: start.elapsed().as_secs_f64() * 1e3 };
        *made = Some(pictured.clone());
        Ok(pictured)
    }

    fn make(&self, cancel: &Cancel) -> Result<(Arc<EffectiveBrdf>, Option<Errors>)> {
        let mut least = None;
        if self.grids.is_empty() {
            return Ok((self.exact.clone(), least));
        }
        let pairs = picture_pairs(PICTURE_CHECK_PAIRS, self.seed ^ 0x7ab1e);
        let values =
            |brdf: &EffectiveBrdf| -> Vec<Vec3> { pairs.par_iter().map(|pair| brdf.eval(pair.i, pair.o)).collect() };
        let exact = values(&self.exact);
        let (mut reused, failed) = self.reused();
        if let Form::Direct(direct) = self.exact.direct_form() {
            for step in THINNED {
                let Some(thinned) = direct.thinned(step) else { break };
                let brdf = self.exact.with_direct_form(Form::Direct(thinned));
                let errors = upper_errors(&values(&brdf), &exact);
                if self.is_close(errors) {
                    return Ok((Arc::new(brdf), Some(errors)));
                }
            }
        }
        if failed {
            return Ok((self.exact.clone(), least));
        }
        let known = reused.as_ref().map(|table| table.grid);
        let first = self.grids.iter().position(|grid| Some(*grid) == known).unwrap_or(0);
        for grid in &self.grids[first..] {
            let table = match reused.take() {
                Some(table) => table,
                None => match self.tabulate(*grid, cancel)? {
                    Some(table) => table,
                    None => break,
                },
            };
            let brdf = self.exact.with_direct_form(Form::Table(table.read(self.interpolation)));
            let errors = upper_errors(&values(&brdf), &exact);
            if self.is_close(errors) {
                return Ok((Arc::new(brdf), Some(errors)));
            }
            least = Some(errors);
            if errors.rel_l2 > HOPELESS * self.tolerance.0 {
                break;
            }
        }
        Ok((self.exact.clone(), least))
    }

    fn is_close(&self, errors: Errors) -> bool {
        errors.rel_l2 <= self.tolerance.0 && errors.psnr_db >= self.tolerance.1
    }

    fn tabulate(&self, grid: UpperPairs, cancel: &Cancel) -> Result<Option<PairTable>> {
        let mirrors = self.mirrored.as_ref().map_or([false; 2], |shape| mirror_planes(&shape.mesh));
        match self.exact.direct_form() {
            Form::Direct(direct) => PairTable::build(direct, grid, mirrors, cancel),
            form => {
                let sums = |lights: &[Vec3], o: Vec3, out: &mut [DVec3]| form.sums(lights, o, |k, sum| out[k] = sum);
                PairTable::resample(sums, grid, mirrors, cancel).map(Some)
            }
        }
    }

    /// The earlier table, where it serves; and whether none was close enough to the same lobes before.
    fn reused(&self) -> (Option<PairTable>, bool) {
        let Some((earlier, same_lobes)) = lock(&self.earlier).take() else { return (None, false) };
        match (earlier.direct_form(), self.exact.direct_form()) {
            (Form::Table(table), Form::Direct(direct)) => (table.reused(&direct.sum, same_lobes), false),
            (Form::Table(_), _) => (None, false),
            _ => (None, same_lobes),
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
