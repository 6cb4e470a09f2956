//! Colour maps on tiles: the core against the filter, and which stages run.

use std::sync::Arc;

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::color_filter::ColorFilter;
use super::*;
use crate::color_map::slopes::direction;
use crate::scene::Pixels;
use crate::testing::gaussian_tile::{BANDS, RAMP, hills_under_ripples, layer, loaded, smooth};

fn white(loaded: &LoadedScene) -> LoadedScene {
    let mut white = loaded.without_interreflection();
    white.scene.color_map = None;
    white
}

/// Errors of a filter against the core: colours (median, worst), and relative RMS and worst of the whole value.
fn against_core(loaded: &LoadedScene, count: usize) -> [f64; 4] {
    let pipeline = Pipeline::new();
    let filter = pipeline.color_filter(loaded).unwrap();
    let plain = pipeline.effective(&white(loaded)).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut draw = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
    let (mut colors, mut wholes, mut square, mut norm) = (Vec::new(), Vec::new(), 0.0, 0.0);
    for _ in 0..count {
        let mut at = || {
            direction(
                draw(85_f64.to_radians().cos(), 20_f64.to_radians().cos()).acos(),
                draw(0.0, std::f64::consts::TAU),
            )
        };
        let (i, o) = (at(), at());
        let colored = filter.outcome.brdf.eval(i.as_vec3(), o.as_vec3()).as_dvec3();
        let base = plain.brdf.eval(i.as_vec3(), o.as_vec3()).as_dvec3();
        let ours = filter.pair(i, o).color;
        let error = ours - colored / base;
        colors.push((error.length_squared() / 3.0).sqrt());
        let whole = ours * base - colored;
        wholes.push(whole.length() / colored.length());
        square += whole.length_squared();
        norm += colored.length_squared();
    }
    colors.sort_by(f64::total_cmp);
    wholes.sort_by(f64::total_cmp);
    [colors[count / 2], colors[count - 1], (square / norm).sqrt(), wholes[count - 1]]
}

fn by(distribution: &str, map: &str) -> String {
    map.replacen("[color_map]", &format!("[color_map]\ndistribution = \"{distribution}\""), 1)
}

const GLOSSY: &str =
    "[[material]]\nname = \"default\"\nbrdf = { kind = \"cook_torrance\", roughness = 0.3, f0 = 0.5 }\n";

#[test]
fn the_filter_of_what_is_measured_on_facets_agrees_with_the_core_on_any_tile() {
    let (height, slope) = (layer("{ kind = \"height\" }", BANDS), layer("{ kind = \"slope\" }", BANDS));
    let steepness = layer("{ kind = \"steepness\" }", BANDS);
    let weave =
        |map: &str| loaded(&format!("[tile]\ngeometry = {{ kind = \"weave\" }}\n[quality]\npreset = \"draft\"\n{map}"));
    let tiles = [
        smooth(96, 8, "draft", &height),
        smooth(96, 8, "draft", &format!("{GLOSSY}{slope}")),
        hills_under_ripples(96, "draft", &steepness),
        weave(&height),
        weave(&format!("{GLOSSY}{steepness}")),
    ];
    for (k, loaded) in tiles.iter().enumerate() {
        let [median, worst, rms, whole] = against_core(loaded, 40);
        println!("tile {k}: colour {median:.5} / {worst:.5}; whole {rms:.5} / {whole:.5}");
        assert!(worst < 1e-3 && whole < 2e-3, "{k}: {median} {worst} {rms} {whole}");
    }
}

#[test]
fn smiths_heights_agree_with_the_core_on_a_gaussian_tile() {
    for (stops, name) in [(BANDS, "bands"), (RAMP, "ramp")] {
        let loaded = smooth(192, 16, "standard", &by("smith", &layer("{ kind = \"height\" }", stops)));
        let [median, worst, rms, whole] = against_core(&loaded, 80);
        println!("heights, {name}: colour {median:.4} / {worst:.4}; whole {rms:.4} / {whole:.4}");
        assert!(median < 0.012 && worst < 0.06, "{median} {worst} {rms} {whole}");
    }
}

#[test]
fn gaussian_slopes_agree_with_the_core_matte_and_glossy() {
    for (materials, most) in [("", 0.03), (GLOSSY, 0.08)] {
        let map = format!("{materials}{}", layer("{ kind = \"slope\", azimuth_deg = 30 }", BANDS));
        let [median, worst, rms, whole] = against_core(&smooth(192, 16, "standard", &by("smith", &map)), 60);
        println!("slopes: colour {median:.4} / {worst:.4}; whole {rms:.4} / {whole:.4}");
        assert!(rms < most, "{median} {worst} {rms} {whole}");
    }
}

