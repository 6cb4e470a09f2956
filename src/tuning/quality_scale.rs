//! The quality scale: a one-parameter family of settings from fast to fine, for `--target-db`, `--budget-ms` and the
//! editor's slider.

use super::candidates::{Candidate, Family};

/// The finest quality level: 131,072 facets.
pub const FINEST: f64 = 13.0;
/// Facets of the coarsest quality level.
const COARSEST_FACETS: f64 = 16.0;
/// Fewest azimuths of visibility. With fewer, single pairs near the horizon hold most of the error, so that an estimate
/// over other pairs misses it.
const MIN_AZIMUTHS: f64 = 24.0;
/// Number of facets from which the preset `fine`, with its narrower transition width, is more accurate for the same
/// time.
const FINE_FACETS: usize = 24_000;

/// Settings at the quality level `level` in `0..=FINEST`: a direct sum over `16 · 2^level` facets. The number of
/// azimuths makes the error of visibility as large as that of the sum; overhangs take 1.5 times as many.
///
/// The error of the sum falls with about the 0.75th power of the number of facets, the error of horizons with the square
/// of the number of azimuths.
pub fn candidate_at(level: f64, overhangs: bool) -> Candidate {
    let level = if level.is_finite() { level.clamp(0.0, FINEST) } else { 0.0 };
    let facets = (COARSEST_FACETS * level.exp2()).round();
    let azimuths = (40.0 * (facets / 2048.0).powf(0.3)).max(MIN_AZIMUTHS) * if overhangs { 1.5 } else { 1.0 };
    let azimuths = 2 * (0.5 * azimuths).round() as usize;
    let facets = facets as usize;
    Candidate {
        family: Family::QualityScale,
        preset: if facets >= FINE_FACETS { "fine" } else { "standard" },
        set: vec![
            format!("quality.facets={facets}"),
            format!("quality.azimuths={azimuths}"),
            "quality.method=direct".to_owned(),
        ],
    }
}

/// The quality level with a number of facets.
pub fn level_of_facets(facets: usize) -> f64 {
    (facets.max(1) as f64 / COARSEST_FACETS).log2().clamp(0.0, FINEST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Settings;
    use crate::tuning::candidates::with_settings;

    #[test]
    fn every_quality_level_is_valid_and_finer_than_a_lower_one() {
        let loaded = crate::scene::open("default", &[]).unwrap();
        let mut last = (0, 0);
        for k in 0..=26 {
            let x = f64::from(k) * 0.5;
            let scene = with_settings(&loaded, &candidate_at(x, k % 2 == 0)).unwrap();
            let settings = Settings::from_quality(&scene.scene.quality);
            assert!(settings.facets > last.0, "{x}");
            last.0 = settings.facets;
            assert!((level_of_facets(settings.facets) - x).abs() < 0.05, "{x}");
            if k % 2 == 0 {
                assert!(settings.horizon_azimuths >= last.1);
                last.1 = settings.horizon_azimuths;
            }
        }
        assert_eq!(candidate_at(f64::NAN, false), candidate_at(0.0, false));
    }
}
