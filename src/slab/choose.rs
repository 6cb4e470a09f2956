//! Difference of Eq. 11 from Eq. 1 on fixed pairs of directions.

use glam::{DVec2, DVec3};

use super::faces::FaceSum;
use super::fresnel::refract;
use super::model::{Method, Slab};
use super::ndf::normal;
use super::spread::r2;

/// Polar angles of the light [degrees], and pairs of each.
const ANGLES_DEG: [f64; 4] = [15.0, 40.0, 60.0, 72.0];
const PAIRS: usize = 8;
/// Facets of the sum that Eq. 11 is compared with.
const FACETS: usize = 256;

/// Root mean square over four angles of the relative L2 of Eq. 11 against a sum over 256 facets (Eq. 1), for light that
/// passes once; 32 pairs. 0 if a face is smooth, because Eq. 11 is then exact.
pub fn dual_error(slab: &Slab) -> f64 {
    if slab.top.rough() * slab.bottom.rough() <= 0.0 {
        return 0.0;
    }
    let dual = Slab { method: Method::Dual, ..slab.clone() };
    let facets = Some(std::sync::Arc::new(FaceSum::new(&slab.top, &slab.bottom, FACETS)));
    let faces = Slab { method: Method::Faces, facets, ..slab.clone() };
    let mut squares = 0.0;
    for (turn, degrees) in ANGLES_DEG.into_iter().enumerate() {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let azimuth = DVec2::from_angle(0.4 + 1.7 * turn as f64);
        let i = (sin * azimuth).extend(cos);
        let (dual, faces) = (dual.row(i), faces.row(i));
        let (mut difference, mut norm) = (0.0, 0.0);
        for o in directions(slab, i) {
            let (a, b) = (dual.single_pass(o), faces.single_pass(o));
            difference += (a - b).length_squared();
            norm += b.length_squared();
        }
        squares += if norm > 0.0 { difference / norm } else { 0.0 };
    }
    (squares / ANGLES_DEG.len() as f64).sqrt()
}

/// Directions in which pairs of facets refract light from `i`.
fn directions(slab: &Slab, i: DVec3) -> Vec<DVec3> {
    let eta = slab.optics.eta.x;
    let mut found = Vec::new();
    for k in 0..8 * PAIRS {
        let ([a, b], [c, d]) = (r2(k), r2(1000 + 7 * k));
        let rough = |face: &super::Ndf, u: f64, v: f64| face.facet(u * face.rough() * (1.0 - 1e-12), v).0;
        let through = refract(-i, normal(rough(&slab.top, a, b)), eta);
        let out = through.and_then(|d_in| refract(d_in, normal(rough(&slab.bottom, c, d)), 1.0 / eta));
        if let Some(o) = out.filter(|o| o.z < -0.05) {
            found.push(o);
        }
        if found.len() == PAIRS {
            break;
        }
    }
    found
}
