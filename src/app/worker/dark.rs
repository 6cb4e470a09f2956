//! A hint for surfaces that reflect hardly any light, with the cause.

use crate::diagnostics::Health;
use crate::plan::Effect;

/// Mean reflectance below which a surface looks black.
const DARK: f32 = 0.01;
/// Largest albedo of the materials below which they are the cause.
const DARK_MATERIAL: f32 = 0.05;
/// Part of the area that is visible from nowhere, above which it is the cause.
const HIDDEN: f64 = 0.5;

/// The hint, if the surface reflects less than 1 % of the light.
pub fn hint(health: &Health, effects: &[Effect]) -> Option<String> {
    let mean = health.result.mean_albedo.filter(|mean| *mean < DARK)?;
    let material = health.materials.iter().map(|material| material.largest_albedo).fold(0.0, f32::max);
    let hidden = health.surface.area_never_visible;
    let left_out = effects.iter().any(|effect| effect.name == "interreflection" && effect.left_out.is_some());
    let cause = if material < DARK_MATERIAL {
        format!("its materials are dark, the brightest reflects {:.1} %. Make a material brighter", 100.0 * material)
    } else if left_out {
        "light that its parts reflect onto each other is left out. Add interreflection".to_owned()
    } else if hidden > HIDDEN {
        format!("{:.0} % of its area is visible from nowhere. Make the relief shallower", 100.0 * hidden)
    } else {
        "its parts shadow each other, or reflect the light away. Make the relief shallower or rougher".to_owned()
    };
    Some(format!("the surface reflects {:.2} % of the light, because {cause}", 100.0 * mean))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnostics::MaterialHealth;

    #[test]
    fn a_black_surface_states_its_cause_and_a_grey_one_none() {
        let mut health = Health::default();
        let mut hint_of = |mean: f32, albedo: f32, hidden: f64| {
            health.result.mean_albedo = Some(mean);
            health.materials = vec![MaterialHealth { largest_albedo: albedo, ..MaterialHealth::default() }];
            health.surface.area_never_visible = hidden;
            hint(&health, &[])
        };
        assert_eq!(hint_of(0.2, 0.01, 0.9), None);
        assert!(
            hint_of(0.004, 0.01, 0.9).unwrap().contains("reflects 0.40 % of the light, because its materials are dark")
        );
        assert!(hint_of(0.004, 0.9, 0.9).unwrap().contains("90 % of its area"));
        assert!(hint_of(0.004, 0.9, 0.1).unwrap().contains("shadow each other"));
        assert_eq!(hint(&Health::default(), &[]), None);
    }
}