/// Layers of noise, heights and slopes.
fn three_layers(combine: &str) -> String {
    let drivers =
        ["{ kind = \"noise\", basis = \"gaussian\", cells = 24 }", "{ kind = \"height\" }", "{ kind = \"slope\" }"];
    let layers: String = drivers.map(|driver| format!("[[color_map.layer]]\ndriver = {driver}\n{RAMP}\n")).concat();
    format!("[color_map]\ncombine = \"{combine}\"\n{layers}")
}

#[test]
fn a_sum_and_a_product_of_layers_agree_with_the_core() {
    let rows =
        [("measured", "sum", 0.01), ("measured", "product", 0.02), ("smith", "sum", 0.02), ("smith", "product", 0.05)];
    for (distribution, combine, most) in rows {
        let loaded = smooth(192, 16, "standard", &by(distribution, &three_layers(combine)));
        let [median, worst, rms, whole] = against_core(&loaded, 40);
        println!("{distribution}, {combine} of three: colour {median:.4} / {worst:.4}; whole {rms:.4} / {whole:.4}");
        assert!(rms < most, "{distribution} {combine}: {median} {worst} {rms} {whole}");
    }
}

#[test]
fn the_mean_colour_of_jumps_follows_from_the_tails_of_the_values_that_are_seen() {
    let stops = "stops = [[-0.5, 0.1], [-0.5, 0.4], [0.7, 0.4], [0.7, 0.9]]";
    let [i, o] = [direction(0.6, 1.0), direction(1.1, -0.4)];
    for driver in ["{ kind = \"height\" }", "{ kind = \"slope\", azimuth_deg = 20 }", "{ kind = \"steepness\" }"] {
        let filter = Pipeline::new().color_filter(&smooth(96, 8, "draft", &layer(driver, stops))).unwrap();
        let resolved = &filter.map.layers[0].mapped.driver;
        let tails = filter.tails(resolved, i, o, &[-9.0, -0.5, 0.7, 9.0], &Cancel::default());
        assert!(tails[0] > 0.999 && tails[3] < 0.001 && tails[1] > tails[2], "{driver}: {tails:?}");
        let expected = 0.1 + 0.3 * tails[1] + 0.5 * tails[2];
        let color = filter.pair(i, o).color;
        assert!((color - expected).abs().max_element() < 1e-3, "{driver}: {color} {expected}");
        let cancelled = Cancel::default();
        cancelled.set();
        assert!(filter.tails(resolved, i, o, &[0.0], &cancelled).is_empty());
    }
}

/// Two independent standard normal numbers (Box and Muller 1958).
fn normal_pair(random: &mut ChaCha8Rng) -> glam::DVec2 {
    let (u, v): (f64, f64) = (random.random(), random.random());
    (-2.0 * (1.0 - u).ln()).sqrt() * glam::DVec2::from_angle(std::f64::consts::TAU * v)
}

