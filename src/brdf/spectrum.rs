//! Conversion between reflectance spectra and linear RGB (Rec. 709, D65), for files that store wavelengths.

use glam::{DMat3, DVec3};

/// Daylight of 6500 K, relative power at 380, 390 ... 780 nm (CIE standard illuminant D65).
const D65: [f64; 41] = [
    49.98, 54.65, 82.75, 91.49, 93.43, 86.68, 104.86, 117.01, 117.81, 114.86, 115.92, 108.81, 109.35, 107.80, 104.79,
    107.69, 104.41, 104.05, 100.00, 96.33, 95.79, 88.69, 90.01, 89.60, 87.70, 83.29, 83.70, 80.03, 80.21, 82.28, 78.28,
    69.72, 71.61, 74.35, 61.60, 69.89, 75.09, 63.59, 46.42, 66.81, 63.38,
];
const FIRST_NM: f64 = 380.0;
const STEP_NM: f64 = 10.0;

/// Wavelengths [nm] of the spectra that exports write.
pub(crate) const WRITTEN_NM: [f64; 16] =
    [400.0, 420.0, 440.0, 460.0, 480.0, 500.0, 520.0, 540.0, 560.0, 580.0, 600.0, 620.0, 640.0, 660.0, 680.0, 700.0];
/// Limits between the bands of blue, green and red, and the width of the transitions [nm].
const BLUE_GREEN: f64 = 490.0;
const GREEN_RED: f64 = 585.0;
const TRANSITION_WIDTH: f64 = 30.0;

/// Colour matching functions of the CIE 1931 observer, as sums of Gaussians with two widths each (Wyman et al. 2013).
fn observer(nm: f64) -> DVec3 {
    let lobe = |height: f64, middle: f64, below: f64, above: f64| {
        let t = (nm - middle) / if nm < middle { below } else { above };
        height * (-0.5 * t * t).exp()
    };
    DVec3::new(
        lobe(1.056, 599.8, 37.9, 31.0) + lobe(0.362, 442.0, 16.0, 26.7) + lobe(-0.065, 501.1, 20.4, 26.2),
        lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1),
        lobe(1.217, 437.0, 11.8, 36.0) + lobe(0.681, 459.0, 26.0, 13.8),
    )
}

fn daylight(nm: f64) -> f64 {
    let at = ((nm - FIRST_NM) / STEP_NM).clamp(0.0, (D65.len() - 1) as f64);
    let lower = (at as usize).min(D65.len() - 2);
    D65[lower] + (D65[lower + 1] - D65[lower]) * (at - lower as f64)
}

/// Weights of increasing wavelengths [nm]: `rgb = Σ weight · reflectance`. A reflectance of 1 gives white. The spectrum
/// is linear between the wavelengths and constant beyond them.
pub(crate) fn rgb_weights(wavelengths: &[f64]) -> Vec<DVec3> {
    let mut weights = vec![DVec3::ZERO; wavelengths.len()];
    let rgb_of_xyz = DMat3::from_cols(
        DVec3::new(3.240_969_9, -0.969_243_6, 0.055_630_1),
        DVec3::new(-1.537_383_2, 1.875_967_5, -0.203_977),
        DVec3::new(-0.498_610_8, 0.041_555_1, 1.056_971_5),
    );
    for nm in 380..=780 {
        let nm = f64::from(nm);
        let power = rgb_of_xyz * (daylight(nm) * observer(nm));
        let upper = wavelengths.partition_point(|&at| at <= nm);
        match (upper.checked_sub(1).and_then(|k| wavelengths.get(k)), wavelengths.get(upper)) {
            (Some(low), Some(high)) => {
                let part = (nm - low) / (high - low);
                weights[upper - 1] += power * (1.0 - part);
                weights[upper] += power * part;
            }
            (Some(_), None) => weights[upper - 1] += power,
            (None, Some(_)) => weights[0] += power,
            (None, None) => {}
        }
    }
    let white: DVec3 = weights.iter().sum();
    weights.iter_mut().for_each(|weight| *weight /= white);
    weights
}

/// Spectra at [`WRITTEN_NM`] of the primaries R, G and B. They are mixtures of three bands that add up to 1, and
/// converting them to RGB gives the primaries again. Strongly saturated colours have slightly negative values at some
/// wavelengths.
pub(crate) fn spectra_of_primaries() -> [DVec3; WRITTEN_NM.len()] {
    let rise = |nm: f64, middle: f64| {
        let t = ((nm - middle) / TRANSITION_WIDTH + 0.5).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    };
    let bands = WRITTEN_NM.map(|nm| {
        let (past_blue, red) = (rise(nm, BLUE_GREEN), rise(nm, GREEN_RED));
        DVec3::new(red, past_blue - red, 1.0 - past_blue)
    });
    let mut mixed = DMat3::ZERO;
    for (weight, band) in rgb_weights(&WRITTEN_NM).iter().zip(bands) {
        mixed += DMat3::from_cols(*weight * band.x, *weight * band.y, *weight * band.z);
    }
    // One row of the inverse per band: the weights of the primaries in the band.
    let unmixed = mixed.inverse().transpose();
    bands.map(|band| unmixed * band)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_stays_white_and_colours_survive_the_conversion_to_a_spectrum_and_back() {
        let weights = rgb_weights(&WRITTEN_NM);
        let primaries = spectra_of_primaries();
        for rgb in [DVec3::ONE, DVec3::new(0.8, 0.4, 0.2), DVec3::new(0.1, 0.3, 0.5)] {
            let spectrum: Vec<f64> = primaries.iter().map(|primary| primary.dot(rgb)).collect();
            assert!(spectrum.iter().all(|&value| (-0.02..1.02).contains(&value)), "{spectrum:?}");
            let back: DVec3 = weights.iter().zip(&spectrum).map(|(weight, value)| *weight * *value).sum();
            assert!((back - rgb).abs().max_element() < 1e-9, "{back} {rgb}");
        }
        assert!(primaries.iter().all(|primary| (primary.element_sum() - 1.0).abs() < 1e-9));
    }

    #[test]
    fn finer_wavelengths_give_the_same_colours() {
        let rising = |wavelengths: &[f64]| -> DVec3 {
            rgb_weights(wavelengths).iter().zip(wavelengths).map(|(weight, nm)| *weight * ((nm - 380.0) / 400.0)).sum()
        };
        let fine: Vec<f64> = (0..101).map(|k| 380.0 + 4.0 * f64::from(k)).collect();
        let coarse: Vec<f64> = (0..21).map(|k| 380.0 + 20.0 * f64::from(k)).collect();
        assert!((rising(&fine) - rising(&coarse)).abs().max_element() < 1e-6);
        // A spectrum that rises with the wavelength is reddish.
        let color = rising(&fine);
        assert!(color.x > color.y && color.y > color.z, "{color}");
    }
}
