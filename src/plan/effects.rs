//! The decisions: every effect on or off, with a reason a person can read.

use serde::Serialize;

use super::{Costs, Method, Preset, SceneFeatures, Settings, VisibilityAlgorithm, VisibilityMethod, decisions};

/// One effect of the plan, as `biscale plan --json` prints it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    pub name: &'static str,
    pub on: bool,
    pub reason: String,
    pub predicted_ms: f64,
    /// `None` until the stage has run.
    pub measured_ms: Option<f64>,
    /// Did a person force it?
    pub forced: bool,
    /// Where it is off by itself: the relative L2 of `f̄` that turning it on changes at most.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound: Option<f64>,
}

/// Queries of the picture that the cost model has in mind: 384x384, 32 lights, a third of them lit and covered.
pub(super) const IMAGE_QUERIES: f64 = 384.0 * 384.0 * 32.0 / 3.0;

/// Pairs of directions on which what pictures read is held against the BRDF.
pub const IMAGE_CHECK_PAIRS: usize = 512;

/// What will be done.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    pub route: VisibilityAlgorithm,
    /// Try the factored form first; it must pass its check against the direct sum.
    pub try_low_rank: bool,
    /// Add light that facets send to each other.
    pub interreflection: bool,
    /// Mirror planes that spare the other half of the directions.
    pub mirrors: [bool; 2],
    /// Try a table for pictures first; it must pass its check against the BRDF.
    pub try_shading_table: bool,
    pub effects: Vec<Effect>,
}

impl Plan {
    /// Does the route look for more than one horizon an azimuth?
    pub fn overhangs(&self) -> bool {
        matches!(
            self.route,
            VisibilityAlgorithm::OcclusionIntervals | VisibilityAlgorithm::CpuMaps | VisibilityAlgorithm::GpuMaps
        )
    }

    /// Is an effect on?
    pub fn is_on(&self, name: &str) -> bool {
        self.effects.iter().any(|effect| effect.name == name && effect.on)
    }

    /// Notes how far the factored form was from the direct sum, and whether it was kept.
    pub fn factored(&mut self, kept: bool, rel_l2: f64) {
        for effect in &mut self.effects {
            if effect.name == "low_rank" {
                effect.on = kept;
                let verdict = if kept { "kept" } else { "given up, summed directly" };
                effect.reason.push_str(&format!("; it is {:.1} % from it: {verdict}", rel_l2 * 100.0));
            }
        }
    }

    /// Notes what a stage took beside what was predicted.
    pub fn measured(&mut self, name: &str, ms: f64) {
        for effect in &mut self.effects {
            if effect.name == name {
                effect.measured_ms = Some(ms);
            }
        }
    }
}

