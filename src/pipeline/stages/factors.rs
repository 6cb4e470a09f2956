//! The low-rank representation: visibility on a grid, the factors, and their tables. Colours and tints are no inputs of
//! these stages, so that an edit of a colour finds their results in the memo.

use crate::base::Result;
use crate::brdf::Material;
use crate::cache::{Key, KeyBuilder};
use crate::effective::{Factors, LowRank, LowRankSettings, VisibilityRows};
use crate::geometry::Facets;
use crate::math::directions::PolarGrid;
use crate::metrics::Pair;
use crate::pipeline::Env;
use crate::pipeline::stage::{Keyed, Stage};
use crate::visibility::Visibility;

/// Evaluates the visibility of all facets on the nodes of a grid.
pub struct LookUpVisibility<'a> {
    pub facets: &'a Keyed<Facets>,
    pub visibility: &'a Keyed<Visibility>,
    pub directions: PolarGrid,
}

impl Stage for LookUpVisibility<'_> {
    type Output = VisibilityRows;
    const NAME: &'static str = "rows";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("facets", &self.facets.key).key("visibility", &self.visibility.key);
        key.debug("directions", &self.directions);
    }

    fn run(&self, _: &Env) -> Result<VisibilityRows> {
        Ok(VisibilityRows::new(&self.visibility.value, 0..self.facets.len(), self.directions))
    }
}

/// Factors the lobes of all materials (M) and the visible normals in their metric (N).
pub struct Factorize<'a> {
    pub facets: &'a Keyed<Facets>,
    pub rows: &'a Keyed<VisibilityRows>,
    /// The key of the lobes of all materials and of their slots.
    pub lobes: Key,
    pub material_of_slot: &'a [usize],
    pub materials: &'a [Material],
    pub settings: &'a LowRankSettings,
}

impl Stage for Factorize<'_> {
    type Output = Factors;
    const NAME: &'static str = "factors";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("facets", &self.facets.key).key("rows", &self.rows.key).key("lobes", &self.lobes);
        key.debug("settings", self.settings);
    }

    fn run(&self, _: &Env) -> Result<Factors> {
        let (facets, rows) = (self.facets.value.clone(), self.rows.value.clone());
        Factors::new(facets, rows, self.material_of_slot, self.materials, self.settings)
    }
}

/// Tabulates factors over all pairs of directions.
pub struct TabulateFactors<'a> {
    pub factors: &'a Keyed<Factors>,
}

impl Stage for TabulateFactors<'_> {
    type Output = LowRank;
    const NAME: &'static str = "factor_tables";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("factors", &self.factors.key);
    }

    fn run(&self, _: &Env) -> Result<LowRank> {
        Ok(self.factors.tabulate())
    }
}

/// Tabulates factors only where some pairs read them.
pub struct TabulateForCheck<'a> {
    pub factors: &'a Keyed<Factors>,
    pub pairs: &'a [Pair],
}

impl Stage for TabulateForCheck<'_> {
    type Output = LowRank;
    const NAME: &'static str = "factor_check";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("factors", &self.factors.key);
        let directions: Vec<[glam::Vec3; 2]> = self.pairs.iter().map(|pair| [pair.i, pair.o]).collect();
        key.numbers("pairs", &directions);
    }

    fn run(&self, _: &Env) -> Result<LowRank> {
        Ok(self.factors.tabulate_for(self.pairs.iter().map(|pair| (pair.i, pair.o))))
    }
}