#[test]
fn slopes_of_an_analytic_surface_have_the_mean_colour_of_slopes_drawn_from_its_density() {
    let surface =
        "[color_map.surface]\nheight = 0.1\nslope_mean = [0.1, -0.05]\nslope_covariance = [0.12, 0.03, 0.06]\n";
    let map = layer("{ kind = \"slope\", azimuth_deg = 30 }", BANDS).replacen(
        "[[color_map.layer]]",
        &format!("{surface}[[color_map.layer]]"),
        1,
    );
    let filter = Pipeline::new()
        .color_filter(&loaded(&format!(
            "[tile]\ngeometry = {{ kind = \"flat\" }}\n[quality]\npreset = \"draft\"\n{map}"
        )))
        .unwrap();
    let along = glam::DVec2::from_angle(30_f64.to_radians());
    let deviation = (0.12 * along.x * along.x + 2.0 * 0.03 * along.x * along.y + 0.06 * along.y * along.y).sqrt();
    let (first, across) = (0.12_f64.sqrt(), 0.03 / 0.12_f64.sqrt());
    let second = (0.06 - across * across).sqrt();
    let mut random = ChaCha8Rng::seed_from_u64(3);
    // Each sample is a slope (∂h/∂x, ∂h/∂y) and its colour. The driver is the downward slope less its mean, over its deviation.
    let samples: Vec<(glam::DVec2, DVec3)> = (0..400_000)
        .map(|_| {
            let z = normal_pair(&mut random);
            let from_mean = glam::DVec2::new(first * z.x, across * z.x + second * z.y);
            let color = filter.map.layers[0].mapped.map.color(-from_mean.dot(along) / deviation);
            (glam::DVec2::new(0.1, -0.05) + from_mean, color)
        })
        .collect();
    let mean = |weight: &dyn Fn(glam::DVec2) -> f64| {
        let sum = |(color_sum, sum): (DVec3, f64), (slope, color): &(glam::DVec2, DVec3)| {
            let weight = weight(*slope);
            (color_sum + weight * *color, sum + weight)
        };
        let (color, sum) = samples.iter().fold((DVec3::ZERO, 0.0), sum);
        color / sum
    };
    let facing = |slope: glam::DVec2, d: DVec3| (d.z - slope.dot(d.truncate())).max(0.0);
    for (theta_i, theta_o) in [(0.0, 0.0), (0.5, 1.0), (1.2, 0.3), (1.3, 1.3)] {
        let [i, o] = [direction(theta_i, 2.0), direction(theta_o, -0.4)];
        let seen = mean(&|slope| facing(slope, o));
        let error = (filter.slopes(0, o).1 - seen).abs().max_element();
        assert!(error < 5e-3, "seen at {theta_o}: {error}");
        // The weight of a matte facet is its area times both cosines.
        let lit = mean(&|slope| facing(slope, o) * facing(slope, i) / (1.0 + slope.length_squared()).sqrt());
        let error = (filter.pair(i, o).color - lit).abs().max_element();
        assert!(error < 5e-3, "lit at {theta_i}, seen at {theta_o}: {error}");
        assert!((seen - filter.naive()).abs().max_element() > 0.05, "the colour of the mean is another one");
    }
}

#[test]
fn seen_along_the_light_nothing_is_in_shadow() {
    for distribution in ["measured", "smith"] {
        let map = layer("{ kind = \"height\" }", BANDS)
            .replace("[color_map]", &format!("[color_map]\ndistribution = \"{distribution}\""));
        let filter = Pipeline::new().color_filter(&smooth(128, 12, "standard", &map)).unwrap();
        for theta in [20.0_f64, 60.0, 75.0, 85.0] {
            let at = direction(theta.to_radians(), 0.7);
            let lit = filter.pair(at, at).lit;
            assert!((0.97..=1.03).contains(&lit), "{distribution} {theta}: {lit}");
        }
    }
}

#[test]
fn an_edit_of_a_stop_recomputes_neither_mesh_nor_facets_nor_drivers_nor_visibility() {
    let noise = "{ kind = \"noise\", cells = 4 }";
    let map = |value: f64| {
        format!(
            "{}[[color_map.layer]]\ndriver = {{ kind = \"height\" }}\nstops = [[{value}, 0], [{value}, 1]]\n",
            layer(noise, RAMP)
        )
    };
    let pipeline = Pipeline::new();
    let runs = |value: f64| {
        pipeline.color_filter(&smooth(64, 6, "draft", &map(value))).unwrap();
        pipeline
            .runs()
            .into_iter()
            .filter(|(name, _)| !name.starts_with("slab") && *name != "color_tile" && *name != "color_facets")
            .collect::<Vec<_>>()
    };
    let first = runs(0.1);
    let counted = ["geometry", "facets", "visibility", "color_drivers", "color_relief"];
    assert!(counted.iter().all(|name| first.contains(&(*name, 1))), "{first:?}");
    assert_eq!(runs(0.4), first);
}

#[test]
fn a_scene_without_a_colour_map_runs_none_of_its_stages_and_its_effect_is_off() {
    let pipeline = Pipeline::new();
    let plain = white(&smooth(64, 6, "draft", ""));
    let outcome = pipeline.effective(&plain).unwrap();
    assert!(!outcome.plan.is_on("color_map_filtering"));
    assert!(pipeline.runs().iter().all(|(name, count)| !name.starts_with("color_") || *count == 0));
    assert!(pipeline.color_filter(&plain).unwrap_err().to_string().contains("color_map"));
    let mapped = Pipeline::new().effective(&smooth(64, 6, "draft", &layer("{ kind = \"height\" }", RAMP))).unwrap();
    assert!(mapped.plan.is_on("color_map_filtering"));
}

