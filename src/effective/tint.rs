//! Colours that are not part of tables.

use glam::Vec3;

use crate::brdf::Term;

/// A coloured factor that multiplies a tabulated scalar at the query.
#[derive(Debug, Clone)]
pub enum Tint {
    /// The tint of an analytic term, evaluated at the query's `i·h`, times a colour.
    Term(Term, Vec3),
    /// A colour, or a colour times a colour direction of a measured BRDF.
    Fixed(Vec3),
}

impl Tint {
    #[inline]
    pub fn at(&self, i_dot_h: f32) -> Vec3 {
        match self {
            Self::Term(term, color) => term.tint(i_dot_h) * *color,
            Self::Fixed(color) => *color,
        }
    }
}
