//! Warnings about a result, each with a remedy, and their thresholds with the reasons.

use super::{Health, Limits};
use crate::effective::ErrorEstimate;

/// Largest part of invalid samples of a measured file. Below it, only single bins are interpolated. The files of the
/// MERL database mark no samples as missing; other programs mark the bins below the horizon, which are 20 %.
const MAX_REJECTED: f64 = 0.25;
/// Largest albedo of a material. Quadrature and rounding cause half a percent; the energy test of pbrt allows 1 %.
const MAX_ALBEDO: f32 = 1.01;
/// Largest albedo of the effective BRDF. It is summed over a coarser grid with interpolated visibility, so white tiles
/// give 1.00 to 1.03.
const MAX_EFFECTIVE_ALBEDO: f32 = 1.06;
/// Largest error of the projected area. Systematic samples of 2,048 facets have 1 to 5 % up to 80° on the shipped
/// tiles; 10 % is visible in images.
const MAX_AREA_ERROR: f64 = 0.15;
/// Fewest visible facets. With fewer, the noise (one over the root of their number) exceeds 20 %.
const MIN_VISIBLE: usize = 24;
/// Fewest facets inside a lobe. With fewer, the noise exceeds 40 % and single facets are visible as sparkles.
const MIN_IN_A_LOBE: usize = 6;
/// Largest step of the grid of lobes, in half widths of the narrowest lobe. Linear interpolation with step `s` lowers
/// the peak of a lobe of half width `w` by `(s/w)²/4`, which is a tenth at 0.63.
const MAX_STEP: f32 = 0.63;
/// Largest difference of `f(i,o)` and `f(o,i)` (relative L2). Above it, averaging both changes the material visibly.
const MAX_ASYMMETRY: f32 = 0.2;
/// Largest reciprocity residual. Results are reciprocal by construction, up to the rounding of f32 sums.
const MAX_RESIDUAL: f64 = 1e-3;
/// Largest part of searches for horizons that end at their step limit. The error of fewer is hidden by the transition
/// width.
const MAX_TRUNCATED: f64 = 0.02;
/// Largest part of the area that is visible from nowhere. Weaves hide 70 %. Facets in hidden parts are missing
/// elsewhere.
const MAX_HIDDEN: f64 = 0.9;

/// All warnings about a result. `conserving` is true if no material creates energy.
pub fn of(health: &Health, limits: Limits, conserving: bool) -> Vec<String> {
    let mut warnings = Vec::new();
    inputs(health, &mut warnings);
    surface(health, &mut warnings);
    result(health, limits, conserving, &mut warnings);
    warnings
}

/// A warning if the stated error exceeds what the preset allows.
pub fn of_error(estimate: &ErrorEstimate, limits: Limits) -> Option<String> {
    let bound = limits.error.filter(|bound| estimate.exceeds(*bound))?;
    let decibels = |psnr: Option<f64>| psnr.map_or_else(String::new, |psnr| format!(", {psnr:.1} dB"));
    let ErrorEstimate { facets, visibility, table, .. } = *estimate;
    let remedy = if table > facets.max(visibility) {
        "set quality.method to auto or direct"
    } else if facets > visibility {
        "raise quality.max_facets, use a finer preset, or raise roughness"
    } else {
        "use a finer preset, or make the tile shallower"
    };
    Some(format!(
        "the stated error is {}{}, and `{}` allows {}{}: {remedy}",
        percent(estimate.rel_l2),
        decibels(estimate.psnr_db),
        limits.preset,
        percent(bound.rel_l2),
        decibels(bound.psnr_db)
    ))
}

fn percent(part: f64) -> String {
    if part < 0.01 { format!("{:.2} %", part * 100.0) } else { format!("{:.0} %", part * 100.0) }
}

/// A factor with three decimals, or with an exponent if they do not show it.
fn factor(factor: f32) -> String {
    if (0.1..1e4).contains(&factor) { format!("{factor:.3}") } else { format!("{factor:.2e}") }
}

fn inputs(health: &Health, warnings: &mut Vec<String>) {
    for table in &health.measured {
        if table.samples > 0 && table.rejected == table.samples {
            warnings
                .push(format!("`{}` holds no valid sample and is black: check that it is the right file", table.name));
        } else if table.rejected as f64 > MAX_REJECTED * table.samples as f64 {
            let part = percent(table.rejected as f64 / table.samples as f64);
            warnings.push(format!(
                "{part} of the samples of `{}` are negative, NaN, infinite or missing and are interpolated: measure \
                 the material again, or use an analytic BRDF",
                table.name
            ));
        }
        if table.reciprocity_residual > MAX_ASYMMETRY {
            warnings.push(format!(
                "`{}` changes by {} when light and viewer are swapped, and the mean of both is used: take another file if there is one",
                table.name,
                percent(f64::from(table.reciprocity_residual))
            ));
        }
    }
    for material in health.materials.iter().filter(|material| material.largest_albedo > MAX_ALBEDO) {
        let (under, or_image) = if health.surface.largest_color_weight > 1.0 {
            (" under the brightest texel of the colour image", ", or the image,")
        } else {
            ("", "")
        };
        warnings.push(format!(
            "material `{}` reflects up to {} times the light that it receives{under}: to conserve energy, multiply its \
             colour, specular or albedo{or_image} by less than {}",
            material.name,
            factor(material.largest_albedo),
            factor(1.0 / material.largest_albedo)
        ));
    }
}

