//! The shaders in `shaders/` and the one import step.
//!
//! A line `//!import name` is replaced by `shaders/name.wgsl`, which may import in turn; a file is taken in only once, at
//! its first import. To WGSL the line is a comment, so every file stays plain WGSL for editors.
//!
//! An import may be swapped for another file with the same functions: so a shader holds the code of the effects that a
//! scene calls for and of no other.

use crate::gpu::GpuError;

/// Every file in `shaders/`, by name without the ending.
pub const SHADERS: &[(&str, &str)] = &[
    ("angles", include_str!("../../../shaders/angles.wgsl")),
    ("azimuth_sight", include_str!("../../../shaders/azimuth_sight.wgsl")),
    ("blinn_phong", include_str!("../../../shaders/blinn_phong.wgsl")),
    ("column_lobes", include_str!("../../../shaders/column_lobes.wgsl")),
    ("column_tints", include_str!("../../../shaders/column_tints.wgsl")),
    ("cook_torrance", include_str!("../../../shaders/cook_torrance.wgsl")),
    ("exp_negative", include_str!("../../../shaders/exp_negative.wgsl")),
    ("facets", include_str!("../../../shaders/facets.wgsl")),
    ("find_reach", include_str!("../../../shaders/find_reach.wgsl")),
    ("flat_index", include_str!("../../../shaders/flat_index.wgsl")),
    ("gbuffer", include_str!("../../../shaders/gbuffer.wgsl")),
    ("ggx", include_str!("../../../shaders/ggx.wgsl")),
    ("height_march", include_str!("../../../shaders/height_march.wgsl")),
    ("lambertian", include_str!("../../../shaders/lambertian.wgsl")),
    ("light_rays", include_str!("../../../shaders/light_rays.wgsl")),
    ("lobe_blinn_phong", include_str!("../../../shaders/lobe_blinn_phong.wgsl")),
    ("lobe_by_number", include_str!("../../../shaders/lobe_by_number.wgsl")),
    ("lobe_cook_torrance", include_str!("../../../shaders/lobe_cook_torrance.wgsl")),
    ("lobe_ggx", include_str!("../../../shaders/lobe_ggx.wgsl")),
    ("lobe_input", include_str!("../../../shaders/lobe_input.wgsl")),
    ("lobe_lambertian", include_str!("../../../shaders/lobe_lambertian.wgsl")),
    ("lobe_ward", include_str!("../../../shaders/lobe_ward.wgsl")),
    ("patch_sums", include_str!("../../../shaders/patch_sums.wgsl")),
    ("patches", include_str!("../../../shaders/patches.wgsl")),
    ("pick_facets", include_str!("../../../shaders/pick_facets.wgsl")),
    ("picture", include_str!("../../../shaders/picture.wgsl")),
    ("place_triangles", include_str!("../../../shaders/place_triangles.wgsl")),
    ("point", include_str!("../../../shaders/point.wgsl")),
    ("polar_grid", include_str!("../../../shaders/polar_grid.wgsl")),
    ("projected_area", include_str!("../../../shaders/projected_area.wgsl")),
    ("reach_horizons", include_str!("../../../shaders/reach_horizons.wgsl")),
    ("reach_unblocked", include_str!("../../../shaders/reach_unblocked.wgsl")),
    ("reach_unknown", include_str!("../../../shaders/reach_unknown.wgsl")),
    ("scales", include_str!("../../../shaders/scales.wgsl")),
    ("shade_direct", include_str!("../../../shaders/shade_direct.wgsl")),
    ("shade_low_rank", include_str!("../../../shaders/shade_low_rank.wgsl")),
    ("shade_patches", include_str!("../../../shaders/shade_patches.wgsl")),
    ("shade_table", include_str!("../../../shaders/shade_table.wgsl")),
    ("shading_points", include_str!("../../../shaders/shading_points.wgsl")),
    ("shadow_map", include_str!("../../../shaders/shadow_map.wgsl")),
    ("shadow_view", include_str!("../../../shaders/shadow_view.wgsl")),
    ("shadows_bits", include_str!("../../../shaders/shadows_bits.wgsl")),
    ("shadows_none", include_str!("../../../shaders/shadows_none.wgsl")),
    ("slice_entry", include_str!("../../../shaders/slice_entry.wgsl")),
    ("slice_scan", include_str!("../../../shaders/slice_scan.wgsl")),
    ("slice_sight", include_str!("../../../shaders/slice_sight.wgsl")),
    ("sum_areas", include_str!("../../../shaders/sum_areas.wgsl")),
    ("sum_facets", include_str!("../../../shaders/sum_facets.wgsl")),
    ("sum_patch_areas", include_str!("../../../shaders/sum_patch_areas.wgsl")),
    ("sum_seen_areas", include_str!("../../../shaders/sum_seen_areas.wgsl")),
    ("table_areas", include_str!("../../../shaders/table_areas.wgsl")),
    ("table_ends", include_str!("../../../shaders/table_ends.wgsl")),
    ("table_nodes", include_str!("../../../shaders/table_nodes.wgsl")),
    ("table_of_picks", include_str!("../../../shaders/table_of_picks.wgsl")),
    ("table_of_sum", include_str!("../../../shaders/table_of_sum.wgsl")),
    ("table_pairs", include_str!("../../../shaders/table_pairs.wgsl")),
    ("table_picks", include_str!("../../../shaders/table_picks.wgsl")),
    ("table_values", include_str!("../../../shaders/table_values.wgsl")),
    ("tint_fixed", include_str!("../../../shaders/tint_fixed.wgsl")),
    ("tint_fresnel", include_str!("../../../shaders/tint_fresnel.wgsl")),
    ("tint_row", include_str!("../../../shaders/tint_row.wgsl")),
    ("together", include_str!("../../../shaders/together.wgsl")),
    ("two_lobes", include_str!("../../../shaders/two_lobes.wgsl")),
    ("vectors", include_str!("../../../shaders/vectors.wgsl")),
    ("visibility_hanging", include_str!("../../../shaders/visibility_hanging.wgsl")),
    ("visibility_horizons", include_str!("../../../shaders/visibility_horizons.wgsl")),
    ("visibility_maps", include_str!("../../../shaders/visibility_maps.wgsl")),
    ("visibility_slices", include_str!("../../../shaders/visibility_slices.wgsl")),
    ("visibility_unblocked", include_str!("../../../shaders/visibility_unblocked.wgsl")),
    ("ward", include_str!("../../../shaders/ward.wgsl")),
    ("weights_area", include_str!("../../../shaders/weights_area.wgsl")),
    ("weights_rgb", include_str!("../../../shaders/weights_rgb.wgsl")),
];

