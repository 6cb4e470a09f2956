//! Reader of isotropic `.npz` exports of this program: arrays of f32 stored in a ZIP archive.

use std::path::Path;

use glam::DVec3;

use super::HalfDifferenceTable;
use super::spherical::{SphericalTable, even_turn};
use crate::base::npz::arrays;
use crate::base::{InputError, Result, regular_file};

/// Largest file in bytes: the largest export has 2^25 pairs of two quantities.
const MAX_FILE: u64 = 1 << 30;
/// Largest relative L2 difference between azimuths of a table that counts as isotropic.
const MAX_ANISOTROPY: f64 = 0.05;

pub(crate) fn load(path: &Path) -> Result<HalfDifferenceTable> {
    let name = path.file_stem().map_or_else(|| path.display().to_string(), |stem| stem.to_string_lossy().into_owned());
    let read = || {
        let unreadable = |error: std::io::Error| InputError::new("", error, "an .npz export that can be read");
        let length = std::fs::metadata(path).map_err(unreadable)?.len();
        if length > MAX_FILE {
            return Err(InputError::new("file size", format!("{length} bytes"), format!("at most {MAX_FILE} bytes")));
        }
        table(&regular_file::read(path).map_err(unreadable)?)
    };
    let table = read().map_err(|error| error.in_file(path))?;
    Ok(table.resample(name))
}

fn table(bytes: &[u8]) -> std::result::Result<SphericalTable, InputError> {
    let arrays = arrays(bytes)?;
    let axis = |name: &str| -> std::result::Result<Vec<f64>, InputError> {
        let (shape, values) = arrays.get(name).ok_or_else(|| missing(name))?;
        let values: Vec<f64> = values.iter().map(|&value| f64::from(value)).collect();
        if shape.len() != 1 || values.is_empty() || !values.windows(2).all(|pair| pair[0] < pair[1]) {
            return Err(InputError::new(format!("array \"{name}\""), format!("shape {shape:?}"), "increasing angles"));
        }
        Ok(values)
    };
    let (theta_i, phi_i, theta_o, phi_o) = (axis("theta_i")?, axis("phi_i")?, axis("theta_o")?, axis("phi_o")?);
    let (shape, brdf) = arrays.get("brdf").ok_or_else(|| missing("brdf"))?;
    let expected = [theta_i.len(), phi_i.len(), theta_o.len(), phi_o.len(), 3];
    if *shape != expected {
        return Err(InputError::new(
            "array \"brdf\"",
            format!("shape {shape:?}"),
            format!("{expected:?}, as the axes"),
        ));
    }
    if phi_i.len() != phi_o.len() || !even_turn(&phi_i) || !even_turn(&phi_o) {
        let found = format!("{} and {} azimuths", phi_i.len(), phi_o.len());
        return Err(InputError::new("arrays \"phi_i\", \"phi_o\"", found, "the same even steps over a full turn"));
    }
    let (triples, _) = brdf.as_chunks::<3>();
    let values: Vec<DVec3> = triples.iter().map(|rgb| glam::Vec3::from_array(*rgb).as_dvec3()).collect();
    if let Some(at) = values.iter().position(|value| !value.is_finite()) {
        return Err(InputError::new(format!("array \"brdf\", pair {at}"), values[at], "finite numbers"));
    }
    let azimuths = phi_i.len();
    let table = SphericalTable { theta_i, theta_o, azimuths, values };
    let anisotropy = table.anisotropy();
    if anisotropy > MAX_ANISOTROPY {
        let found = format!("values that change by {:.0} % over {azimuths} azimuths", 100.0 * anisotropy);
        return Err(InputError::new("array \"brdf\"", found, "an isotropic table")
            .with_hint("anisotropic BRDFs depend on a tangent direction, which facets do not have"));
    }
    Ok(table)
}

fn missing(name: &str) -> InputError {
    InputError::new("archive", format!("no array \"{name}\""), "an .npz that `biscale export` wrote")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_are_no_export_are_refused_without_a_panic() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npz");
        let attempt = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            let error = load(&path).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            error.to_string()
        };
        assert!(attempt(b"not a zip").contains("header"));
        assert!(attempt(b"PK\x03\x04").contains("byte 0"));
        let mut member = b"PK\x03\x04".to_vec();
        member.resize(30, 0xff);
        assert!(attempt(&member).contains("byte 0"));
        let mut empty = b"PK\x03\x04".to_vec();
        empty.resize(30, 0);
        assert!(attempt(&empty).contains("no array"));
    }
}
