//! The shaders in `shaders/` and their import step.
//!
//! A line `//!import name` is replaced by the file `name.wgsl`, which may have imports of its own. A file is included
//! only once, at its first import. In WGSL the line is a comment, so every file is plain WGSL for editors.
//!
//! An import may be swapped for another file with the same functions. A shader therefore contains only the code of the
//! effects that a scene uses.

use crate::gpu::GpuError;

/// Builds the table of shaders from folders and file names without their ending.
macro_rules! shaders {
    ($($folder:literal: $($name:literal),+;)+) => {
        &[$($(($name, include_str!(concat!("../../../shaders/", $folder, "/", $name, ".wgsl")))),+),+]
    };
}

/// Name and source of every file in the folders of `shaders/`. Names are unique across folders.
pub const SHADERS: &[(&str, &str)] = shaders! {
    "common": "angles", "cubic", "flat_index", "point", "polar_grid", "vectors", "workgroup_sum";
    "lobes": "blinn_phong", "cook_torrance", "exp_negative", "ggx", "lambertian", "lobe_angles",
        "lobe_blinn_phong", "lobe_by_number", "lobe_cook_torrance", "lobe_ggx", "lobe_lambertian", "lobe_ward",
        "tint_fixed", "tint_fresnel", "tint_row", "ward";
    "visibility": "azimuth_taps", "height_march", "place_triangles", "shadow_map", "shadow_view", "slice_blend",
        "slice_entry", "slice_scan", "visibility_horizons", "visibility_intervals", "visibility_maps",
        "visibility_packed_intervals", "visibility_unblocked";
    "shading": "bounds_horizons", "bounds_unblocked", "bounds_unknown", "cluster_sums", "clusters",
        "column_lobes", "column_tints", "facets", "horizon_bounds", "projected_area", "scales",
        "shade_bounced", "shade_clusters", "shade_direct", "shade_low_rank", "shade_table", "shading_points",
        "shadows_bits", "shadows_none", "sum_areas", "sum_cluster_areas", "sum_facets", "sum_visible_areas",
        "weights_area", "weights_rgb";
    "tabulate": "facet_subsets", "sample_facets", "table_areas", "table_borders", "table_nodes",
        "table_of_subsets", "table_of_sum", "table_pairs", "table_values", "two_lobes";
    "color_map": "color_pixels", "color_reads";
    "render": "gbuffer", "image", "light_rays";
    "seen_through": "backdrop", "pyramid", "seen_through";
};

const IMPORT: &str = "//!import ";

/// Pairs of an import and the file that replaces it.
pub type Swaps<'a> = &'a [(&'static str, &'static str)];

/// Returns the source of a shader with its imports included.
pub fn shader_source(name: &str) -> Result<String, GpuError> {
    swapped_source(name, &[])
}

/// Returns the source of a shader with its imports included. In each pair of `swaps`, the second file replaces the
/// first.
pub fn swapped_source(name: &str, swaps: Swaps<'_>) -> Result<String, GpuError> {
    let (mut source, mut included) = (String::new(), Vec::new());
    include(name, swaps, &mut source, &mut included)?;
    Ok(source)
}

fn include(name: &str, swaps: Swaps<'_>, source: &mut String, included: &mut Vec<String>) -> Result<(), GpuError> {
    let name = swaps.iter().find(|(from, _)| *from == name).map_or(name, |(_, to)| to);
    if included.iter().any(|known| known == name) {
        return Ok(());
    }
    included.push(name.to_owned());
    let (_, text) =
        SHADERS.iter().find(|(known, _)| *known == name).ok_or_else(|| GpuError::UnknownShader(name.to_owned()))?;
    for line in text.lines() {
        match line.strip_prefix(IMPORT) {
            Some(import) => include(import.trim(), swaps, source, included)?,
            None => {
                source.push_str(line);
                source.push('\n');
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn imports_are_included_once_and_unknown_names_are_errors() {
        let source = shader_source("shadow_map").unwrap();
        assert_eq!(source.matches("struct View").count(), 1);
        assert!(!source.contains(IMPORT));
        assert_eq!(shader_source("nothing"), Err(GpuError::UnknownShader("nothing".to_owned())));
    }
}
