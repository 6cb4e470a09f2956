//! Measured BRDFs with invalid samples: negative, NaN, infinite, missing, zero, and extremely large.

use std::path::Path;

use biscale::metrics::mirror_biased_pairs;
use biscale::pipeline::Pipeline;
use glam::Vec3;

use crate::cases::Case;
use crate::examination::open;

const BINS: [usize; 3] = [90, 90, 180];

/// Writes a MERL file of a diffuse paint with a broad lobe. `replace(index)` returns the sample to store instead, if
/// any.
fn merl(path: &Path, replace: impl Fn(usize) -> Option<f64>) {
    let plane = BINS.iter().product::<usize>();
    let mut bytes: Vec<u8> = BINS.iter().flat_map(|n| (*n as i32).to_le_bytes()).collect();
    bytes.reserve(24 * plane);
    for scale in [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0] {
        for index in 0..plane {
            let h = (index / 180 / 90) as f64 / 90.0;
            let value = (0.2 + 2.0 * (-(6.0 * h * h).powi(2)).exp()) / scale;
            bytes.extend(replace(index).unwrap_or(value).to_le_bytes());
        }
    }
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn measured_brdfs_with_invalid_samples_give_sound_values_and_report_the_rejected_samples() {
    let every = |step: usize, value: f64| move |k: usize| k.is_multiple_of(step).then_some(value);
    type Replace<'a> = &'a dyn Fn(usize) -> Option<f64>;
    let cases: [(&str, Replace<'_>, f64, &str); 7] = [
        ("negative", &every(3, -1.0), 0.33, "33 % of the samples"),
        ("NaN", &every(2, f64::NAN), 0.5, "50 % of the samples"),
        ("infinite", &every(50, f64::INFINITY), 0.02, ""),
        ("fireflies", &every(1009, 1e8 * 1500.0), 0.0, "times the light"),
        ("all missing", &|_| Some(-1.0), 1.0, "no valid sample"),
        ("all zero", &|_| Some(0.0), 0.0, ""),
        ("sound", &|_| None, 0.0, ""),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (name, replace, rejected, warning) in cases {
        merl(&folder.path().join("paint.binary"), replace);
        let case = Case {
            family: "measured",
            name,
            tile: "geometry = { kind = \"pyramids\" }".to_owned(),
            brdf: "{ kind = \"merl\", path = \"paint.binary\" }".to_owned(),
            mesh: None,
        };
        for method in ["direct", "low_rank"] {
            let outcome = Pipeline::new().effective(&open(&case, method, folder.path())).unwrap();
            let values: Vec<Vec3> = mirror_biased_pairs(100, 3).iter().map(|p| outcome.brdf.eval(p.i, p.o)).collect();
            let sound = values.iter().all(|value| value.is_finite() && value.min_element() >= 0.0);
            assert!(sound, "{name}, {method}: {values:?}");
            let black = ["all missing", "all zero"].contains(&name);
            assert_eq!(values.iter().all(|value| *value == Vec3::ZERO), black, "{name}, {method}");
            let health = outcome.health();
            let [table] = &health.measured[..] else { panic!("{name}: {:?}", health.measured) };
            let part = table.rejected as f64 / table.samples as f64;
            assert!((part - rejected).abs() < 0.01, "{name}: {part} rejected");
            let warnings = health.warnings.join("\n");
            assert!(warnings.contains(warning), "{name}: {warnings}");
            assert!(!warning.is_empty() || !warnings.contains("paint"), "{name}: {warnings}");
        }
    }
}
