//! The representation that images read: a sum over a strided subset of the facets, a table, or f̄ itself. The first
//! that is close enough is taken, when the first image asks.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use glam::{DVec3, Vec3};

use super::Env;
use super::shading_check::{Check, CheckedErrors};
use super::stage::{Codec, Keyed, Stage, StageTimes, elapsed_ms, key_of, lock, run_without_memo};
use super::stages::TileShape;
use crate::base::{Cancel, Error, Result};
use crate::cache::{Cache, Key, KeyBuilder};
use crate::effective::{Direct, EffectiveBrdf, Interpolation, Nodes, Representation, ShadingTable, TableContent};
use crate::geometry::mirror_planes;
use crate::math::directions::HemispherePairGrid;
use crate::metrics::Errors;
use crate::plan::{IMAGE_CHECK_PAIRS, Settings};
use crate::scene::Switch;
use crate::visibility::Visibility;

/// Strides through the facets of tiles with few distinct normals, from coarse to fine. At these multiples the additive
/// recurrence that placed the facets stays well spread.
const STRIDES: [usize; 4] = [27, 17, 10, 3];

/// The largest ratio of error and tolerance at which a finer grid may still help.
const MAX_ERROR_RATIO: f64 = 2.5;

/// Numbers of facets to try for a table, each at most half of all: they are drawn for each half vector by their lobes. How many
/// are enough depends little on how many there are.
const SUBSETS: [usize; 3] = [1200, 3000, 8000];

/// Tables with a node count in `COARSE_TABLE_NODES` are computed first from a quarter of the facets, without a trial. If the error is
/// too large, they are computed again from all facets.
const COARSE_SUBSET_DIVISOR: usize = 4;
const COARSE_TABLE_NODES: Range<usize> = 10_000..20_000;

/// Factor by which a check that does not decide gets more pairs.
const MORE_PAIRS: usize = 4;

/// Tables of more nodes are first computed only where the pairs of the check read them, at about 10,000 nodes; more if the
/// check needs more pairs.
const MIN_TRIAL_NODES: usize = 20_000;

/// The effective BRDF as images read it.
#[derive(Debug, Clone)]
pub struct ShadingBrdf {
    /// A table, a sum over fewer facets, or the BRDF itself.
    pub brdf: Arc<EffectiveBrdf>,
    /// An upper bound of the errors against the BRDF; absent if the BRDF itself is read and nothing else was tried.
    pub errors: Option<Errors>,
    /// Milliseconds that this call took.
    pub ms: f64,
    /// True if every table that this call needed was read from the disk cache.
    pub was_cached: bool,
}

/// The numbers of the tables that were computed last, by their keys, which colours do not enter. An edit of colours finds
/// every table that it tries here.
#[derive(Debug, Default)]
pub(super) struct RecentTables(Mutex<VecDeque<(Key, TableContent)>>);

impl RecentTables {
    /// The largest sum of the sizes of older tables in bytes.
    const MAX_BYTES: usize = 128 << 20;

    fn get(&self, key: Key) -> Option<TableContent> {
        let mut tables = lock(&self.0);
        let found = tables.iter().position(|(known, _)| *known == key)?;
        let entry = tables.remove(found)?;
        tables.push_front(entry);
        tables.front().map(|(_, content)| content.clone())
    }

    fn put(&self, key: Key, content: &TableContent) {
        let mut tables = lock(&self.0);
        tables.push_front((key, content.clone()));
        let mut bytes = 0;
        let kept = tables.iter().skip(1).take_while(|(_, content)| {
            bytes += content.bytes();
            bytes <= Self::MAX_BYTES
        });
        let kept = 1 + kept.count();
        let dropped = tables.split_off(kept);
        drop(tables);
        drop(dropped);
    }
}

/// Keys of the inputs of an effective BRDF.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShadingKeys {
    /// Settings, facets and visibility.
    pub surface: Key,
    /// The lobes of all materials and their slots, without colours and tints.
    pub lobes: Key,
    pub facets: Key,
    pub visibility: Key,
}

