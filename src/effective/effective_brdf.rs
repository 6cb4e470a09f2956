//! The effective BRDF: one `eval` for all representations.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::{Direct, LowRank, Reflectance, ShadingTable, Wu2011};
use crate::base::{Cancel, Result};
use crate::interreflection::InterreflectionTable;
use crate::metrics::Pair;

/// A representation of `G`.
#[derive(Debug, Clone)]
pub enum Representation {
    /// A sum over facets with exact lobes, evaluated at the query.
    Direct(Direct),
    /// Visibility factors on an (i,o) grid times lobe factors on an (h,d) grid.
    LowRank(LowRank),
    /// A shading table: the sum tabulated over half and difference angles, for rendering.
    Table(ShadingTable),
    /// The paper's own tables.
    Wu2011(Wu2011),
    /// One of the others plus interreflection.
    Interreflecting(Box<Representation>, Arc<InterreflectionTable>),
}

impl Representation {
    /// Describes the representation in words.
    pub fn describe(&self) -> String {
        match self {
            Self::Direct(direct) => match direct.sum.normal_count() {
                Some(count) => format!("exact lobes of {count} normals over {} facets", direct.sum.facet_count()),
                None => format!("direct sum over {} facets", direct.sum.facet_count()),
            },
            Self::Interreflecting(direct, table) => {
                format!("{}, and {} bytes of light between facets", direct.describe(), table.bytes())
            }
            Self::Table(table) => {
                format!("a table of {} pairs of directions, {} bytes", table.grid.nodes(), table.bytes())
            }
            Self::Wu2011(tables) => format!("the paper's tables, {} bytes", tables.bytes()),
            Self::LowRank(factors) => format!(
                "factors: ranks {} on {} directions",
                factors.channels.iter().map(|channel| channel.ranks.1.to_string()).collect::<Vec<_>>().join(" + "),
                factors.directions.len()
            ),
        }
    }
}

/// The effective large-scale BRDF of a tile (Wu et al. 2011, Eq. 7). `f̄` includes the light's cosine.
#[derive(Debug, Clone)]
pub struct EffectiveBrdf {
    pub representation: Representation,
    /// Base area `A` of the tile.
    pub base_area: f64,
}

impl EffectiveBrdf {
    /// `f̄(i, o)` [1/sr], the light's cosine included; 0 if `i` or `o` is at or below the horizon.
    pub fn eval(&self, i: Vec3, o: Vec3) -> Vec3 {
        let mut out = [Vec3::ZERO];
        self.eval_lights(&[i], o, &mut out);
        out[0]
    }

    /// `f̄` at each pair, in parallel.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn eval_pairs(&self, pairs: &[Pair], cancel: &Cancel) -> Result<Vec<Vec3>> {
        cancel.map("pairs", pairs.len(), |k| self.eval(pairs[k].i, pairs[k].o))
    }

    /// `G(i,o) = a_v(o) f̄(i,o) / A` [1/sr], which is reciprocal and bounded; tables store this quantity.
    pub fn g(&self, i: Vec3, o: Vec3) -> Vec3 {
        let mut g = DVec3::ZERO;
        self.sums(&[i], o, |_, sum| g = sum);
        (g / self.base_area).as_vec3()
    }

    /// `a_v(o) / A`: the visible projected area along `o` per base area; `cos θ_o` for a closed surface.
    pub fn relative_projected_area(&self, o: Vec3) -> f32 {
        (self.sums(&[], o, |_, _| {}) / self.base_area) as f32
    }

    /// Adds interreflection.
    pub fn interreflecting(self, table: Arc<InterreflectionTable>) -> Self {
        Self { representation: Representation::Interreflecting(Box::new(self.representation), table), ..self }
    }

    /// The representation of direct reflection, without interreflection.
    pub fn direct_representation(&self) -> &Representation {
        match &self.representation {
            Representation::Interreflecting(direct, _) => direct,
            direct => direct,
        }
    }

    /// Replaces the representation of direct reflection and keeps interreflection.
    pub fn with_direct_representation(&self, direct: Representation) -> Self {
        let representation = match &self.representation {
            Representation::Interreflecting(_, table) => {
                Representation::Interreflecting(Box::new(direct), table.clone())
            }
            _ => direct,
        };
        Self { representation, base_area: self.base_area }
    }

    /// Returns `a_v(o)` and writes `a_v f̄` of each light to `out`.
    fn sums(&self, lights: &[Vec3], o: Vec3, mut out: impl FnMut(usize, DVec3)) -> f64 {
        if let Representation::Interreflecting(direct, table) = &self.representation {
            let mut sums = vec![DVec3::ZERO; lights.len()];
            let area = direct.sums(lights, o, |k, sum| sums[k] = sum);
            table.eval_lights(lights, o, |k, g| out(k, sums[k] + g * self.base_area));
            return area;
        }
        self.representation.sums(lights, o, out)
    }

    /// Divides `a_v f̄` by `a_v`. A tile without visible facets reflects nothing.
    fn divide(&self, sums: &mut [Vec3], area: f64) {
        let scale = if area > 1e-12 * self.base_area { (1.0 / area) as f32 } else { 0.0 };
        sums.iter_mut().for_each(|sum| *sum *= scale);
    }
}

impl Representation {
    /// Returns `a_v(o)` and writes `a_v f̄` of each light to `out`, without interreflection, which [`EffectiveBrdf`]
    /// adds.
    pub(crate) fn sums(&self, lights: &[Vec3], o: Vec3, mut out: impl FnMut(usize, DVec3)) -> f64 {
        match self {
            Self::Interreflecting(direct, _) => direct.sums(lights, o, &mut out as &mut dyn FnMut(usize, DVec3)),
            Representation::Direct(direct) => direct.sums(lights, o, out),
            Representation::LowRank(factors) => factors.sums(lights, o, out),
            Representation::Table(table) => table.sums(lights, o, out),
            Representation::Wu2011(tables) => tables.sums(lights, o, out),
        }
    }
}

impl Reflectance for EffectiveBrdf {
    fn eval_lights(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        let area = self.sums(lights, o, |k, sum| out[k] = sum.as_vec3());
        self.divide(&mut out[..lights.len()], area);
    }

    fn eval_direct(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) -> bool {
        let area = self.direct_representation().sums(lights, o, |k, sum| out[k] = sum.as_vec3());
        self.divide(&mut out[..lights.len()], area);
        matches!(self.representation, Representation::Interreflecting(..))
    }

    fn eval_bounced(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        let area = match &self.representation {
            Representation::Interreflecting(direct, table) => {
                table.eval_lights(lights, o, |k, g| out[k] = (g * self.base_area).as_vec3());
                direct.sums(&[], o, |_, _| {})
            }
            Representation::Table(table) => table.bounced_sums(lights, o, |k, sum| out[k] = sum.as_vec3()),
            _ => 0.0,
        };
        self.divide(&mut out[..lights.len()], area);
    }
}
