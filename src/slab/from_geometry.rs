//! The distribution of slopes of a tile: every triangle with its area seen from above.

use glam::{DVec2, DVec3};

use super::ndf::Ndf;
use crate::base::{InputError, Result};
use crate::geometry::TileMesh;

/// The smallest z of a unit normal that faces up. Steeper triangles count as vertical: seen from above they have no area.
const LEAST_UP: f64 = 1e-4;

/// The normals of a tile that is turned by `rotation` [rad]. Grooves and pyramids have few slopes, which are exact;
/// one-dimensional relief has slopes on a line; other tiles become a table of `side` by `side` slopes.
///
/// # Errors
/// The surface overhangs, or leaves holes: then its normals alone do not say what light meets.
pub fn of_mesh(mesh: &TileMesh, rotation: f64, side: usize) -> Result<Ndf> {
    let error = |found: String, expected: &str| -> crate::base::Error {
        InputError::new("tile.geometry", found, expected).into()
    };
    if !mesh.closes_plane {
        return Err(error("a surface with holes".to_owned(), "a surface without holes, as a face of a slab"));
    }
    let turn = DVec2::from_angle(rotation);
    let mut facets = Vec::with_capacity(mesh.triangles.len());
    let mut seen = 0.0;
    for triangle in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
        let area_normal: DVec3 = 0.5 * (b - a).cross(c - a);
        let Some(normal) = area_normal.try_normalize() else { continue };
        if normal.z < -LEAST_UP {
            return Err(error(
                format!("triangle {} that faces down", triangle + 1),
                "a surface without overhangs, as a face of a slab: light passes an overhang more than once",
            ));
        }
        if normal.z > LEAST_UP {
            facets.push((turn.rotate(normal.truncate() / normal.z), area_normal.z));
            seen += area_normal.z;
        }
    }
    let base = f64::from(mesh.base_area());
    if (seen - base).abs() > 1e-2 * base {
        return Err(error(
            format!("surfaces that cover {:.1} % of the tile from above", 100.0 * seen / base),
            "one surface over each point, as a face of a slab",
        ));
    }
    Ndf::of_facets(&facets, side).ok_or_else(|| error("no surface".to_owned(), "a surface that faces up"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Geometry, Tile};

    fn mesh(geometry: &str) -> TileMesh {
        let geometry: Geometry = toml::from_str(geometry).unwrap();
        crate::geometry::build(&Tile::of(geometry), std::path::Path::new("")).unwrap()
    }

    #[test]
    fn pyramids_have_four_slopes_and_their_floor_is_level() {
        let ndf = of_mesh(&mesh("kind = \"pyramids\""), 0.0, 64).unwrap();
        let masses: Vec<f64> = ndf.facets(1).iter().map(|(_, mass)| *mass).collect();
        assert_eq!(masses.len(), 4, "{}", ndf.describe());
        assert!((masses.iter().sum::<f64>() + ndf.level() - 1.0).abs() < 1e-6);
        assert!(ndf.rough_moments().0.length() < 1e-6, "the mean slope of a closed surface is 0");
    }

    #[test]
    fn grooves_turned_by_90_degrees_have_slopes_along_the_other_axis() {
        let grooves = mesh("kind = \"grooves\"\nprofile = \"v\"\ncount = 4\ndepth = 0.1");
        let slopes = |rotation: f64| of_mesh(&grooves, rotation, 64).unwrap().facets(1);
        let turned = slopes(std::f64::consts::FRAC_PI_2);
        for ((a, _), (b, _)) in slopes(0.0).iter().zip(&turned) {
            assert!((a.length() - b.length()).abs() < 1e-6);
        }
        assert!(slopes(0.0).iter().all(|(slope, _)| slope.x.abs() < 1e-6 || slope.y.abs() < 1e-6));
    }

    #[test]
    fn tiles_of_a_millionth_and_of_a_million_units_have_the_same_slopes() {
        let slopes = |size: f32| {
            let geometry = format!("kind = \"pyramids\"\nheight = {}\nspacing = {}", 0.1 * size, 0.25 * size);
            let tile = Tile { size: glam::Vec2::splat(size), ..Tile::of(toml::from_str(&geometry).unwrap()) };
            of_mesh(&crate::geometry::build(&tile, std::path::Path::new("")).unwrap(), 0.0, 64).unwrap().facets(1)
        };
        for size in [1e-6, 1e6] {
            for ((a, p), (b, q)) in slopes(size).iter().zip(slopes(1.0)) {
                assert!((*a - b).length() < 1e-4 && (p - q).abs() < 1e-4, "{size}: {a} {b}");
            }
        }
    }

    #[test]
    fn overhangs_are_refused_with_the_reason() {
        for geometry in ["kind = \"rods\"", "kind = \"weave\""] {
            let error = of_mesh(&mesh(geometry), 0.0, 64).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains("as a face of a slab"), "{error}");
        }
    }
}
