//! Quantities on which several effects rest, computed once per plan.

use super::{Costs, Preset, ProductMethod, SceneFeatures, Settings, VisibilityAlgorithm, is_on};
use crate::scene::Switch;

/// Queries of the image that the cost model assumes: 384x384 pixels, 32 lights, a third of them lit and covered.
const IMAGE_QUERIES: f64 = 384.0 * 384.0 * 32.0 / 3.0;

/// Pairs of directions on which the representation that images read is compared with the BRDF.
pub const IMAGE_CHECK_PAIRS: usize = 512;

/// Milliseconds that a factorization takes, on any number of threads.
const FACTORIZATION_MS: f64 = 800.0;

/// Threads that the choice between direct sum and factors assumes, so that one scene gets one representation on every
/// machine. The paper's machine had four cores.
const ASSUMED_THREADS: f64 = 4.0;

/// The inputs of all rows, and what several rows need.
pub(super) struct Context<'a> {
    pub features: &'a SceneFeatures,
    pub settings: &'a Settings,
    pub costs: &'a Costs,
    pub algorithm: VisibilityAlgorithm,
    pub try_low_rank: bool,
    pub try_shading_table: bool,
    pub interreflection: bool,
}

/// Predicted milliseconds of a shading table: computing it, and an image that reads it.
pub(super) struct TableCost {
    pub compute_ms: f64,
    pub image_ms: f64,
}

impl<'a> Context<'a> {
    pub fn new(features: &'a SceneFeatures, settings: &'a Settings, costs: &'a Costs) -> Self {
        let mut context = Self {
            features,
            settings,
            costs,
            algorithm: VisibilityAlgorithm::choose(features, settings),
            try_low_rank: false,
            try_shading_table: false,
            interreflection: features.interreflects(settings),
        };
        context.try_low_rank = context.wants_low_rank();
        let table_pays = context.table_cost().is_some_and(|cost| {
            !features.flat && cost.compute_ms + cost.image_ms < context.direct_image_ms(costs.threads)
        });
        let is_paper = settings.preset == Preset::Wu2011;
        context.try_shading_table = !is_paper && is_on(settings.effects.picture_table, table_pays);
        context
    }

    /// Returns true if visibility is a horizon map.
    pub fn has_horizon_map(&self) -> bool {
        matches!(self.algorithm, VisibilityAlgorithm::HeightMarch | VisibilityAlgorithm::HorizonScan)
    }

    /// Predicted milliseconds of one direct sum with so many threads at work.
    fn query_ms(&self, threads: f64) -> f64 {
        let (features, costs) = (self.features, self.costs);
        let fill_ns = if self.algorithm == VisibilityAlgorithm::OcclusionIntervals {
            costs.slice_fill_ns
        } else {
            costs.facet_fill_ns
        };
        let lobes_ns = features.lobes as f64 * costs.lobe_ns + features.lookups as f64 * costs.lookup_ns;
        (lobes_ns + self.settings.facets as f64 * fill_ns) * 1e-6 / threads
    }

    /// Predicted milliseconds of one direct sum on this machine.
    pub fn direct_query_ms(&self) -> f64 {
        self.query_ms(self.costs.threads)
    }

    /// Predicted milliseconds of an image from direct sums.
    pub fn direct_image_ms(&self, threads: f64) -> f64 {
        IMAGE_QUERIES * self.query_ms(threads)
    }

    /// Predicted milliseconds of an image from factors, the factorization included.
    pub fn low_rank_image_ms(&self, threads: f64) -> f64 {
        FACTORIZATION_MS + IMAGE_QUERIES * self.costs.factor_query_ns * 1e-6 / threads
    }

    /// Predicted milliseconds of the factorization, if it is tried.
    pub fn factorization_ms(&self) -> f64 {
        if self.try_low_rank { FACTORIZATION_MS } else { 0.0 }
    }

    /// Sums of analytic lobes are fast enough for single pairs and export, and images read a table of them, so that
    /// factors pay only if a term is looked up. Few distinct normals have sharp edges between them, which the grid of
    /// the lobes resolves badly.
    fn wants_low_rank(&self) -> bool {
        let features = self.features;
        match self.settings.method {
            _ if self.settings.preset == Preset::Wu2011 => true,
            ProductMethod::Direct => false,
            ProductMethod::LowRank => true,
            ProductMethod::Auto => {
                self.settings.preset != Preset::Reference
                    && features.lookups > 0
                    && features.distinct_normals.is_none()
                    && self.low_rank_image_ms(ASSUMED_THREADS) < self.direct_image_ms(ASSUMED_THREADS)
            }
        }
    }

    /// The cost of the coarsest shading table; `None` if images evaluate the BRDF itself at this quality.
    pub fn table_cost(&self) -> Option<TableCost> {
        if self.settings.preset == Preset::Wu2011 {
            return None;
        }
        let saved = self.settings.effects.mirror_symmetry != Switch::Off;
        let mirrors = self.features.mirrors.filter(|_| saved).unwrap_or_default();
        self.settings.image_grids.first().map(|grid| TableCost {
            compute_ms: grid.originals(mirrors) as f64 * self.direct_query_ms(),
            image_ms: IMAGE_QUERIES * self.costs.table_query_ns * 1e-6 / self.costs.threads,
        })
    }

    /// The mirror planes that are used.
    pub fn mirrors(&self) -> [bool; 2] {
        match self.settings.effects.mirror_symmetry {
            Switch::Auto => self.features.mirrors.unwrap_or_default(),
            Switch::On => [true; 2],
            Switch::Off => [false; 2],
        }
    }
}
