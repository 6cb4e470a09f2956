//! Tests that every shader in `shaders/` parses and validates. naga needs no GPU.

use std::path::Path;

use naga::valid::{Capabilities, ValidationFlags, Validator};

/// Returns the error of naga for a source, if there is one. No optional capabilities are allowed, so that shaders run
/// on every adapter.
fn validation_error(source: &str) -> Option<String> {
    let module = match naga::front::wgsl::parse_str(source) {
        Ok(module) => module,
        Err(error) => return Some(error.emit_to_string(source)),
    };
    let validated = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module);
    validated.err().map(|error| error.emit_to_string(source))
}

#[test]
fn every_combination_of_effects_parses_and_validates() {
    let mut failures = Vec::new();
    let mut check = |name: &str, swaps: &[(&'static str, &'static str)]| {
        let found = match biscale::gpu::swapped_source(name, swaps) {
            Ok(source) => validation_error(&source),
            Err(error) => Some(error.to_string()),
        };
        failures.extend(found.map(|error| format!("{name} with {swaps:?}: {error}")));
    };
    for shadows in ["shadows_none", "shadows_bits"] {
        for tint in ["tint_fixed", "tint_fresnel"] {
            check("shade_low_rank", &[("shadows_none", shadows), ("tint_fixed", tint)]);
            for columns in ["column_tints", "column_lobes"] {
                check("shade_table", &[("shadows_none", shadows), ("tint_fixed", tint), ("column_tints", columns)]);
            }
        }
        for visibility in [
            "visibility_unblocked",
            "visibility_horizons",
            "visibility_intervals",
            "visibility_packed_intervals",
            "visibility_maps",
        ] {
            check("projected_area", &[("visibility_unblocked", visibility)]);
            let bounds = match visibility {
                "visibility_unblocked" => "bounds_unblocked",
                "visibility_horizons" => "bounds_horizons",
                _ => "bounds_unknown",
            };
            let visibility_swaps = [("visibility_unblocked", visibility), ("bounds_unblocked", bounds)];
            check("projected_area", &[visibility_swaps[0], visibility_swaps[1], ("sum_areas", "sum_cluster_areas")]);
            for (weights, tint) in [("weights_area", "tint_fresnel"), ("weights_rgb", "tint_fixed")] {
                let swaps = [("shadows_none", shadows), ("weights_area", weights), ("tint_fixed", tint)];
                check("shade_clusters", &[&visibility_swaps[..], &swaps].concat());
            }
            check("table_areas", &[("visibility_unblocked", visibility)]);
            for weights in ["weights_area", "weights_rgb"] {
                let swaps = [
                    ("visibility_unblocked", visibility),
                    ("weights_area", weights),
                    ("sum_facets", "sum_visible_areas"),
                ];
                check("table_of_sum", &swaps);
                check("table_of_subsets", &swaps[..2]);
            }
            for lobe in ["lobe_lambertian", "lobe_blinn_phong", "lobe_cook_torrance", "lobe_ward", "lobe_ggx"] {
                for weights in ["weights_area", "weights_rgb"] {
                    let swaps =
                        [("visibility_unblocked", visibility), ("lobe_lambertian", lobe), ("weights_area", weights)];
                    check("table_of_sum", &swaps);
                    let swaps = [
                        ("shadows_none", shadows),
                        ("visibility_unblocked", visibility),
                        ("lobe_lambertian", lobe),
                        ("weights_area", weights),
                    ];
                    check("shade_direct", &swaps);
                }
            }
        }
    }
    assert!(failures.is_empty(), "{} fail:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn effects_that_a_scene_does_not_use_are_not_in_the_shader() {
    let without = biscale::gpu::swapped_source("shade_direct", &[]).expect("known files");
    let all = [
        ("shadows_none", "shadows_bits"),
        ("visibility_unblocked", "visibility_horizons"),
        ("lobe_lambertian", "lobe_cook_torrance"),
    ];
    let with = biscale::gpu::swapped_source("shade_direct", &all).expect("known files");
    for absent in ["fn azimuth_in_turns", "horizons[", "exp(", "visible["] {
        assert!(!without.contains(absent) && with.contains(absent), "{absent}");
    }
    let horizons = [("visibility_unblocked", "visibility_horizons"), ("bounds_unblocked", "bounds_horizons")];
    let [without, with] = [&[][..], &horizons].map(|swaps| biscale::gpu::swapped_source("shade_clusters", swaps));
    let (without, with) = (without.expect("known files"), with.expect("known files"));
    for absent in ["fn azimuth_in_turns", "horizons[", "between(taps"] {
        assert!(!without.contains(absent) && with.contains(absent), "{absent}");
    }
    let tints = biscale::gpu::swapped_source("shade_table", &[]).expect("known files");
    let lobes = biscale::gpu::swapped_source("shade_table", &[("column_tints", "column_lobes")]).expect("known files");
    for absent in ["struct Term", "fn lobe_angles(", "exp(", "half_exponent"] {
        assert!(!tints.contains(absent) && lobes.contains(absent), "{absent}");
    }
    let areas = [("sum_facets", "sum_visible_areas")];
    let areas = biscale::gpu::swapped_source("table_of_sum", &areas).expect("known files");
    let lobes = biscale::gpu::swapped_source("table_of_sum", &[]).expect("known files");
    for absent in ["fn lobe(", "fn tint(", "is_lit(angles)"] {
        assert!(!areas.contains(absent) && lobes.contains(absent), "{absent}");
    }
}

#[test]
fn every_shader_parses_and_validates_with_its_imports() {
    let mut failures = Vec::new();
    for (name, _) in biscale::gpu::SHADERS {
        let source = match biscale::gpu::shader_source(name) {
            Ok(source) => source,
            Err(error) => {
                failures.push(format!("{name}: {error}"));
                continue;
            }
        };
        failures.extend(validation_error(&source).map(|error| format!("{name}: {error}")));
    }
    assert!(failures.is_empty(), "{} shaders fail:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn the_table_of_shaders_lists_every_file_in_the_folders() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    let entries = |folder: &Path| -> Vec<_> {
        let entries = std::fs::read_dir(folder).expect("the folder exists");
        entries.map(|entry| entry.expect("the folder is readable").path()).collect()
    };
    let files = entries(&folder).into_iter().flat_map(|folder| entries(&folder));
    let mut files: Vec<_> = files.filter_map(|path| Some(path.file_name()?.to_str()?.to_owned())).collect();
    let mut table: Vec<_> = biscale::gpu::SHADERS.iter().map(|(name, _)| format!("{name}.wgsl")).collect();
    files.sort();
    table.sort();
    assert_eq!(files, table);
}