/// Computes the shading representation of one effective BRDF, once.
#[derive(Debug)]
pub(super) struct Shading {
    exact: Arc<EffectiveBrdf>,
    keys: ShadingKeys,
    /// Grids of the table, from coarse to fine; none if the plan expects no table to pay.
    grids: Vec<HemispherePairGrid>,
    interpolation: Interpolation,
    /// The tile, whose mirror planes save part of a table; absent if they are not to be used.
    mirrored: Option<Arc<TileShape>>,
    tolerance: (f64, f64),
    seed: u64,
    recent: Arc<RecentTables>,
    disk: Cache,
    computed: Mutex<Option<ShadingBrdf>>,
}

impl Shading {
    pub(super) fn new(
        exact: Arc<EffectiveBrdf>,
        tile: &Keyed<TileShape>,
        settings: &Settings,
        wants_table: bool,
        keys: ShadingKeys,
        (recent, disk): (&Arc<RecentTables>, &Cache),
    ) -> Self {
        Self {
            exact,
            keys,
            mirrored: (settings.effects.mirror_symmetry != Switch::Off).then(|| tile.value.clone()),
            grids: if wants_table { settings.image_grids.clone() } else { Vec::new() },
            interpolation: settings.interpolation,
            tolerance: settings.image_tolerance,
            seed: settings.seed,
            recent: recent.clone(),
            disk: disk.clone(),
            computed: Mutex::new(None),
        }
    }

    /// The representation, if it was computed and no other thread computes it.
    pub(super) fn known(&self) -> Option<Arc<EffectiveBrdf>> {
        self.computed.try_lock().ok()?.as_ref().map(|shading| shading.brdf.clone())
    }

    /// The representation; the first call computes it.
    pub(super) fn get(&self, cancel: &Cancel) -> Result<ShadingBrdf> {
        let mut computed = lock(&self.computed);
        if let Some(known) = &*computed {
            return Ok(ShadingBrdf { ms: 0.0, ..known.clone() });
        }
        let start = Instant::now();
        let mut times = StageTimes::new();
        let (brdf, errors) = self.first_close_enough(cancel, &mut times)?;
        let was_cached = !times.is_empty() && times.iter().all(|(name, _)| *name == Tabulate::CACHED);
        let shading = ShadingBrdf { brdf, errors, ms: elapsed_ms(start), was_cached };
        *computed = Some(shading.clone());
        Ok(shading)
    }

    /// Walks the strategies from the cheapest: a strided subset of the facets, a table, f̄ itself.
    fn first_close_enough(
        &self,
        cancel: &Cancel,
        times: &mut StageTimes,
    ) -> Result<(Arc<EffectiveBrdf>, Option<Errors>)> {
        if self.grids.is_empty() {
            return Ok((self.exact.clone(), None));
        }
        let mut check = Check::new(&self.exact, self.seed);
        if let Some((brdf, errors)) = self.strided_subset(&check) {
            return Ok((Arc::new(brdf), Some(errors)));
        }
        Ok(match self.table(&mut check, cancel, times)? {
            (Some(table), errors) => {
                let (brdf, errors) = self.with_bounced_columns(table, errors, &mut check, cancel)?;
                (Arc::new(brdf), errors)
            }
            (None, errors) => (self.exact.clone(), errors),
        })
    }

    /// Adds the light that facets send to each other to a table, so that images read one table and a GPU can read it.
    /// The table stays as it is if its error with this light exceeds the bound.
    fn with_bounced_columns(
        &self,
        found: EffectiveBrdf,
        errors: Option<Errors>,
        check: &mut Check,
        cancel: &Cancel,
    ) -> Result<(EffectiveBrdf, Option<Errors>)> {
        let Representation::Interreflecting(direct, bounced) = &found.representation else {
            return Ok((found, errors));
        };
        let Representation::Table(table) = &**direct else { return Ok((found, errors)) };
        let base_area = found.base_area;
        let sum = |i: Vec3, o: Vec3| {
            let mut sum = DVec3::ZERO;
            bounced.eval_lights(&[i], o, |_, g| sum = g * base_area);
            sum
        };
        let representation = Representation::Table(table.plus_bounced(sum, cancel)?);
        let brdf = EffectiveBrdf { representation, base_area };
        let with_bounced = self.decided_errors(&brdf, check, cancel)?;
        Ok(if self.is_close(with_bounced) { (brdf, Some(with_bounced)) } else { (found, errors) })
    }