#[test]
fn a_map_that_is_finer_than_the_facets_is_named_with_a_number_of_facets_that_resolves_it() {
    let map = |cells: u32| layer(&format!("{{ kind = \"noise\", basis = \"gaussian\", cells = {cells} }}"), BANDS);
    let warning = |cells: u32, facets: usize| {
        let mut loaded = smooth(64, 6, "draft", &map(cells));
        loaded.scene.quality.facets = Some(facets);
        let outcome = Pipeline::new().effective(&loaded).unwrap();
        outcome.health().warnings.iter().find(|warning| warning.contains("finer than the facets")).cloned()
    };
    assert_eq!(warning(4, 512), None);
    let named = warning(32, 512).unwrap();
    assert!(named.contains("quality.facets = 2048") && named.contains(" % of their variance"), "{named}");
    assert_eq!(warning(32, 8192), None);
}

#[test]
fn a_flat_tile_of_noise_has_the_plain_mean_of_its_colours_in_the_core_and_in_the_filter() {
    let text = format!(
        "[tile]\ngeometry = {{ kind = \"flat\" }}\n{}",
        layer("{ kind = \"noise\", basis = \"perlin\", cells = 8, octaves = 3 }", BANDS)
    );
    let loaded = loaded(&text);
    let filter = Pipeline::new().color_filter(&loaded).unwrap();
    let plain = Pipeline::new().effective(&white(&loaded)).unwrap();
    let (i, o) = (direction(0.4, 1.0), direction(0.7, 2.0));
    let of = |brdf: &EffectiveBrdf| brdf.eval(i.as_vec3(), o.as_vec3()).as_dvec3();
    let core: DVec3 = of(&filter.outcome.brdf) / of(&plain.brdf);
    let ours = filter.pair(i, o).color;
    assert!((core - ours).abs().max_element() < 0.005, "{core} {ours}");
}

#[test]
fn tiles_of_any_size_have_the_same_colours() {
    let color = |size: f32| -> Vec<DVec3> {
        let mut loaded = smooth(64, 6, "draft", &layer("{ kind = \"height\" }", RAMP));
        loaded.scene.tile.size = glam::Vec2::splat(size);
        let heights = loaded.painted.heights.as_ref().unwrap();
        let values = heights.values.iter().map(|height| height * size).collect();
        loaded.painted.heights = Some(Arc::new(Pixels { size: heights.size, values }));
        let filter: ColorFilter = Pipeline::new().color_filter(&loaded).unwrap();
        (0..6).map(|k| filter.pair(direction(0.25 * f64::from(k), 0.3), direction(1.2, 2.0)).color).collect()
    };
    let one = color(1.0);
    for size in [1e-6, 1e6] {
        for (a, b) in color(size).iter().zip(&one) {
            assert!((*a - *b).abs().max_element() < 2e-3, "{size}: {a} {b}");
        }
    }
}

#[test]
fn tiles_with_overhangs_refuse_smith_and_the_paper() {
    for distribution in ["smith", "paper"] {
        let map = by(distribution, &layer("{ kind = \"slope\" }", BANDS));
        let scene = loaded(&format!("[tile]\ngeometry = {{ kind = \"weave\" }}\n{map}"));
        let error = Pipeline::new().color_filter(&scene).unwrap_err();
        assert!(error.to_string().contains("overhangs") && error.exit_code() == 2, "{error}");
    }
}

#[test]
fn colours_are_finite_and_between_those_of_the_stops_at_every_angle_and_on_flat_steep_and_singular_surfaces() {
    for covariance in ["[0, 0, 0]", "[0.1, 0, 0]", "[100, 0, 100]", "[0.12, 0.12, 0.12]"] {
        for (driver, distribution) in
            [("height", "smith"), ("slope", "smith"), ("steepness", "smith"), ("height", "paper"), ("slope", "paper")]
        {
            let text = format!(
                "[tile]\ngeometry = {{ kind = \"flat\" }}\n[color_map]\ndistribution = \"{distribution}\"\n\
                 surface = {{ height = 0, slope_mean = [9, 0], slope_covariance = {covariance} }}\n\
                 [[color_map.layer]]\ndriver = {{ kind = \"{driver}\" }}\n{BANDS}\n"
            );
            let filter = Pipeline::new().color_filter(&loaded(&text)).unwrap();
            for theta in [0.0, 0.8, 89.99_f64.to_radians(), std::f64::consts::FRAC_PI_2, 2.0] {
                for phi in [0.0, 3.0] {
                    let at = filter.pair(direction(theta, phi), direction(theta, 1.0));
                    let sound =
                        at.color.is_finite() && at.color.min_element() >= 0.0 && at.color.max_element() <= 0.951;
                    let finite = at.lambda_i.is_finite() && at.lambda_o.is_finite() && (0.0..=1.0).contains(&at.lit);
                    assert!(sound && finite, "{covariance} {driver} {distribution} {theta}: {at:?}");
                }
            }
        }
    }
}

