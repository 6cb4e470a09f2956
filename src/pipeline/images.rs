//! What pictures read: a table of the effective BRDF, or a sum over fewer facets where normals are few, if it is close enough;
//! made when the first picture asks.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{TileShape, kept};
use crate::base::{Cancel, Result};
use crate::cache::Cache;
use crate::effective::{EffectiveBrdf, Interpolation, Nodes, Representation, ShadingTable};
use crate::geometry::mirror_planes;
use crate::math::directions::HemispherePairGrid;
use crate::metrics::{Errors, Pair, image_pairs, upper_errors};
use crate::plan::{IMAGE_CHECK_PAIRS, Settings};
use crate::scene::Switch;
use crate::visibility::Visibility;

/// Steps between the facets that pictures of few normals sum over, from coarse to fine: multiples at which the additive
/// recurrence that placed the facets stays spread out.
const THINNED: [usize; 4] = [27, 17, 10, 3];

/// A table this many times too far off is not helped by the next finer grid, which has half its step.
const HOPELESS: f64 = 2.5;

/// One facet in so many makes a table, those first that shine where a half vector points; less than a fifth where these are
/// many nevertheless.
const PARTS: [usize; 4] = [20, 10, 5, 2];
const MANY: usize = 1600;

/// The same for coarse tables, of so many nodes, which are made at once; from all facets where that is not close enough.
const COARSE_PART: usize = 4;
const COARSE: Range<usize> = 10_000..20_000;

/// By how much fewer facets may raise a table's error.
const NO_WORSE: f64 = 1.25;

/// Tables of more nodes are first made only where the check's pairs read them, some 10,000 nodes, and in whole if that is close
/// enough.
const TRIED_FROM: usize = 60_000;

/// The effective BRDF as pictures read it.
#[derive(Debug, Clone)]
pub struct ShadingBrdf {
    /// A table, or the BRDF itself.
    pub brdf: Arc<EffectiveBrdf>,
    /// What the table's error against the BRDF stays below; absent where the BRDF itself is read and none was tried.
    pub errors: Option<Errors>,
    /// Milliseconds that this call spent on it.
    pub ms: f64,
    /// Whether tables, tried or taken, were read from a cache instead of being made.
    pub was_kept: bool,
}

/// A BRDF that pictures read before, over the same facets; and whether its lobes are the same too.
pub(super) type Earlier = (Arc<EffectiveBrdf>, bool);

/// Makes the table of one effective BRDF, once.
#[derive(Debug)]
pub(super) struct Images {
    exact: Arc<EffectiveBrdf>,
    grids: Vec<HemispherePairGrid>,
    interpolation: Interpolation,
    /// The tile, whose mirror planes spare part of a table; absent where nothing shall be spared.
    mirrored: Option<Arc<TileShape>>,
    tolerance: (f64, f64),
    seed: u64,
    earlier: Mutex<Option<Earlier>>,
    cache: Cache,
    /// Tables that were made, and read.
    tables: [AtomicUsize; 2],
    made: Mutex<Option<ShadingBrdf>>,
}