    /// A sum over a strided subset of the facets, if it is close enough.
    fn strided_subset(&self, check: &Check) -> Option<(EffectiveBrdf, Errors)> {
        let Representation::Direct(direct) = self.exact.direct_representation() else { return None };
        STRIDES.iter().map_while(|stride| direct.strided_subset(*stride)).find_map(|subset| {
            let brdf = self.exact.with_direct_representation(Representation::Direct(subset));
            let errors = check.errors(&brdf).upper;
            self.is_close(errors).then_some((brdf, errors))
        })
    }

    /// The coarsest table that is close enough, and the errors of the last one that was tried.
    fn table(
        &self,
        check: &mut Check,
        cancel: &Cancel,
        times: &mut StageTimes,
    ) -> Result<(Option<EffectiveBrdf>, Option<Errors>)> {
        let mut last = None;
        for grid in &self.grids {
            let errors = match self.attempt(*grid, check, cancel, times)? {
                Attempt::Table(table) => {
                    let brdf = self.with_table(table);
                    let errors = self.decided_errors(&brdf, check, cancel)?;
                    if self.is_close(errors) {
                        return Ok((Some(brdf), Some(errors)));
                    }
                    errors
                }
                Attempt::TooFar(errors) => errors,
                Attempt::Impossible => break,
            };
            last = Some(errors);
            if errors.rel_l2 > MAX_ERROR_RATIO * self.tolerance.0 {
                break;
            }
        }
        Ok((None, last))
    }

    fn with_table(&self, table: ShadingTable) -> EffectiveBrdf {
        self.exact.with_direct_representation(Representation::Table(table.read(self.interpolation)))
    }

    /// A table on one grid. A large one is computed only if a trial of some of its nodes is close enough, and from as few
    /// facets as that needs.
    fn attempt(
        &self,
        grid: HemispherePairGrid,
        check: &mut Check,
        cancel: &Cancel,
        times: &mut StageTimes,
    ) -> Result<Attempt> {
        let mirrors = self.mirrored.as_ref().map_or([false; 2], |tile| mirror_planes(&tile.mesh));
        let facets = match self.exact.direct_representation() {
            // Bit maps of visibility cannot be restricted to a subset of facets.
            Representation::Direct(direct) if !matches!(*direct.visibility, Visibility::Maps(_)) => {
                direct.sum.facet_count()
            }
            _ => 0,
        };
        let nodes = Nodes { mirrors, ..Nodes::all(grid) };
        let count = grid.originals(mirrors);
        if count > MIN_TRIAL_NODES {
            // If the fewest facets are enough, nothing else is tried. If all are not, the grid is too coarse.
            let mut order: Vec<_> = SUBSETS.into_iter().filter(|part| 2 * part <= facets).map(Some).collect();
            order.insert(order.len().min(1), None);
            let mut enough = None;
            for facets in order {
                let part = Nodes { facets, ..nodes };
                // The last trial, and the number of pairs whose nodes it has.
                let mut known: Option<(usize, ShadingTable)> = None;
                let errors = loop {
                    let of_known = known.as_ref().map(|(count, trial)| (&check.pairs[..*count], trial));
                    let nodes = Nodes { read_by: Some(&check.pairs), known: of_known, ..part };
                    let Some(trial) = self.tabulate(nodes, cancel, times)? else { return Ok(Attempt::Impossible) };
                    let errors = check.errors(&self.with_table(trial.clone()));
                    known = Some((check.pairs.len(), trial));
                    if !self.adds_pairs_if_undecided(errors, check, cancel)? {
                        break errors.upper;
                    }
                };
                if self.is_close(errors) {
                    enough = known.map(|known| (part, known));
                    if facets.is_some() {
                        break;
                    }
                } else if facets.is_none() {
                    return Ok(Attempt::TooFar(errors));
                }
            }
            let Some((part, (count, trial))) = enough else { return Ok(Attempt::Impossible) };
            let rest = Nodes { known: Some((&check.pairs[..count], &trial)), ..part };
            return Ok(self.tabulate(rest, cancel, times)?.map_or(Attempt::Impossible, Attempt::Table));
        } else if facets > 0 && COARSE_TABLE_NODES.contains(&count) {
            let part = Nodes { facets: Some(facets / COARSE_SUBSET_DIVISOR), ..nodes };
            let Some(table) = self.tabulate(part, cancel, times)? else { return Ok(Attempt::Impossible) };
            if self.is_close(self.decided_errors(&self.with_table(table.clone()), check, cancel)?) {
                return Ok(Attempt::Table(table));
            }
        }
        Ok(self.tabulate(nodes, cancel, times)?.map_or(Attempt::Impossible, Attempt::Table))
    }

