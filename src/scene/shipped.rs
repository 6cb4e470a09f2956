//! The scenes and images that ship inside the binary.

macro_rules! materials {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../materials/", $name, ".toml")))),*]
    };
}

macro_rules! embedded {
    ($folder:literal, $($name:literal),* $(,)?) => {
        &[$(($name, include_bytes!(concat!($folder, $name)).as_slice())),*]
    };
}

/// Name and text of every file in `materials/`, sorted.
pub const MATERIALS: &[(&str, &str)] = materials![
    "default",
    "fig10_snake_color_map",
    "fig11_scales_color_map",
    "fig1a_noise_color_map",
    "fig1b_heights_color_map",
    "fig1b_silver_shallow",
    "fig1c_silver_deep",
    "fig1c_slopes_color_map",
    "fig1d_yellow_sides",
    "fig1e_lambertian",
    "fig4a_pearl_cup",
    "fig4b_bicolor_cup",
    "fig4c_ward_cup",
    "fig5_structures_color_map",
    "fig5a_isotropic",
    "fig5b_anisotropic",
    "fig5c_uneven",
    "fig5d_pentagonal",
    "fig6_non_normal_color_map",
    "fig6a_velvet_spread",
    "fig6b_velvet_concentrated",
    "fig6c_velvet_up",
    "fig6d_velvet_left",
    "fig7a_shot_silk",
    "fig7b_shot_silk_wide_weft",
    "fig8a_bear_heights_color_map",
    "fig8a_hammered",
    "fig8b_bear_slopes_color_map",
    "fig8b_ripples",
    "fig8c_brushed",
    "fig8d_leather",
    "fig9_slopes_color_map",
    "fig9a_cylinder_grooves",
    "fig9b_cylinder_stripes",
    "slab_fig1_grid_sheet",
    "slab_fig1_leaf_glass",
    "slab_fig1_rice_paper",
    "slab_fig3_both",
    "slab_fig3_bottom",
    "slab_fig3_top",
    "slab_fig5_30",
    "slab_fig5_45",
    "slab_fig5_60",
    "slab_fig6_grid_sheet",
    "slab_fig7_leaf_glass",
    "slab_two_tiles",
    "slab_window",
    "table3",
    "table4_cup",
    "table4_pillow",
    "table4_plate",
    "table4_skirt",
    "table4_teapot",
];

/// Name and content of every file in `assets/`, sorted.
pub const ASSETS: &[(&str, &[u8])] =
    embedded!["../../assets/", "brushed.png", "hammered.png", "leather.png", "ripples.png"];

/// Name and content of every sheet in `sheets/`, sorted: SVBTDFs made by formulas.
pub const SHEETS: &[(&str, &[u8])] = embedded!["../../sheets/", "grid_sheet.npz", "leaf_glass.npz", "rice_paper.npz"];

/// Names of the shipped scenes.
pub fn names() -> impl Iterator<Item = &'static str> {
    MATERIALS.iter().map(|(name, _)| *name)
}

/// Names of the shipped scenes without a slab.
pub fn opaque_names() -> impl Iterator<Item = &'static str> {
    MATERIALS.iter().filter(|(_, source)| !source.contains("[slab]")).map(|(name, _)| *name)
}

/// Text of a shipped scene.
pub fn source(name: &str) -> Option<&'static str> {
    MATERIALS.iter().find(|(candidate, _)| *candidate == name).map(|(_, source)| *source)
}

/// Description of a shipped scene: the comment at the start of its file.
pub fn description(name: &str) -> Option<String> {
    let lines = source(name)?.lines().map_while(|line| line.strip_prefix('#')).map(str::trim);
    Some(lines.collect::<Vec<_>>().join(" "))
}

/// Content of a shipped file.
pub fn asset(name: &str) -> Option<&'static [u8]> {
    ASSETS.iter().chain(SHEETS).find(|(candidate, _)| *candidate == name).map(|(_, bytes)| *bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(folder: &str, ending: Option<&str>) -> Vec<String> {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
        let Ok(entries) = std::fs::read_dir(path) else {
            return Vec::new();
        };
        let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        if let Some(ending) = ending {
            names = names.iter().map(|name| name.strip_suffix(ending).expect(name).to_owned()).collect();
        }
        names.sort();
        names
    }

    #[test]
    fn everything_in_materials_and_assets_is_embedded_in_order() {
        assert_eq!(files("materials", Some(".toml")), names().collect::<Vec<_>>());
        let names = |files: &[(&'static str, &[u8])]| files.iter().map(|(name, _)| *name).collect::<Vec<_>>();
        assert_eq!(files("assets", None), names(ASSETS));
        assert_eq!(files("sheets", None), names(SHEETS));
    }

    #[test]
    fn every_shipped_scene_loads_and_says_what_it_shows() {
        for name in names() {
            let loaded = crate::scene::open(name, &[]).unwrap_or_else(|error| panic!("{name}: {error}"));
            loaded.scene.validate().unwrap();
            assert!(description(name).is_some_and(|text| text.len() > 20), "{name}");
        }
    }
}
