//! Conversion of a scene's BRDF terms to terms that can be evaluated, with a check of every number.

use std::ops::RangeInclusive;
use std::path::Path;

use glam::Vec3;

use super::{Brdf, MeasuredCache, MeasuredKind, Term};
use crate::base::{InputError, Result};
use crate::scene::{BrdfSpec, TermSpec};

/// Roughness. Below the minimum a lobe is narrower than the spacing of f32 directions.
pub const ROUGHNESS_RANGE: RangeInclusive<f32> = 1e-4..=2.0;
/// Exponent of Blinn-Phong.
pub const EXPONENT_RANGE: RangeInclusive<f32> = 0.0..=1e6;
/// Albedo, specular colour and f0. A material with values above 1 may create energy, which the health reports.
pub const COLOR_RANGE: RangeInclusive<f32> = 0.0..=1e4;

impl Brdf {
    /// Converts a scene's BRDF. Paths of files are relative to `base_dir`, and measured tables are stored in `cache`.
    pub fn from_specs(spec: &BrdfSpec, base_dir: &Path, cache: &mut MeasuredCache) -> Result<Self> {
        let terms = spec.terms();
        if terms.is_empty() {
            return Err(InputError::new("brdf", "an empty list", "at least one term").into());
        }
        Ok(Self { terms: terms.iter().map(|term| term_from_spec(term, base_dir, cache)).collect::<Result<_>>()? })
    }
}

fn term_from_spec(spec: &TermSpec, base_dir: &Path, cache: &mut MeasuredCache) -> Result<Term> {
    Ok(match spec {
        TermSpec::Lambertian { albedo } => Term::Lambertian { albedo: color("brdf.albedo", *albedo)? },
        TermSpec::BlinnPhong { exponent, specular } => Term::BlinnPhong {
            exponent: number("brdf.exponent", *exponent, EXPONENT_RANGE)?,
            specular: color("brdf.specular", *specular)?,
        },
        TermSpec::CookTorrance { roughness, f0 } => {
            Term::CookTorrance { roughness: self::roughness(*roughness)?, f0: color("brdf.f0", *f0)? }
        }
        TermSpec::Ward { roughness, specular } => {
            Term::Ward { roughness: self::roughness(*roughness)?, specular: color("brdf.specular", *specular)? }
        }
        TermSpec::Ggx { roughness, f0 } => {
            Term::Ggx { roughness: self::roughness(*roughness)?, f0: color("brdf.f0", *f0)? }
        }
        TermSpec::Merl { path } => Term::Measured(cache.load(MeasuredKind::Merl, &base_dir.join(path))?),
        TermSpec::Rgl { path } => Term::Measured(cache.load(MeasuredKind::Rgl, &base_dir.join(path))?),
        TermSpec::Utia { path } => Term::Measured(cache.load(MeasuredKind::Utia, &base_dir.join(path))?),
        TermSpec::Npz { path } => Term::Measured(cache.load(MeasuredKind::Npz, &base_dir.join(path))?),
    })
}

fn roughness(value: f32) -> Result<f32> {
    number("brdf.roughness", value, ROUGHNESS_RANGE)
}

fn color(place: &str, value: Vec3) -> Result<Vec3> {
    value.to_array().iter().try_for_each(|&channel| number(place, channel, COLOR_RANGE).map(drop))?;
    Ok(value)
}

fn number(place: &str, value: f32, range: RangeInclusive<f32>) -> Result<f32> {
    if range.contains(&value) {
        Ok(value)
    } else {
        let expected = format!("a number from {} to {}", range.start(), range.end());
        Err(InputError::new(place, value, expected).into())
    }
}

#[cfg(test)]
#[path = "from_specs_tests.rs"]
mod tests;
