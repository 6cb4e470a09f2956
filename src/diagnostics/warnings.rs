//! What is wrong, in words that say what to do. Each threshold stands here with its reason.

use super::{Health, Limits};

/// Part of a measured file's samples that may be left out: below, what was interpolated in their place is a matter of single
/// bins. (MERL's own files mark nothing; exports of other programs mark the bins under the horizon, 20 %.)
const MAX_REJECTED: f64 = 0.25;
/// Half a percent is what quadrature and rounding leave; pbrt's own test of energy allows 1 %.
const MAX_ALBEDO: f32 = 1.01;
/// The effective albedo is summed on a coarser grid, of interpolated visibility: measured 1.00 to 1.03 on white tiles.
const MAX_EFFECTIVE_ALBEDO: f32 = 1.06;
/// A systematic sample of 2,048 facets leaves 1 to 5 % up to 80° on the shipped tiles; a tenth is seen in pictures.
const MAX_AREA_ERROR: f64 = 0.15;
/// With fewer facets in sight the noise (one over the root of their number) is above 20 %.
const MIN_IN_SIGHT: usize = 24;
/// With fewer facets inside a lobe single facets show as sparkles: noise above 40 %.
const MIN_IN_A_LOBE: usize = 6;
/// A narrowest lobe `w` read linearly from a grid of step `s` loses `(s/w)²/4` of its peak: above 0.63 a tenth and more.
const WIDEST_STEP: f32 = 0.63;
/// Averaging `f(i,o)` and `f(o,i)` changes the material visibly above this.
const MAX_ASYMMETRY: f32 = 0.2;
/// A result is reciprocal by construction: what is left is rounding of f32 sums.
const MAX_RESIDUAL: f64 = 1e-3;
/// Of the walks for horizons: what a few leave out is lost in the penumbra.
const MAX_CUT_SHORT: f64 = 0.02;
/// Part of the area that may be in no one's sight: weaves hide 70 %, and facets spent there are missing elsewhere.
const MAX_UNSEEN: f64 = 0.9;

pub fn of(health: &Health, limits: Limits, conserving: bool) -> Vec<String> {
    let mut words = Vec::new();
    inputs(health, &mut words);
    surface(health, &mut words);
    result(health, limits, conserving, &mut words);
    words
}

fn percent(part: f64) -> String {
    if part < 0.01 { format!("{:.2} %", part * 100.0) } else { format!("{:.0} %", part * 100.0) }
}

fn inputs(health: &Health, words: &mut Vec<String>) {
    for table in &health.measured {
        if table.samples > 0 && table.rejected == table.samples {
            words.push(format!("`{}` holds no valid sample and is black: is it the right file?", table.name));
        } else if table.rejected as f64 > MAX_REJECTED * table.samples as f64 {
            let part = percent(table.rejected as f64 / table.samples as f64);
            words.push(format!(
                "{part} of the samples of `{}` are negative, NaN, infinite or missing; what surrounds them stands in: \
                 measure again, or use an analytic BRDF",
                table.name
            ));
        }
        if table.reciprocity_residual > MAX_ASYMMETRY {
            words.push(format!(
                "`{}` changes by {} when light and viewer are swapped; the mean of both is used",
                table.name,
                percent(f64::from(table.reciprocity_residual))
            ));
        }
    }
    for material in health.materials.iter().filter(|material| material.largest_albedo > MAX_ALBEDO) {
        words.push(format!(
            "material `{}` sends back up to {:.3} times the light it gets: lower its colour, specular or albedo below {:.3} \
             of what it is to conserve energy",
            material.name,
            material.largest_albedo,
            1.0 / material.largest_albedo
        ));
    }
}

fn surface(health: &Health, words: &mut Vec<String>) {
    let surface = &health.surface;
    if surface.facets == 0 && surface.fewest_facets_seen == 0 {
        words.push("the tile has no area: nothing reflects; check the mesh".to_owned());
        return;
    }
    if surface.fewest_facets_seen < MIN_IN_SIGHT {
        let [theta, phi] = surface.fewest_seen_from_deg;
        words.push(format!(
            "from theta {theta:.0}°, phi {phi:.0}° only {} of {} facets are in sight, so values there are noisy: raise \
             quality.facets, take a finer preset, or make the tile less deep",
            surface.fewest_facets_seen, surface.facets
        ));
    }
    if surface.area_never_seen > MAX_UNSEEN {
        words.push(format!(
            "{} of the surface is seen from nowhere above: remove what is hidden, or raise quality.facets",
            percent(surface.area_never_seen)
        ));
    }
    if surface.walks_cut_short > MAX_CUT_SHORT {
        words.push(format!(
            "the tile is so deep or so dense that {} of the walks for its horizons were cut short: shadows from far away \
             may be missing low over the horizon",
            percent(surface.walks_cut_short)
        ));
    }
    if surface.facets_in_a_lobe.is_some_and(|count| count < MIN_IN_A_LOBE) {
        words.push(format!(
            "the narrowest lobe ({}) meets only {} of {} facets at a time, so highlights sparkle: raise quality.facets or \
             the roughness",
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

fn result(health: &Health, limits: Limits, conserving: bool, words: &mut Vec<String>) {
    let result = &health.result;
    if result.unsound_values > 0 {
        words.push(format!(
            "{} of the values examined are negative or not finite: a fault of this program, please report the scene",
            result.unsound_values
        ));
    }
    if let Some(error) = result.projected_area_error.filter(|error| *error > MAX_AREA_ERROR) {
        let [theta, phi] = result.worst_angle_deg;
        words.push(format!(
            "the facets' projected area is {} off at theta {theta:.0}°, phi {phi:.0}°: raise quality.facets or take a finer \
             preset",
            percent(error)
        ));
    }
    if let Some(albedo) = result.largest_albedo.filter(|albedo| conserving && *albedo > MAX_EFFECTIVE_ALBEDO) {
        let [theta, phi] = result.largest_albedo_at_deg;
        words.push(format!(
            "the result sends back {albedo:.3} times the light at theta {theta:.0}°, phi {phi:.0}° although its materials \
             conserve energy: take a finer preset or quality.method = \"direct\""
        ));
    }
    if result.reciprocity_residual > MAX_RESIDUAL {
        words.push(format!("light and viewer do not swap: {} (relative L2)", percent(result.reciprocity_residual)));
    }
    let Some(factors) = health.factorization.as_ref().filter(|factors| factors.used) else { return };
    if let Some(error) = factors.relative_error.filter(|error| *error > limits.tolerance) {
        words.push(format!(
            "the factored form was asked for and is {} from the direct sum: set quality.method to auto or direct, or raise \
             quality.keep_m, keep_n and grid",
            percent(error)
        ));
    }
    let step = factors.lobe_grid_step_deg;
    let narrowest = health.materials.iter().filter_map(|material| material.narrowest_lobe_deg).reduce(f32::min);
    if let Some(lobe) = narrowest.filter(|lobe| step > WIDEST_STEP * lobe) {
        words.push(format!(
            "the narrowest lobe ({}) is narrower than its table's step of {step:.1}° resolves, so highlights lose {} of their \
             peak: take a finer preset, quality.method = \"direct\", or more roughness",
            lobe_name(health),
            percent(f64::from((step / lobe).powi(2) / 4.0).min(1.0))
        ));
    }
}
