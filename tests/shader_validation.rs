//! Every shader in `shaders/` parses and validates, whatever the machine: naga needs no adapter.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may stop where it stands")]

use std::collections::BTreeSet;
use std::path::Path;

use naga::valid::{Capabilities, ValidationFlags, Validator};

/// What naga says against a source, if anything. No optional capabilities: what passes here runs on every adapter.
fn complaint(source: &str) -> Option<String> {
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
            Ok(source) => complaint(&source),
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
        for see in [
            "visibility_unblocked",
            "visibility_horizons",
            "visibility_slices",
            "visibility_hanging",
            "visibility_maps",
        ] {
            check("projected_area", &[("visibility_unblocked", see)]);
            let reach = match see {
                "visibility_unblocked" => "reach_unblocked",
                "visibility_horizons" => "reach_horizons",
                _ => "reach_unknown",
            };
            let sees = [("visibility_unblocked", see), ("reach_unblocked", reach)];
            check("projected_area", &[sees[0], sees[1], ("sum_areas", "sum_patch_areas")]);
            for (weights, tint) in [("weights_area", "tint_fresnel"), ("weights_rgb", "tint_fixed")] {
                let swaps = [("shadows_none", shadows), ("weights_area", weights), ("tint_fixed", tint)];
                check("shade_patches", &[&sees[..], &swaps].concat());
            }
            check("table_areas", &[("visibility_unblocked", see)]);
            for weights in ["weights_area", "weights_rgb"] {
                let swaps =
                    [("visibility_unblocked", see), ("weights_area", weights), ("sum_facets", "sum_seen_areas")];
                check("table_of_sum", &swaps);
                check("table_of_picks", &swaps[..2]);
            }
            for lobe in ["lobe_lambertian", "lobe_blinn_phong", "lobe_cook_torrance", "lobe_ward", "lobe_ggx"] {
                for weights in ["weights_area", "weights_rgb"] {
                    let swaps = [("visibility_unblocked", see), ("lobe_lambertian", lobe), ("weights_area", weights)];
                    check("table_of_sum", &swaps);
                    let swaps = [
                        ("shadows_none", shadows),
                        ("visibility_unblocked", see),
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
fn what_a_scene_does_not_call_for_is_not_in_the_shader() {
    let flat = biscale::gpu::swapped_source("shade_direct", &[]).expect("known files");
    let all = [
        ("shadows_none", "shadows_bits"),
        ("visibility_unblocked", "visibility_horizons"),
        ("lobe_lambertian", "lobe_cook_torrance"),
    ];
    let rich = biscale::gpu::swapped_source("shade_direct", &all).expect("known files");
    for absent in ["fn turn_of", "horizons[", "exp(", "visible["] {
        assert!(!flat.contains(absent) && rich.contains(absent), "{absent}");
    }
    let horizons = [("visibility_unblocked", "visibility_horizons"), ("reach_unblocked", "reach_horizons")];
    let [flat, hilly] = [&[][..], &horizons].map(|swaps| biscale::gpu::swapped_source("shade_patches", swaps));
    let (flat, hilly) = (flat.expect("known files"), hilly.expect("known files"));
    for absent in ["fn turn_of", "horizons[", "sight.elevation"] {
        assert!(!flat.contains(absent) && hilly.contains(absent), "{absent}");
    }
    let tints = biscale::gpu::swapped_source("shade_table", &[]).expect("known files");
    let lobes = biscale::gpu::swapped_source("shade_table", &[("column_tints", "column_lobes")]).expect("known files");
    for absent in ["struct Term", "fn see(", "exp(", "half_exponent"] {
        assert!(!tints.contains(absent) && lobes.contains(absent), "{absent}");
    }
    let areas = [("sum_facets", "sum_seen_areas")];
    let areas = biscale::gpu::swapped_source("table_of_sum", &areas).expect("known files");
    let lobes = biscale::gpu::swapped_source("table_of_sum", &[]).expect("known files");
    for absent in ["fn lobe(", "fn tint(", "is_lit(seen)"] {
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
        failures.extend(complaint(&source).map(|error| format!("{name}: {error}")));
    }
    assert!(failures.is_empty(), "{} shaders fail:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn the_table_of_shaders_is_the_folder() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    let files = std::fs::read_dir(&folder).expect("shaders/ is there").map(|entry| entry.expect("readable").path());
    let files: BTreeSet<_> = files.filter_map(|path| Some(path.file_name()?.to_str()?.to_owned())).collect();
    let table: BTreeSet<_> = biscale::gpu::SHADERS.iter().map(|(name, _)| format!("{name}.wgsl")).collect();
    assert_eq!(files, table);
}
