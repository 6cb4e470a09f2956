//! One line through all settings, from faster to finer: what `--target-db`, `--budget-ms` and the editor's slider walk along.

use super::candidates::{Candidate, Family};

/// The finest rung: 131,072 facets.
pub const FINEST: f64 = 13.0;
/// Facets of the coarsest.
const COARSEST_FACETS: f64 = 16.0;
/// With fewer, single pairs near the horizon hold most of the error, and other pairs miss them.
const MIN_AZIMUTHS: f64 = 24.0;
/// From here on the narrower penumbra of `fine` pays.
const FINE_FACETS: usize = 24_000;

/// The setting at `x` in `0..=FINEST`: `16 · 2^x` facets, summed directly, and as many azimuths of visibility as leave an
/// error of the same size; surfaces that overhang need half as many again.
///
/// Facets and azimuths are balanced as `draft`, `standard` and `fine` are. Sums over facets fall with about the 0.75th power
/// of their number, horizons with the square of their azimuths.
pub fn rung(x: f64, overhangs: bool) -> Candidate {
    let x = if x.is_finite() { x.clamp(0.0, FINEST) } else { 0.0 };
    let facets = (COARSEST_FACETS * x.exp2()).round();
    let azimuths = (40.0 * (facets / 2048.0).powf(0.3)).max(MIN_AZIMUTHS) * if overhangs { 1.5 } else { 1.0 };
    let azimuths = 2 * (0.5 * azimuths).round() as usize;
    let facets = facets as usize;
    Candidate {
        family: Family::Ladder,
        preset: if facets >= FINE_FACETS { "fine" } else { "standard" },
        set: vec![
            format!("quality.facets={facets}"),
            format!("quality.azimuths={azimuths}"),
            "quality.method=direct".to_owned(),
        ],
    }
}

/// The rung with as many facets as a setting.
pub fn position(facets: usize) -> f64 {
    (facets.max(1) as f64 / COARSEST_FACETS).log2().clamp(0.0, FINEST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Settings;
    use crate::tuning::candidates::with_settings;

    #[test]
    fn every_rung_is_a_setting_and_finer_than_the_one_before() {
        let loaded = crate::scene::open("default", &[]).unwrap();
        let mut last = (0, 0);
        for k in 0..=26 {
            let x = f64::from(k) * 0.5;
            let scene = with_settings(&loaded, &rung(x, k % 2 == 0)).unwrap();
            let settings = Settings::from_quality(&scene.scene.quality);
            assert!(settings.facets > last.0, "{x}");
            last.0 = settings.facets;
            assert!((position(settings.facets) - x).abs() < 0.05, "{x}");
            if k % 2 == 0 {
                assert!(settings.horizon_azimuths >= last.1);
                last.1 = settings.horizon_azimuths;
            }
        }
        assert_eq!(rung(f64::NAN, false), rung(0.0, false));
    }
}
