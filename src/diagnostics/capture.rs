//! The health of a captured sheet.

use super::Health;
use crate::slab::capture::sheet::Figures;

/// Fewest dots across a lobe.
const LEAST_DOTS: f64 = 3.0;
/// Largest skewness of the distribution that one camera may find, and the largest part of slopes in the outer fifth.
const MAX_SKEWNESS: f64 = 0.1;
const MAX_OUTSIDE: f64 = 0.01;
/// Largest diffuse part of the light.
const MAX_DIFFUSE: f64 = 0.3;
/// Largest relative L2 of the model against the photographs.
const MAX_RESIDUAL: f64 = 0.5;
/// Largest part of broken values, and of pixels without a lobe.
const MAX_BROKEN: f64 = 0.05;

impl Health {
    /// The health of a capture: only its warnings are measured.
    pub fn of_capture(figures: &Figures) -> Self {
        let mut warnings = Vec::new();
        if figures.dark > MAX_BROKEN {
            warnings.push(format!(
                "{:.0} % of the pixels show no lobe: raise the exposure, or move the dots to where light passes straight",
                100.0 * figures.dark
            ));
        }
        if figures.median_residual > MAX_RESIDUAL {
            warnings.push(format!(
                "the model differs from the photographs by {:.0} %, so that the captured sheet is unusable: check the lengths (in \
                 metres), directions and exposures of rig.toml",
                100.0 * figures.median_residual
            ));
        }
        if figures.broken > MAX_BROKEN {
            warnings.push(format!(
                "{:.0} % of the values are saturated or not a number and are ignored: add a shorter exposure",
                100.0 * figures.broken
            ));
        }
        if figures.dots_across > 0.0 && figures.dots_across < LEAST_DOTS {
            warnings.push(format!(
                "the lobe is {:.1} dots wide, fewer than three: show denser dots, or move the monitor away",
                figures.dots_across
            ));
        }
        if figures.cameras == 1 && (figures.skewness > MAX_SKEWNESS || figures.outside > MAX_OUTSIDE) {
            warnings.push(format!(
                "the distribution of slopes is skewed by {:.0} % and {:.1} % of it lies in its outer fifth: one camera cannot \
                 tell alpha from skewness; photograph the sheet from a second direction, or give --alpha",
                100.0 * figures.skewness,
                100.0 * figures.outside
            ));
        }
        if !figures.shadowing_is_determined && figures.representatives > 0 {
            warnings.push(format!(
                "the photographs do not determine the roughness of masking (alpha_b): {} is kept",
                figures.shadowing
            ));
        }
        if figures.diffuse > MAX_DIFFUSE {
            warnings.push(format!(
                "{:.0} % of the light leaves with constant radiance: a slab describes scattering inside only roughly",
                100.0 * figures.diffuse
            ));
        }
        Self { warnings, ..Self::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sound_capture_has_no_warning_and_each_weakness_has_one_with_its_number() {
        let sound = Figures {
            cameras: 1,
            representatives: 40,
            dots_across: 8.0,
            shadowing: 0.2,
            shadowing_is_determined: true,
            ..Figures::default()
        };
        assert_eq!(Health::of_capture(&sound).warnings, [""; 0]);
        let cases = [
            (Figures { dots_across: 2.0, ..sound.clone() }, "2.0 dots wide"),
            (Figures { skewness: 0.4, ..sound.clone() }, "skewed by 40 %"),
            (Figures { outside: 0.05, ..sound.clone() }, "5.0 %"),
            (Figures { shadowing_is_determined: false, ..sound.clone() }, "0.2 is kept"),
            (Figures { diffuse: 0.5, ..sound.clone() }, "50 %"),
            (Figures { broken: 0.2, ..sound.clone() }, "20 %"),
            (Figures { dark: 1.0, ..sound.clone() }, "100 %"),
            (Figures { median_residual: 0.99, ..sound.clone() }, "99 %"),
        ];
        for (figures, part) in cases {
            let warnings = Health::of_capture(&figures).warnings;
            assert!(warnings.len() == 1 && warnings[0].contains(part), "{warnings:?}");
        }
        assert!(Health::of_capture(&Figures { cameras: 2, skewness: 0.4, ..sound }).warnings.is_empty());
    }
}
