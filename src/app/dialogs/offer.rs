//! A file that is no scene, and what the open scene can use it for.

use std::path::{Path, PathBuf};

/// A use of a file in the open scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileUse {
    /// The BRDF of the default material.
    Material,
    Tile,
    Object,
    Environment,
    Heights,
    Colors,
}

/// A file with its kind in words and its uses, each with the text of its button.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Offer {
    pub path: PathBuf,
    pub kind: &'static str,
    pub uses: &'static [(&'static str, FileUse)],
}

const MATERIAL: &[(&str, FileUse)] = &[("Use it in Default", FileUse::Material)];
const MESH: &[(&str, FileUse)] = &[("Use it as the tile", FileUse::Tile), ("Use it as the object", FileUse::Object)];
const PANORAMA: &[(&str, FileUse)] =
    &[("Use it as the environment", FileUse::Environment), ("Use it as heights", FileUse::Heights)];
const IMAGE: &[(&str, FileUse)] = &[("Use it as heights", FileUse::Heights), ("Use it as colours", FileUse::Colors)];

impl Offer {
    /// The uses of a file by its ending; `None` if the scene has none.
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        let (kind, uses) = match ending.as_str() {
            "binary" => ("a MERL BRDF", MATERIAL),
            "bsdf" => ("an RGL BRDF", MATERIAL),
            "bin" => ("a UTIA BRDF", MATERIAL),
            "npz" => ("a table of a BRDF", MATERIAL),
            "obj" => ("a mesh", MESH),
            "hdr" | "exr" => ("an image with a high dynamic range", PANORAMA),
            "png" | "jpg" | "jpeg" | "tif" | "tiff" => ("an image", IMAGE),
            _ => return None,
        };
        Some(Self { path: path.to_owned(), kind, uses })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_of_a_file_tells_its_uses() {
        let uses =
            |name: &str| Offer::of(Path::new(name)).map(|offer| offer.uses.iter().map(|one| one.1).collect::<Vec<_>>());
        assert_eq!(uses("a.BINARY"), Some(vec![FileUse::Material]));
        assert_eq!(uses("b/c.obj"), Some(vec![FileUse::Tile, FileUse::Object]));
        assert_eq!(uses("sky.hdr").unwrap()[0], FileUse::Environment);
        assert_eq!((uses("a.toml"), uses("a"), uses("a.txt")), (None, None, None));
    }
}