    fn is_close(&self, errors: Errors) -> bool {
        errors.rel_l2 <= self.tolerance.0 && errors.psnr_db >= self.tolerance.1
    }

    /// If the errors that a check found are within the tolerance, but their upper bound is not, adds pairs to it, once.
    /// Returns true if it did.
    fn adds_pairs_if_undecided(&self, errors: CheckedErrors, check: &mut Check, cancel: &Cancel) -> Result<bool> {
        let decides = self.is_close(errors.upper) || !self.is_close(errors.found);
        if decides || check.pairs.len() > IMAGE_CHECK_PAIRS {
            return Ok(false);
        }
        cancel.check()?;
        check.grow(&self.exact, MORE_PAIRS * IMAGE_CHECK_PAIRS);
        Ok(true)
    }

    /// The upper bound of the errors, from more pairs if those of `check` do not decide.
    fn decided_errors(&self, brdf: &EffectiveBrdf, check: &mut Check, cancel: &Cancel) -> Result<Errors> {
        let errors = check.errors(brdf);
        let has_more = self.adds_pairs_if_undecided(errors, check, cancel)?;
        Ok(if has_more { check.errors(brdf).upper } else { errors.upper })
    }

    /// A table on these nodes; `None` if no table can hold the sum.
    fn tabulate(&self, nodes: Nodes<'_>, cancel: &Cancel, times: &mut StageTimes) -> Result<Option<ShadingTable>> {
        match self.exact.direct_representation() {
            Representation::Direct(direct) => {
                if !ShadingTable::can_hold(&direct.sum) {
                    return Ok(None);
                }
                let stage = Tabulate { direct, nodes, keys: self.keys };
                let env = Env::with_cancel(cancel.clone());
                let key = key_of(&stage);
                let content = match self.recent.get(key) {
                    Some(content) => content,
                    None => {
                        let content = run_without_memo(&stage, &env, &self.disk, times)?;
                        self.recent.put(key, &content);
                        content
                    }
                };
                Ok(ShadingTable::from_content(direct, nodes.grid, content))
            }
            representation => {
                let sums =
                    |lights: &[Vec3], o: Vec3, out: &mut [DVec3]| representation.sums(lights, o, |k, sum| out[k] = sum);
                ShadingTable::resample(sums, nodes, cancel).map(Some)
            }
        }
    }
}

/// The result of trying one grid.
enum Attempt {
    Table(ShadingTable),
    /// A table would have these errors.
    TooFar(Errors),
    /// No grid serves.
    Impossible,
}

/// Tabulates a direct sum. Colours and tints are no inputs.
struct Tabulate<'a> {
    direct: &'a Direct,
    nodes: Nodes<'a>,
    keys: ShadingKeys,
}

impl Tabulate<'_> {
    const CACHED: &'static str = "cached_picture_table";
}

impl Stage for Tabulate<'_> {
    type Output = TableContent;
    const NAME: &'static str = "picture_table";
    const CODEC: Option<Codec<TableContent>> = Some(Codec::new(Self::CACHED));

    fn hash_into(&self, key: &mut KeyBuilder) {
        let ShadingKeys { lobes, facets, visibility, .. } = &self.keys;
        key.key("lobes", lobes).key("facets", facets).key("visibility", visibility);
        // Maps of different GPUs share a key but may differ in bits.
        if let Visibility::Maps(maps) = &*self.direct.visibility {
            key.numbers("bits", &maps.packed.words);
        }
        self.nodes.hash_into(key);
    }

    fn run(&self, env: &Env) -> Result<TableContent> {
        let table = ShadingTable::build(self.direct, self.nodes, &env.cancel)?;
        table.map(|table| table.content()).ok_or_else(|| Error::failed("no table can hold this sum"))
    }

    fn accepts(&self, content: &TableContent) -> bool {
        ShadingTable::from_content(self.direct, self.nodes.grid, content.clone()).is_some()
    }
}

#[cfg(test)]
#[path = "shading_tests.rs"]
mod tests;
