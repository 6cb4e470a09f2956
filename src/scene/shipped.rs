//! The scenes and images that ship inside the binary.

macro_rules! materials {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../materials/", $name, ".toml")))),*]
    };
}

macro_rules! assets {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_bytes!(concat!("../../assets/", $name)).as_slice())),*]
    };
}

/// Name and text of every file in `materials/`, sorted.
pub const MATERIALS: &[(&str, &str)] = materials!["default"];

/// Name and content of every file in `assets/`, sorted.
pub const ASSETS: &[(&str, &[u8])] = assets![];

/// Names of the shipped scenes.
pub fn names() -> impl Iterator<Item = &'static str> {
    MATERIALS.iter().map(|(name, _)| *name)
}

/// Text of a shipped scene.
pub fn source(name: &str) -> Option<&'static str> {
    MATERIALS
        .iter()
        .find(|(candidate, _)| *candidate == name)
        .map(|(_, source)| *source)
}

/// What a shipped scene shows: the comment that its file begins with.
pub fn description(name: &str) -> Option<String> {
    let lines = source(name)?
        .lines()
        .map_while(|line| line.strip_prefix('#'))
        .map(str::trim);
    Some(lines.collect::<Vec<_>>().join(" "))
}

/// Content of a shipped file.
pub fn asset(name: &str) -> Option<&'static [u8]> {
    ASSETS
        .iter()
        .find(|(candidate, _)| *candidate == name)
        .map(|(_, bytes)| *bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(folder: &str, ending: Option<&str>) -> Vec<String> {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
        let Ok(entries) = std::fs::read_dir(path) else {
            return Vec::new();
        };
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        if let Some(ending) = ending {
            names = names
                .iter()
                .map(|name| name.strip_suffix(ending).expect(name).to_owned())
                .collect();
        }
        names.sort();
        names
    }

    #[test]
    fn everything_in_materials_and_assets_is_embedded_in_order() {
        assert_eq!(
            files("materials", Some(".toml")),
            names().collect::<Vec<_>>()
        );
        assert_eq!(
            files("assets", None),
            ASSETS.iter().map(|(name, _)| *name).collect::<Vec<_>>()
        );
    }

    #[test]
    fn every_shipped_scene_loads_and_says_what_it_shows() {
        for name in names() {
            let loaded =
                crate::scene::open(name, &[]).unwrap_or_else(|error| panic!("{name}: {error}"));
            loaded.scene.validate().unwrap();
            assert!(
                description(name).is_some_and(|text| text.len() > 20),
                "{name}"
            );
        }
    }
}