fn surface(health: &Health, warnings: &mut Vec<String>) {
    let surface = &health.surface;
    if surface.facets == 0 && surface.fewest_visible_facets == 0 {
        warnings.push("the tile has no area and reflects nothing: check the mesh".to_owned());
        return;
    }
    if surface.fewest_visible_facets < MIN_VISIBLE && !surface.is_exact {
        let [theta, phi] = surface.fewest_visible_at_deg;
        warnings.push(format!(
            "only {} of {} facets are visible from theta {theta:.0}°, phi {phi:.0}°, so values there are noisy: raise \
             quality.facets, use a finer preset, or make the tile shallower",
            surface.fewest_visible_facets, surface.facets
        ));
    }
    if surface.area_never_visible > MAX_HIDDEN {
        warnings.push(format!(
            "{} of the surface is visible from nowhere above: remove hidden parts, or raise quality.facets",
            percent(surface.area_never_visible)
        ));
    }
    if surface.truncated_searches > MAX_TRUNCATED {
        warnings.push(format!(
            "{} of the searches for horizons end at their step limit, so shadows from far away may be missing low \
             over the horizon: make the tile shallower or less dense",
            percent(surface.truncated_searches)
        ));
    }
    if surface.facets_in_a_lobe.is_some_and(|count| count < MIN_IN_A_LOBE) && !surface.is_exact {
        warnings.push(format!(
            "the narrowest lobe ({}) contains only {} of {} facets at a time, so highlights sparkle: raise \
             quality.facets or the roughness",
            lobe_name(health),
            surface.facets_in_a_lobe.unwrap_or(0),
            surface.facets
        ));
    }
}

fn lobe_name(health: &Health) -> String {
    let narrow = health.materials.iter().filter_map(|material| Some((material.narrowest_lobe_deg?, &material.name)));
    narrow
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or_else(String::new, |(degrees, name)| format!("{degrees:.2}° of material `{name}`"))
}

fn result(health: &Health, limits: Limits, conserving: bool, warnings: &mut Vec<String>) {
    let result = &health.result;
    if result.unsound_values > 0 {
        warnings.push(format!(
            "{} of the examined values are negative or not finite: this is a fault of the program, please report the \
             scene",
            result.unsound_values
        ));
    }
    if let Some(error) = result.projected_area_error.filter(|error| *error > MAX_AREA_ERROR) {
        let [theta, phi] = result.worst_angle_deg;
        warnings.push(format!(
            "the projected area of the facets has an error of {} at theta {theta:.0}°, phi {phi:.0}°: raise \
             quality.facets or use a finer preset",
            percent(error)
        ));
    }
    if let Some(albedo) = result.largest_albedo.filter(|albedo| conserving && *albedo > MAX_EFFECTIVE_ALBEDO) {
        let [theta, phi] = result.largest_albedo_at_deg;
        warnings.push(format!(
            "the result reflects {albedo:.3} times the light at theta {theta:.0}°, phi {phi:.0}° although its \
             materials conserve energy: use a finer preset or quality.method = \"direct\""
        ));
    }
    if result.reciprocity_residual > MAX_RESIDUAL {
        warnings.push(format!(
            "swapping light and viewer changes the result by {} (relative L2): please report the scene",
            percent(result.reciprocity_residual)
        ));
    }
    let Some(factors) = health.factorization.as_ref().filter(|factors| factors.used) else { return };
    if let Some(error) = factors.relative_error.filter(|error| *error > limits.tolerance) {
        warnings.push(format!(
            "the low-rank factors that were asked for differ by {} from the direct sum: set quality.method to auto or \
             direct, or raise quality.keep_m, keep_n and grid",
            percent(error)
        ));
    }
    let step = factors.lobe_grid_step_deg;
    let narrowest = health.materials.iter().filter_map(|material| material.narrowest_lobe_deg).reduce(f32::min);
    if let Some(lobe) = narrowest.filter(|lobe| step > MAX_STEP * lobe) {
        warnings.push(format!(
            "the grid step of {step:.1}° does not resolve the narrowest lobe ({}), so highlights lose {} of their \
             peak: use a finer preset, quality.method = \"direct\", or more roughness",
            lobe_name(health),
            percent(f64::from((step / lobe).powi(2) / 4.0).min(1.0))
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_far_from_1_keep_their_digits() {
        for (value, text) in [(0.5468, "0.547"), (1.829, "1.829"), (5.468e-4, "5.47e-4"), (1e9, "1.00e9")] {
            assert_eq!(factor(value), text);
        }
    }
}
