//! A BRDF and its colour, as sums over facets evaluate them.

use std::sync::Arc;

use glam::Vec3;

use super::{Brdf, Term};
use crate::cache::KeyBuilder;
use crate::math::simd::Lobe;

/// A small-scale BRDF and a colour that multiplies it.
#[derive(Debug, Clone)]
pub struct Material {
    pub brdf: Brdf,
    /// Linear RGB; multiplies the sum of the terms.
    pub color: Vec3,
}

impl Material {
    /// Returns true if the material reflects nothing.
    pub fn is_black(&self) -> bool {
        self.color == Vec3::ZERO || self.brdf.terms.iter().all(is_zero)
    }

    /// Adds the lobes to a key, without colours and tints, because these multiply the sum.
    pub(crate) fn hash_lobes_into(&self, key: &mut KeyBuilder) {
        key.flags("black", [self.is_black()]).counts("terms", [self.brdf.terms.len()]);
        for term in &self.brdf.terms {
            match (analytic_lobe(term), term.measured()) {
                (Some(lobe), _) => key.numbers("lobe", &lobe.numbers()),
                (None, Some(table)) => key.key("measured", &table.content()),
                (None, None) => key,
            };
        }
    }

    /// Adds lobes and tints to a key, without the colour.
    pub(crate) fn hash_brdf_into(&self, key: &mut KeyBuilder) {
        self.hash_lobes_into(key);
        for term in self.brdf.terms.iter().filter(|term| term.measured().is_none()) {
            // A tint is linear in (1 - i·h)⁵, so two of its values determine it.
            key.numbers("tint", &[term.tint(0.0), term.tint(1.0)]);
        }
    }

    /// Returns true if two materials differ at most in colour.
    pub fn same_brdf(&self, other: &Self) -> bool {
        // A tint is linear in (1 - i·h)⁵, so two of its values determine it.
        let tints = |material: &Self| -> Vec<[Vec3; 2]> {
            material.brdf.terms.iter().map(|term| [0.0, 1.0].map(|i_dot_h| term.tint(i_dot_h))).collect()
        };
        self.same_lobes(other) && tints(self) == tints(other)
    }

    /// Returns true if two materials differ at most in colour and tints. Factors computed for one then fit the other.
    pub fn same_lobes(&self, other: &Self) -> bool {
        let same = |a: &Term, b: &Term| match (a, b) {
            (Term::Measured(a), Term::Measured(b)) => Arc::ptr_eq(a, b),
            _ => analytic_lobe(a).is_some_and(|lobe| Some(lobe) == analytic_lobe(b)),
        };
        let (a, b) = (&self.brdf.terms, &other.brdf.terms);
        self.is_black() == other.is_black() && a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b))
    }
}

/// The material of each slot of a mesh.
#[derive(Debug, Clone, Default)]
pub struct MaterialAssignment {
    /// Indices into `materials`, one per slot.
    pub material_of_slot: Vec<usize>,
    pub materials: Vec<Material>,
}

/// Returns true if a term reflects nothing at any angle.
fn is_zero(term: &Term) -> bool {
    // A tint is linear in (1 - i·h)⁵, so it is zero if two of its values are.
    !matches!(term, Term::Measured(_)) && term.tint(0.0) == Vec3::ZERO && term.tint(1.0) == Vec3::ZERO
}

/// The lobe of an analytic term in the form that SIMD loops evaluate; `None` for a measured term.
pub fn analytic_lobe(term: &Term) -> Option<Lobe> {
    Some(match *term {
        Term::Lambertian { .. } => Lobe::Lambertian,
        Term::BlinnPhong { exponent, .. } => Lobe::blinn_phong(exponent),
        Term::CookTorrance { roughness, .. } => Lobe::cook_torrance(roughness),
        Term::Ward { roughness, .. } => Lobe::ward(roughness),
        Term::Ggx { roughness, .. } => Lobe::ggx(roughness),
        Term::Measured(_) => return None,
    })
}
