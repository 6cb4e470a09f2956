//! The effective BRDF: one `eval`, whatever form holds it.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::{Direct, LowRank, Reflectance, ShadingTable, Wu2011};
use crate::interreflection::InterreflectionTable;

/// How `G` is held.
#[derive(Debug, Clone)]
pub enum Representation {
    /// A live sum over facets with exact lobes.
    Direct(Direct),
    /// Visibility factors on an (i,o) grid times lobe factors on an (h,d) grid.
    LowRank(LowRank),
    /// A table of the sum over half and difference coordinates, for pictures.
    Table(ShadingTable),
    /// The paper's own tables.
    Wu2011(Wu2011),
    /// Any of these, and the light between facets added.
    Interreflecting(Box<Representation>, Arc<InterreflectionTable>),
}

impl Representation {
    /// What holds the BRDF, in words.
    pub fn describe(&self) -> String {
        match self {
            Self::Direct(direct) => match direct.sum.patch_count() {
                Some(count) => format!("exact lobes of {count} normals over {} facets", direct.sum.facet_count()),
                None => format!("direct sum over {} facets", direct.sum.facet_count()),
            },
            Self::Interreflecting(form, table) => {
                format!("{}, and {} bytes of light between facets", form.describe(), table.bytes())
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
    pub form: Representation,
    /// Base area `A` of the tile.
    pub base_area: f64,
}

impl EffectiveBrdf {
    /// `f̄(i, o)` [1/sr], the light's cosine included; 0 where `i` or `o` is at or under the horizon.
    pub fn eval(&self, i: Vec3, o: Vec3) -> Vec3 {
        let mut out = [Vec3::ZERO];
        self.eval_lights(&[i], o, &mut out);
        out[0]
    }

    /// `G(i,o) = a_v(o) f̄(i,o) / A` [1/sr]: reciprocal and bounded, the quantity that tables store.
    pub fn g(&self, i: Vec3, o: Vec3) -> Vec3 {
        let mut g = DVec3::ZERO;
        self.sums(&[i], o, |_, sum| g = sum);
        (g / self.base_area).as_vec3()
    }

    /// `a_v(o) / A`: the visible projected area along `o` a unit of base area; `cos θ_o` for a tile that closes the plane.
    pub fn relative_projected_area(&self, o: Vec3) -> f32 {
        (self.sums(&[], o, |_, _| {}) / self.base_area) as f32
    }

    /// With light between facets added.
    pub fn interreflecting(self, table: Arc<InterreflectionTable>) -> Self {
        Self { form: Representation::Interreflecting(Box::new(self.form), table), ..self }
    }

    /// How what facets reflect directly is held; without the light between them.
    pub fn direct_form(&self) -> &Representation {
        match &self.form {
            Representation::Interreflecting(form, _) => form,
            form => form,
        }
    }

    /// The same light between facets, and another form of what they reflect directly.
    pub fn with_direct_form(&self, form: Representation) -> Self {
        let form = match &self.form {
            Representation::Interreflecting(_, table) => Representation::Interreflecting(Box::new(form), table.clone()),
            _ => form,
        };
        Self { form, base_area: self.base_area }
    }

    /// `a_v(o)`, and `a_v f̄` of each light into `out`.
    fn sums(&self, lights: &[Vec3], o: Vec3, mut out: impl FnMut(usize, DVec3)) -> f64 {
        if let Representation::Interreflecting(form, table) = &self.form {
            let mut direct = vec![DVec3::ZERO; lights.len()];
            let area = form.sums(lights, o, |k, sum| direct[k] = sum);
            table.add(lights, o, |k, g| out(k, direct[k] + g * self.base_area));
            return area;
        }
        self.form.sums(lights, o, out)
    }
}

impl Representation {
    /// `a_v(o)`, and `a_v f̄` of each light into `out`; what facets send to each other is added by [`EffectiveBrdf`].
    pub(crate) fn sums(&self, lights: &[Vec3], o: Vec3, mut out: impl FnMut(usize, DVec3)) -> f64 {
        match self {
            Self::Interreflecting(form, _) => form.sums(lights, o, &mut out as &mut dyn FnMut(usize, DVec3)),
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
        // What no facet shows reflects nothing.
        let scale = if area > 1e-12 * self.base_area { (1.0 / area) as f32 } else { 0.0 };
        for value in out.iter_mut().take(lights.len()) {
            *value *= scale;
        }
    }
}