impl Images {
    /// `wanted`: whether the plan expects a table to pay.
    pub(super) fn new(
        exact: Arc<EffectiveBrdf>,
        shape: &Arc<TileShape>,
        settings: &Settings,
        wanted: bool,
        earlier: Option<Earlier>,
        cache: &Cache,
    ) -> Self {
        Self {
            exact,
            mirrored: (settings.effects.mirror_symmetry != Switch::Off).then(|| shape.clone()),
            grids: if wanted { settings.image_grids.clone() } else { Vec::new() },
            interpolation: settings.interpolation,
            tolerance: settings.image_tolerance,
            seed: settings.seed,
            earlier: Mutex::new(earlier),
            cache: cache.clone(),
            tables: Default::default(),
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
    pub(super) fn get(&self, cancel: &Cancel) -> Result<ShadingBrdf> {
        let mut made = lock(&self.made);
        if let Some(made) = &*made {
            return Ok(ShadingBrdf { ms: 0.0, ..made.clone() });
        }
        let start = Instant::now();
        let (brdf, errors) = self.make(cancel)?;
        let [tables_made, read] = self.tables.each_ref().map(|count| count.load(Ordering::Relaxed));
        let was_kept = read > 0 && tables_made == 0;
        let shading_brdf = ShadingBrdf { brdf, errors, ms: start.elapsed().as_secs_f64() * 1e3, was_kept };
        *made = Some(shading_brdf.clone());
        Ok(shading_brdf)
    }

    fn make(&self, cancel: &Cancel) -> Result<(Arc<EffectiveBrdf>, Option<Errors>)> {
        let mut least = None;
        if self.grids.is_empty() {
            return Ok((self.exact.clone(), least));
        }
        let check = Check::new(&self.exact, self.seed);
        let (mut reused, failed) = self.reused();
        if let Representation::Direct(direct) = self.exact.direct_form() {
            for step in THINNED {
                let Some(strided_subset) = direct.strided_subset(step) else { break };
                let brdf = self.exact.with_direct_form(Representation::Direct(strided_subset));
                let errors = check.errors(&brdf);
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
            let made = match reused.take() {
                Some(table) => Attempt::Made(table),
                None => self.attempt(*grid, &check, cancel)?,
            };
            let errors = match made {
                Attempt::Made(table) => {
                    let brdf = self.holding(table);
                    let errors = check.errors(&brdf);
                    if self.is_close(errors) {
                        return Ok((Arc::new(brdf), Some(errors)));
                    }
                    errors
                }
                Attempt::TooFar(errors) => errors,
                Attempt::Never => break,
            };
            least = Some(errors);
            if errors.rel_l2 > HOPELESS * self.tolerance.0 {
                break;
            }
        }
        Ok((self.exact.clone(), least))
    }

    fn holding(&self, table: ShadingTable) -> EffectiveBrdf {
        self.exact.with_direct_form(Representation::Table(table.read(self.interpolation)))
    }

    /// A table on this grid, if a trial of some of its nodes is close enough; from fewer facets where that is no worse.
    fn attempt(&self, grid: HemispherePairGrid, check: &Check, cancel: &Cancel) -> Result<Attempt> {
        let mirrors = self.mirrored.as_ref().map_or([false; 2], |shape| mirror_planes(&shape.mesh));
        let summed = match self.exact.direct_form() {
            // Of maps no part can be picked.
            Representation::Direct(direct) if !matches!(*direct.visibility, Visibility::Maps(_)) => {
                direct.sum.facet_count()
            }
            _ => 0,
        };
        let mut nodes = Nodes { mirrors, ..Nodes::all(grid) };
        let count = grid.originals(mirrors);
        if count > TRIED_FROM {
            let tried = |facets: Option<usize>| -> Result<Option<Errors>> {
                let trial = self.tabulate(Nodes { facets, read_by: Some(&check.pairs), ..nodes }, cancel)?;
                Ok(trial.map(|trial| check.errors(&self.holding(trial))))
            };
            let Some(best) = tried(None)? else { return Ok(Attempt::Never) };
            if !self.is_close(best) {
                return Ok(Attempt::TooFar(best));
            }
            for part in PARTS.into_iter().filter(|part| summed > 0 && (*part <= 5 || summed >= MANY * part)) {
                let sampled = tried(Some(summed / part))?;
                if sampled.is_some_and(|errors| self.is_close(errors) && errors.rel_l2 < NO_WORSE * best.rel_l2) {
                    nodes.facets = Some(summed / part);
                    break;
                }
            }
        } else if summed > 0 && COARSE.contains(&count) {
            let part = Nodes { facets: Some(summed / COARSE_PART), ..nodes };
            let Some(table) = self.tabulate(part, cancel)? else { return Ok(Attempt::Never) };
            if self.is_close(check.errors(&self.holding(table.clone()))) {
                return Ok(Attempt::Made(table));
            }
        }
        Ok(self.tabulate(nodes, cancel)?.map_or(Attempt::Never, Attempt::Made))
    }

    fn is_close(&self, errors: Errors) -> bool {
        errors.rel_l2 <= self.tolerance.0 && errors.psnr_db >= self.tolerance.1
    }

    fn tabulate(&self, nodes: Nodes, cancel: &Cancel) -> Result<Option<ShadingTable>> {
        match self.exact.direct_form() {
            Representation::Direct(direct) => {
                let table = kept::table(&self.cache, direct, nodes, cancel)?;
                Ok(table.map(|(table, was_kept)| {
                    self.tables[usize::from(was_kept)].fetch_add(1, Ordering::Relaxed);
                    table
                }))
            }
            form => {
                let sums = |lights: &[Vec3], o: Vec3, out: &mut [DVec3]| form.sums(lights, o, |k, sum| out[k] = sum);
                ShadingTable::resample(sums, nodes, cancel).map(Some)
            }
        }
    }

    /// The earlier table, where it serves; and whether none was close enough to the same lobes before.
    fn reused(&self) -> (Option<ShadingTable>, bool) {
        let Some((earlier, same_lobes)) = lock(&self.earlier).take() else { return (None, false) };
        match (earlier.direct_form(), self.exact.direct_form()) {
            (Representation::Table(table), Representation::Direct(direct)) => {
                (table.reused(&direct.sum, same_lobes), false)
            }
            (Representation::Table(_), _) => (None, false),
            _ => (None, same_lobes),
        }
    }
}

/// What came of a grid.
enum Attempt {
    Made(ShadingTable),
    /// A table's error would be this.
    TooFar(Errors),
    /// No grid serves.
    Never,
}

/// Pairs as pictures ask for them, and the BRDF there.
struct Check {
    pairs: Vec<Pair>,
    exact: Vec<Vec3>,
}

impl Check {
    fn new(exact: &EffectiveBrdf, seed: u64) -> Self {
        let mut check = Self { pairs: image_pairs(IMAGE_CHECK_PAIRS, seed ^ 0x7ab1e), exact: Vec::new() };
        check.exact = check.values(exact);
        check
    }

    fn values(&self, brdf: &EffectiveBrdf) -> Vec<Vec3> {
        self.pairs.par_iter().map(|pair| brdf.eval(pair.i, pair.o)).collect()
    }

    fn errors(&self, brdf: &EffectiveBrdf) -> Errors {
        upper_errors(&self.values(brdf), &self.exact)
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
