//! The sampling density of M. The paper searches for the counts that represent a BRDF to 2 % of its power (1 % for
//! normals), which takes hours for sharp lobes. The rule here reproduces the counts that Table 3 of the paper lists.

use glam::Vec3;

use crate::brdf::{Brdf, LobeAngles, Measured, Term};

/// Directions and normals of M.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sampling {
    pub directions: usize,
    /// Number of normals of one hemisphere; the paper's "column number" is twice this.
    pub half_normals: usize,
}

/// The largest sampling in Table 3, to which the paper clamps, and the smallest, that of a Lambertian BRDF.
const FINEST: Sampling = Sampling { directions: 1857, half_normals: 3221 };
const COARSEST: Sampling = Sampling { directions: 132, half_normals: 224 };

/// The measured materials of Table 3. The table lists rows, which are unordered direction pairs: 49,141 = 313·314/2.
const MEASURED: [(&str, Sampling); 7] = [
    ("pearl-paint", Sampling { directions: 313, half_normals: 1021 }),
    ("silver-paint", Sampling { directions: 568, half_normals: 1884 }),
    ("silver-metallic-paint2", Sampling { directions: 752, half_normals: 3221 }),
    ("gold-metallic-paint", Sampling { directions: 952, half_normals: 3221 }),
    ("blue-metallic-paint", Sampling { directions: 952, half_normals: 3221 }),
    ("special-walnut-224", Sampling { directions: 1367, half_normals: 2125 }),
    ("white-diffuse", Sampling { directions: 313, half_normals: 313 }),
];

/// Limits on the entries of M, rows x columns, which bound the build time. A measured value takes about ten times as
/// long as an analytic lobe.
const MAX_ANALYTIC_ENTRIES: f64 = 1.5e9;
const MAX_MEASURED_ENTRIES: f64 = 1.5e8;

impl Sampling {
    /// The paper's sampling: the finest of all terms.
    pub fn of(brdf: &Brdf) -> Self {
        brdf.terms.iter().map(of_term).fold(COARSEST, |a, b| Self {
            directions: a.directions.max(b.directions),
            half_normals: a.half_normals.max(b.half_normals),
        })
    }

    /// Shrinks both maps by one factor until M is within the limit.
    pub fn capped(self, brdf: &Brdf) -> Self {
        let cap = if brdf.terms.iter().any(|term| term.measured().is_some()) {
            MAX_MEASURED_ENTRIES
        } else {
            MAX_ANALYTIC_ENTRIES
        };
        let entries = 0.5 * (self.directions as f64).powi(2) * 2.0 * self.half_normals as f64;
        // Counts are proportional to the square of a map's side, entries to its sixth power.
        let shrink = (cap / entries).min(1.0).cbrt();
        let scaled = |count: usize| ((count as f64 * shrink) as usize).max(1);
        Self { directions: scaled(self.directions), half_normals: scaled(self.half_normals) }
    }
}

/// The sampling of one term. Counts are inversely proportional to the square of the lobe's width and match the analytic
/// rows of Table 3: Cook-Torrance 0.5 and 0.2 (303 and 1857 directions, 756 normals per hemisphere), Ward 0.3 (568,
/// 1884).
fn of_term(term: &Term) -> Sampling {
    match term {
        Term::Lambertian { .. } => COARSEST,
        Term::BlinnPhong { exponent, .. } => beckmann((2.0 / (exponent + 2.0)).sqrt()),
        Term::CookTorrance { roughness, .. } | Term::Ggx { roughness, .. } => beckmann(*roughness),
        Term::Ward { roughness, .. } => by_width(*roughness, 51.1, 169.6),
        Term::Measured(table) => {
            let name = table.name().to_lowercase().replace('_', "-");
            match MEASURED.iter().find(|(known, _)| name.contains(known)) {
                Some((_, sampling)) => *sampling,
                None => beckmann(measured_width(table.as_ref())),
            }
        }
    }
}

fn beckmann(m: f32) -> Sampling {
    by_width(m, 75.8, 189.0)
}

fn by_width(width: f32, directions: f32, half_normals: f32) -> Sampling {
    let count = |scale: f32, low: usize, high: usize| ((scale / (width * width)).round() as usize).clamp(low, high);
    Sampling {
        directions: count(directions, COARSEST.directions, FINEST.directions),
        half_normals: count(half_normals, COARSEST.half_normals, FINEST.half_normals),
    }
}

/// The tangent of the half angle at which a measured lobe, for equal light and view, falls to 1/e of its peak; it
/// corresponds to Beckmann's m.
fn measured_width(table: &dyn Measured) -> f32 {
    let at = |theta: f32| {
        let (sin, cos) = theta.sin_cos();
        let angles = LobeAngles { n_dot_i: cos, n_dot_o: cos, n_dot_h: cos, sin2_theta_h: sin * sin, i_dot_h: 1.0 };
        table.f_r(&angles).dot(Vec3::ONE)
    };
    const STEPS: usize = 400;
    let angle = |k: usize| 1.3 * (k as f32 / STEPS as f32).powi(2);
    let peak = at(angle(1));
    (1..STEPS).map(angle).find(|&theta| at(theta) < peak / std::f32::consts::E).map_or(1.0, f32::tan)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampling(term: Term) -> (usize, usize) {
        let sampling = Sampling::of(&Brdf { terms: vec![term] });
        (sampling.directions, sampling.half_normals)
    }

    #[test]
    fn the_rule_matches_the_analytic_rows_of_table_3() {
        let near = |found: (usize, usize), paper: (usize, usize)| {
            assert!(found.0.abs_diff(paper.0) <= 2 && found.1.abs_diff(paper.1) <= 2, "{found:?} {paper:?}");
        };
        near(sampling(Term::Lambertian { albedo: Vec3::ONE }), (132, 224));
        near(sampling(Term::CookTorrance { roughness: 0.5, f0: Vec3::ONE }), (303, 756));
        near(sampling(Term::CookTorrance { roughness: 0.2, f0: Vec3::ONE }), (1857, 3221));
        near(sampling(Term::Ward { roughness: 0.3, specular: Vec3::ONE }), (568, 1884));
    }

    #[test]
    fn a_mirror_is_limited_and_a_diffuse_surface_is_not() {
        let brdf = |term| Brdf { terms: vec![term] };
        let mirror = brdf(Term::Ggx { roughness: 1e-3, f0: Vec3::ONE });
        let capped = Sampling::of(&mirror).capped(&mirror);
        assert!((capped.directions as f64).powi(2) * capped.half_normals as f64 <= MAX_ANALYTIC_ENTRIES);
        assert!(capped.directions > 800);
        let chalk = brdf(Term::Lambertian { albedo: Vec3::ONE });
        assert_eq!(Sampling::of(&chalk).capped(&chalk), COARSEST);
    }
}