const IMPORT: &str = "//!import ";

/// Imports and the files that stand in for them.
pub type Swaps<'a> = &'a [(&'static str, &'static str)];

/// The source of a shader with its imports in place.
pub fn shader_source(name: &str) -> Result<String, GpuError> {
    swapped_source(name, &[])
}

/// The source of a shader where each import that `swaps` names first is replaced by the file it names second.
pub fn swapped_source(name: &str, swaps: Swaps<'_>) -> Result<String, GpuError> {
    let (mut source, mut taken) = (String::new(), Vec::new());
    take_in(name, swaps, &mut source, &mut taken)?;
    Ok(source)
}

fn take_in(name: &str, swaps: Swaps<'_>, source: &mut String, taken: &mut Vec<String>) -> Result<(), GpuError> {
    let name = swaps.iter().find(|(from, _)| *from == name).map_or(name, |(_, to)| to);
    if taken.iter().any(|known| known == name) {
        return Ok(());
    }
    taken.push(name.to_owned());
    let (_, text) =
        SHADERS.iter().find(|(known, _)| *known == name).ok_or_else(|| GpuError::UnknownShader(name.to_owned()))?;
    for line in text.lines() {
        match line.strip_prefix(IMPORT) {
            Some(import) => take_in(import.trim(), swaps, source, taken)?,
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
    fn imports_are_taken_in_once_and_unknown_names_are_errors() {
        let source = shader_source("shadow_map").unwrap();
        assert_eq!(source.matches("struct View").count(), 1);
        assert!(!source.contains(IMPORT));
        assert_eq!(shader_source("nothing"), Err(GpuError::UnknownShader("nothing".to_owned())));
    }
}