/// Decides everything from what was found.
pub fn decide(found: &SceneFeatures, settings: &Settings, costs: &Costs) -> Plan {
    let mut effects = Vec::new();
    let mut note = |name, on, reason: String, predicted_ms: f64| {
        effects.push(Effect { name, on, reason, predicted_ms, measured_ms: None, forced: false, bound: None });
    };
    let facets = settings.facets as f64;
    let route = route(found, settings, costs);
    let what = if settings.sighting == VisibilityMethod::Auto {
        "surfaces overhang"
    } else {
        "asked for by quality.visibility"
    };
    let (what, predicted) = match route {
        VisibilityAlgorithm::None => (decisions::no_visibility(found, settings), 0.0),
        VisibilityAlgorithm::HeightMarch => (
            format!("a height-field: horizons along {} azimuths, walking its samples", settings.horizon_azimuths),
            facets * settings.horizon_azimuths as f64 * costs.march_ns * 1e-6 / costs.threads,
        ),
        VisibilityAlgorithm::HorizonScan => (
            format!(
                "no overhangs: horizons along {} azimuths, slicing {} triangles",
                settings.horizon_azimuths, found.triangles
            ),
            facets * settings.horizon_azimuths as f64 * costs.scan_ns * 1e-6 / costs.threads,
        ),
        VisibilityAlgorithm::OcclusionIntervals => (
            format!(
                "{what}: all that blocks, slicing along {} azimuths (shadow maps: {:.0} ms)",
                settings.slice_azimuths,
                maps_ms(found, settings, costs)
            ),
            scan_ms(found, settings, costs),
        ),
        VisibilityAlgorithm::CpuMaps => (
            format!(
                "{what}: {} toroidal shadow maps of {} texels a side (slicing: {:.0} ms)",
                settings.map_grid.len(),
                settings.map_resolution,
                scan_ms(found, settings, costs)
            ),
            maps_ms(found, settings, costs),
        ),
        VisibilityAlgorithm::GpuMaps => (
            format!("{what}, on the GPU: {} toroidal shadow maps", settings.map_grid.len()),
            settings.map_grid.len() as f64 * found.triangles as f64 * 2e-6,
        ),
    };
    note("visibility", route != VisibilityAlgorithm::None, what, predicted);

    let fill_ns =
        if route == VisibilityAlgorithm::OcclusionIntervals { costs.slice_fill_ns } else { costs.facet_fill_ns };
    let direct_query = (found.lobes as f64 * costs.lobe_ns + found.lookups as f64 * costs.lookup_ns + facets * fill_ns)
        * 1e-6
        / costs.threads;
    let direct_ms = IMAGE_QUERIES * direct_query;
    let low_rank_ms = 800.0 + IMAGE_QUERIES * costs.factor_query_ns * 1e-6 / costs.threads;
    let allowed = !matches!(settings.preset, Preset::Reference | Preset::Wu2011);
    let try_low_rank = match settings.method {
        Method::Direct => false,
        Method::LowRank => true,
        // Sums of analytic lobes are quick enough for single pairs and export, and pictures read a table of them: factors
        // pay where every term is a look-up. Few normals have sharp edges between them, which factors reach at the lobes'
        // own grid at best (docs/accuracy.txt: 2.6 % on a V-groove).
        Method::Auto => allowed && found.lookups > 0 && found.distinct_normals.is_none() && low_rank_ms < direct_ms,
    };
    let comparison = format!(
        "a 384x384 picture with 32 lights is predicted at {direct_ms:.0} ms summed directly, {low_rank_ms:.0} ms factored"
    );
    note(
        "low_rank",
        try_low_rank,
        match settings.method {
            Method::Auto if try_low_rank => {
                format!(
                    "{comparison}; kept if within {:.1} % and {:.0} dB of the direct sum",
                    settings.tolerance * 100.0,
                    settings.tolerance_db
                )
            }
            Method::Auto => comparison,
            _ => "asked for by quality.method".to_owned(),
        },
        if try_low_rank { 800.0 } else { 0.0 },
    );
    let horizons = matches!(route, VisibilityAlgorithm::HeightMarch | VisibilityAlgorithm::HorizonScan);
    let try_shading_table = decisions::picture_table(found, settings, costs, horizons, direct_query, &mut note);
    let forced = &settings.effects;
    note(
        "exact_lobes",
        decisions::is_on(forced.exact_lobes, found.distinct_normals.is_some()),
        match found.distinct_normals {
            Some(count) => format!("{count} distinct normals: one exact lobe each, whatever the number of facets"),
            None => "normals differ from facet to facet".to_owned(),
        },
        0.0,
    );
    note(
        "color_weights",
        decisions::is_on(forced.color_weights, found.colors_vary),
        if found.colors_vary {
            "colour weights differ between facets of one material: three sums, one a channel".to_owned()
        } else {
            "each material has one colour: one sum and a multiplication".to_owned()
        },
        0.0,
    );
    note(
        "material_groups",
        decisions::is_on(forced.material_groups, found.materials > 1),
        match (found.materials, found.black_materials) {
            (n, 0) if n > 1 => format!("{n} materials, each summed over its own facets"),
            (n, black) if n > 1 => format!("{n} materials, each summed over its own facets; {black} black and skipped"),
            (_, 0) => "one material".to_owned(),
            (_, black) => format!("one material that reflects; {black} black and skipped"),
        },
        0.0,
    );
    note(
        "measured_brdf",
        found.lookups > 0,
        if found.lookups > 0 { "a measured BRDF is looked up".to_owned() } else { "all BRDFs are analytic".to_owned() },
        0.0,
    );
    note(
        "projected_area",
        !found.closes_plane,
        if found.closes_plane {
            "the tile closes the plane: a_v = A cos θ, and the sum's own estimate of it".to_owned()
        } else {
            "the tile leaves holes: the measured projected area normalises".to_owned()
        },
        0.0,
    );
    note(
        "self_shadow",
        decisions::is_on(forced.self_shadow, found.object_self_shadows && found.lights > 0),
        if !found.object_self_shadows {
            "the object is convex: it cannot shadow itself".to_owned()
        } else if found.lights == 0 {
            "no light".to_owned()
        } else {
            format!("the object can shadow itself: rays to {} lights", found.lights)
        },
        0.0,
    );
    let interreflection = decisions::interreflection(found, settings, costs, &mut note);
    decisions::mirror_symmetry(found, settings, interreflection, try_shading_table, &mut note);
    decisions::of_the_scene(found, settings, &mut note);
    for (name, reason) in [
        ("transmission", "light through thin slabs (Dai et al. 2009): not asked for"),
        ("color_map_filtering", "filtered colour maps (Heitz et al. 2013): not asked for"),
    ] {
        note(name, false, reason.to_owned(), 0.0);
    }
    decisions::mark(&mut effects, found, settings);
    let mirrors = decisions::mirrors(found, settings);
    Plan { route, try_low_rank, try_shading_table, interreflection, mirrors, effects }
}

/// Slicing under overhangs: cells and triangles looked at, facet by facet.
fn scan_ms(found: &SceneFeatures, settings: &Settings, costs: &Costs) -> f64 {
    let slices = settings.facets as f64 * settings.slice_azimuths as f64;
    slices * found.scan_work * costs.slice_ns * 1e-6 / costs.threads
}

/// Shadow maps: triangles set up and texels covered, direction by direction.
fn maps_ms(found: &SceneFeatures, settings: &Settings, costs: &Costs) -> f64 {
    let texels = f64::from(settings.map_resolution).powi(2) * found.area_ratio;
    let direction = found.triangles as f64 * costs.triangle_ns + texels * costs.texel_ns;
    settings.map_grid.len() as f64 * direction * 1e-6 / costs.threads
}

fn route(found: &SceneFeatures, settings: &Settings, costs: &Costs) -> VisibilityAlgorithm {
    if !decisions::is_on(settings.effects.visibility, !found.flat && !decisions::is_shallow(found, settings)) {
        VisibilityAlgorithm::None
    } else {
        let maps = if found.hardware_gpu { VisibilityAlgorithm::GpuMaps } else { VisibilityAlgorithm::CpuMaps };
        match settings.sighting {
            VisibilityMethod::OcclusionIntervals => VisibilityAlgorithm::OcclusionIntervals,
            VisibilityMethod::Maps => maps,
            VisibilityMethod::Auto if found.height_samples => VisibilityAlgorithm::HeightMarch,
            VisibilityMethod::Auto if found.height_field => VisibilityAlgorithm::HorizonScan,
            VisibilityMethod::Auto
                if scan_ms(found, settings, costs) <= maps_ms(found, settings, costs) && !found.hardware_gpu =>
            {
                VisibilityAlgorithm::OcclusionIntervals
            }
            VisibilityMethod::Auto => maps,
        }
    }
}
