//! The health of a slab.

use super::Health;
use crate::slab::{Method, Slab};

/// Figures from which the health of a slab is judged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlabHealthInputs {
    /// Relative L2 of Eq. 11 against Eq. 1, and its bound.
    pub dual_error: f64,
    pub bound: f64,
    /// Height of the deepest relief of a face [tile units].
    pub relief: f64,
}

/// Largest part of the light that masking may remove.
const MAX_MASKED: f64 = 0.05;
/// Largest diffuse part.
const MAX_DIFFUSE: f64 = 0.3;
/// Largest part of the slopes in the outermost cells of a table.
const MAX_OUTSIDE: f64 = 0.01;
/// Smallest deviation of slopes, in cells of their table.
const LEAST_CELLS: f64 = 2.0;
/// Largest relief over thickness.
const MAX_RELIEF: f64 = 0.1;

impl Health {
    /// The health of a slab: only its warnings are measured.
    pub fn of_slab(slab: &Slab, inputs: &SlabHealthInputs) -> Self {
        let mut warnings = Vec::new();
        let percent = |part: f64| 100.0 * part;
        if slab.method == Method::Dual && inputs.dual_error > inputs.bound {
            warnings.push(format!(
                "the dual-microfacet model is {:.1} % from the sum over facets (bound: {:.0} %): set slab.method = \"faces\"",
                percent(inputs.dual_error),
                percent(inputs.bound)
            ));
        }
        let masked = slab.inner.as_ref().map_or(0.0, |inner| inner.largest_masked());
        if masked > MAX_MASKED && slab.optics.eta != glam::DVec3::ONE {
            warnings.push(format!(
                "masking removes up to {:.0} % of the light below 75°, and half of it is added evenly to each side: compare \
                 with explicit tiles, or lower the roughness",
                percent(masked)
            ));
        }
        for (side, face) in [("top", &slab.top), ("bottom", &slab.bottom)] {
            let (deviation, cell) = (face.deviation(), face.resolution());
            let cells = deviation / cell;
            if !face.is_smooth() && cells < LEAST_CELLS {
                warnings.push(format!(
                    "the slopes of slab.{side} spread over {cells:.1} cells of their table: the lobe is wider than it should \
                     be; use a finer table or `--quality fine`"
                ));
            }
            let outside = face.at_edge();
            if outside > MAX_OUTSIDE {
                warnings.push(format!(
                    "{:.1} % of the slopes of slab.{side} lie in the outermost cells of their table: raise its span",
                    percent(outside)
                ));
            }
        }
        let diffuse = slab.optics.diffuse.max_element();
        if diffuse > MAX_DIFFUSE {
            warnings.push(format!(
                "{:.0} % of the light leaves with constant radiance: a slab describes scattering inside only roughly; lower slab.diffuse",
                percent(diffuse)
            ));
        }
        let thickness = slab.optics.thickness;
        if thickness > 0.0 && inputs.relief > MAX_RELIEF * thickness {
            warnings.push(format!(
                "the relief of a face is {:.2} times as deep as the slab is thick: light may cross both faces at one place; \
                 raise slab.thickness or make the relief shallower",
                inputs.relief / thickness
            ));
        }
        Self { warnings, ..Self::default() }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DVec2, DVec3};

    use super::*;
    use crate::slab::{Ndf, Optics, Profile};

    #[test]
    fn a_sound_slab_has_no_warning_and_each_weakness_has_one_with_a_remedy() {
        let face = Arc::new(Ndf::analytic(Profile::Beckmann, DVec2::splat(0.2), 0.0));
        let slab = Slab::new(face.clone(), face, Optics::default(), 256);
        let sound = SlabHealthInputs { dual_error: 0.01, bound: 0.05, relief: 0.0 };
        assert_eq!(Health::of_slab(&slab, &sound).warnings, [""; 0]);
        let warnings = Health::of_slab(&slab, &SlabHealthInputs { dual_error: 0.2, ..sound }).warnings;
        assert!(warnings.len() == 1 && warnings[0].contains("20.0 %") && warnings[0].contains("faces"), "{warnings:?}");
        let optics = Optics { diffuse: DVec3::splat(0.5), thickness: 0.1, ..slab.optics };
        let warnings = Health::of_slab(&Slab { optics, ..slab }, &SlabHealthInputs { relief: 0.05, ..sound }).warnings;
        assert_eq!(warnings.len(), 2, "{warnings:?}");
        let narrow = Ndf::of_facets(&[(DVec2::new(0.01, 0.0), 1.0), (DVec2::new(-0.01, 0.0), 1.0)], 64).unwrap();
        assert!(narrow.resolution() < 0.01);
    }
}
