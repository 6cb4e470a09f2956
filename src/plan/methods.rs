//! Decisions on methods: ways to compute the same result in less time.

use super::context::Context;
use super::effects::{Decision, ROUNDING, SAME_NORMALS};
use super::{IMAGE_CHECK_PAIRS, Preset, ProductMethod, is_on};
use crate::scene::Switch;

pub(super) fn low_rank(context: &Context<'_>, _: Switch) -> Decision {
    let Context { settings, costs, try_low_rank: on, .. } = *context;
    let comparison = format!(
        "a 384x384 image with 32 lights is predicted at {:.0} ms summed directly, {:.0} ms factored",
        context.direct_image_ms(costs.threads),
        context.low_rank_image_ms(costs.threads)
    );
    let reason = match settings.method {
        _ if settings.preset == Preset::Wu2011 => "as in the paper: a basis for each BRDF".to_owned(),
        ProductMethod::Auto if on => format!(
            "{comparison}; used if within {:.1} % and {:.0} dB of the direct sum",
            settings.tolerance * 100.0,
            settings.tolerance_db
        ),
        ProductMethod::Auto => comparison,
        _ => "asked for by quality.method".to_owned(),
    };
    Decision::new(on, reason).costs(context.factorization_ms())
}

pub(super) fn shading_table(context: &Context<'_>, _: Switch) -> Decision {
    let Context { features, settings, costs, try_shading_table: on, .. } = *context;
    let strided_subset = context.has_horizon_map() && features.distinct_normals.is_some();
    let cost = context.table_cost();
    // A strided subset of the facets takes no more time than its check.
    let predicted_ms = if strided_subset {
        IMAGE_CHECK_PAIRS as f64 * context.direct_query_ms()
    } else {
        cost.as_ref().map_or(0.0, |cost| cost.compute_ms)
    };
    let reason = match cost {
        _ if features.flat => "a flat tile is its own BRDF".to_owned(),
        None => "images evaluate the BRDF itself at this quality".to_owned(),
        Some(cost) => {
            let (percent, db) = (settings.image_tolerance.0 * 100.0, settings.image_tolerance.1);
            let condition = format!("if within {percent:.0} % and {db:.0} dB of the sum");
            let direct = format!(
                "a 384x384 image with 32 lights is predicted at {:.0} ms summed directly",
                context.direct_image_ms(costs.threads)
            );
            if strided_subset {
                format!("{direct}; few distinct normals: a strided subset of the facets is summed {condition}")
            } else {
                format!(
                    "{direct}, {:.0} ms from a table that takes {:.0} ms, once; used {condition}",
                    cost.image_ms, cost.compute_ms
                )
            }
        }
    };
    Decision::new(on, reason).costs(if on { predicted_ms } else { 0.0 })
}

pub(super) fn exact_lobes(context: &Context<'_>, switch: Switch) -> Decision {
    if context.settings.preset == Preset::Wu2011 {
        return Decision::new(false, "as in the paper: a lobe for each direction of a grid");
    }
    let normals = context.features.distinct_normals;
    let reason = match normals {
        Some(1) => "one normal: one exact lobe, for any number of facets".to_owned(),
        Some(count) => format!("{count} distinct normals: one exact lobe each, for any number of facets"),
        None => "normals differ from facet to facet".to_owned(),
    };
    Decision::new(is_on(switch, normals.is_some()), reason).changes_at_most(SAME_NORMALS)
}

/// Mirror planes are searched for only when a table is computed, so that a geometry edit does not wait for them.
pub(super) fn mirror_symmetry(context: &Context<'_>, switch: Switch) -> Decision {
    let is_tabulated = context.interreflection || context.try_shading_table;
    let planes = context.mirrors();
    let is_known = switch == Switch::On || context.features.mirrors.is_some();
    let on = is_tabulated && switch != Switch::Off && (!is_known || planes != [false; 2]);
    let reason = match planes {
        _ if !is_tabulated => "no table is computed",
        _ if switch == Switch::Off => "treated as having no mirror planes, as asked",
        _ if !is_known => {
            "if planes x = const or y = const mirror the tile, the shading table takes a half or a quarter of the time"
        }
        [true, true] => "mirrored in planes x = const and y = const: a quarter of the viewers is enough",
        [false, false] => "no plane x = const or y = const mirrors the tile",
        _ => "mirrored in one plane: half of the viewers is enough",
    };
    let decision = Decision::new(on, reason);
    if context.interreflection { decision } else { decision.changes_at_most(ROUNDING) }
}