#[test]
fn warnings_name_drivers_that_are_not_normal_and_tiles_far_from_smith() {
    let map = |off: &str| {
        format!(
            "[tile]\ngeometry = {{ kind = \"flat\" }}\n[color_map]\ngaussianize = \"{off}\"\n[[color_map.layer]]\nname = \"waves\"\n\
             driver = {{ kind = \"texture\", path = \"asset:leather.png\" }}\n{BANDS}\n"
        )
    };
    let warnings = |text: &str| Pipeline::new().color_filter(&loaded(text)).unwrap().warnings();
    assert!(warnings(&map("auto")).is_empty());
    let off = warnings(&map("off"));
    assert!(off.len() == 1 && off[0].contains("`waves` is far from Gaussian"), "{off:?}");
    let one = warnings(&map("auto").replace("[[color", "taps = 1\n[[color"));
    assert!(one.len() == 1 && one[0].contains("taps = 4"), "{one:?}");
    let grooves = "[tile]\ngeometry = { kind = \"grooves\", depth = 0.4 }\n[quality]\npreset = \"draft\"\n[color_map]\n\
        distribution = \"smith\"\n[[color_map.layer]]\ndriver = { kind = \"height\" }\nstops = [[0, 0], [0, 1]]\n";
    let smith = warnings(grooves);
    assert!(smith.len() == 1 && smith[0].contains("distribution"), "{smith:?}");
}

#[test]
#[ignore = "a measurement: cargo bench --bench measure -- color-maps"]
fn the_table_of_color_maps_against_the_core() {
    let glossy = "[[material]]\nname = \"default\"\nbrdf = { kind = \"cook_torrance\", roughness = 0.15, f0 = 0.5 }\n";
    let of = |distribution: &str, driver: &str, stops: &str| by(distribution, &layer(driver, stops));
    let (height, slope) = ("{ kind = \"height\" }", "{ kind = \"slope\", azimuth_deg = 30 }");
    let of_tile = |name: &'static str, preset: &'static str, map: String| (name, preset, smooth(384, 32, preset, &map));
    let of_hills =
        |name: &'static str, preset: &'static str, map: String| (name, preset, hills_under_ripples(384, preset, &map));
    let steepness = "{ kind = \"steepness\" }";
    let rows = [
        of_tile("heights, bands, smith", "standard", of("smith", height, BANDS)),
        of_tile("heights, ramp, smith", "standard", of("smith", height, RAMP)),
        of_tile("heights, bands, paper", "standard", of("paper", height, BANDS)),
        of_hills("hills under ripples, heights, bands, smith", "standard", of("smith", height, BANDS)),
        of_hills("hills under ripples, heights, bands, smith", "fine", of("smith", height, BANDS)),
        of_tile("slopes, bands, diffuse, smith", "standard", of("smith", slope, BANDS)),
        of_tile("slopes, bands, diffuse, paper", "standard", of("paper", slope, BANDS)),
        of_tile(
            "slopes, bands, Cook-Torrance 0.15, smith",
            "standard",
            format!("{glossy}{}", of("smith", slope, BANDS)),
        ),
        of_tile("slopes, bands, Cook-Torrance 0.15, smith", "fine", format!("{glossy}{}", of("smith", slope, BANDS))),
        of_tile(
            "slopes, bands, Cook-Torrance 0.15, paper",
            "standard",
            format!("{glossy}{}", of("paper", slope, BANDS)),
        ),
        of_tile("steepness, ramp, diffuse, smith", "standard", of("smith", steepness, RAMP)),
        of_tile("sum of noise, heights and slopes, ramp, measured", "standard", three_layers("sum")),
        of_tile("sum of noise, heights and slopes, ramp, smith", "standard", by("smith", &three_layers("sum"))),
        of_tile("product of noise, heights and slopes, ramp, measured", "standard", three_layers("product")),
        of_tile("product of noise, heights and slopes, ramp, smith", "standard", by("smith", &three_layers("product"))),
    ];
    println!("| map | preset | colour, median | colour, worst | whole value, relative RMS | whole value, worst |");
    println!("|---|---|---|---|---|---|");
    for (name, preset, loaded) in rows {
        let [median, worst, rms, whole] = against_core(&loaded, 80);
        let [rms, whole] = [rms, whole].map(|error| 100.0 * error);
        println!("| {name} | `{preset}` | {median:.4} | {worst:.4} | {rms:.1} % | {whole:.1} % |");
    }
}
