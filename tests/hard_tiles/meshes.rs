//! Meshes of hard tiles, as the text of OBJ files. Their materials are `floor`, `sheet` and `flakes`.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::closed_forms::Holes;

/// An OBJ file of quadrilaterals under construction.
#[derive(Default)]
struct Quads {
    text: String,
    corners: usize,
}

impl Quads {
    fn material(&mut self, name: &str) {
        let _ = writeln!(self.text, "usemtl {name}");
    }

    /// Adds a quadrilateral with counter-clockwise corners.
    fn add(&mut self, corners: [DVec3; 4]) {
        for corner in corners {
            let _ = writeln!(self.text, "v {:.7} {:.7} {:.7}", corner.x, corner.y, corner.z);
        }
        let [a, b, c, d] = [1, 2, 3, 4].map(|k| self.corners + k);
        let _ = writeln!(self.text, "f {a} {b} {c} {d}");
        self.corners += 4;
    }

    /// Starts with the unit square at z = 0.
    fn floor() -> Self {
        let mut quads = Self::default();
        quads.material("floor");
        quads.add([DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y]);
        quads
    }
}

/// Returns a sheet with square holes above a floor. With an underside, the surface is closed.
pub fn sheet(holes: &Holes, underside: bool) -> String {
    let mut quads = Quads::floor();
    quads.material("sheet");
    let count = (1.0 / holes.pitch).round() as usize;
    let (low, high) = (0.5 * (holes.pitch - holes.side), 0.5 * (holes.pitch + holes.side));
    for cell in 0..count * count {
        let origin = DVec3::new((cell % count) as f64, (cell / count) as f64, 0.0) * holes.pitch;
        let at = |x: f64, y: f64| origin + DVec3::new(x, y, holes.height);
        let square = |from: f64, to: f64| [at(from, from), at(to, from), at(to, to), at(from, to)];
        let (outer, inner) = (square(0.0, holes.pitch), square(low, high));
        for k in 0..4 {
            let next = (k + 1) % 4;
            let corners = [outer[k], outer[next], inner[next], inner[k]];
            quads.add(corners);
            if underside {
                quads.add([corners[0], corners[3], corners[2], corners[1]]);
            }
        }
    }
    quads.text
}

/// Returns square flakes that lie scattered just above a floor, one in each of `count` x `count` cells. Their sides are
/// `side` times those of the cells, and their tilts are at most `tilt_deg`.
pub fn flakes(count: usize, side: f64, tilt_deg: f64, seed: u64) -> String {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut quads = Quads::floor();
    quads.material("flakes");
    let cell = 1.0 / count as f64;
    let reach = 0.5_f64.sqrt() * side * cell;
    for k in 0..count * count {
        // The flake stays inside its cell.
        let mut inside = |at: usize| at as f64 * cell + reach + (cell - 2.0 * reach) * random.random::<f64>();
        let (x, y) = (inside(k % count), inside(k / count));
        let tilt = tilt_deg.to_radians() * random.random::<f64>().sqrt();
        let (around, turned) = (TAU * random.random::<f64>(), TAU * random.random::<f64>());
        let normal = DVec3::new(tilt.sin() * around.cos(), tilt.sin() * around.sin(), tilt.cos());
        let (u, v) = normal.any_orthonormal_pair();
        let centre = DVec3::new(x, y, reach * tilt_deg.to_radians().sin() + 1e-3);
        let corner = |k: f64| {
            let angle = turned + 0.25 * TAU * k;
            centre + (u * angle.cos() + v * angle.sin()) * reach
        };
        quads.add([0.0, 1.0, 2.0, 3.0].map(corner));
    }
    quads.text
}
