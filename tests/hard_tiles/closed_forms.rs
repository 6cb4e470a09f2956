//! Areas that both light and viewer see, in grooves and through holes.

use biscale::metrics::Pair;
use glam::{DVec2, Vec3};

/// Rectangular grooves without end. Lengths are in tile units.
#[derive(Debug, Clone, Copy)]
pub struct Grooves {
    pub depth: f64,
    pub pitch: f64,
    /// Width of the bottoms.
    pub width: f64,
    /// Azimuth of the direction across the grooves [degrees].
    pub azimuth_deg: f64,
}

/// A sheet with a lattice of square holes, one per `pitch` in x and in y. Lengths are in tile units.
#[derive(Debug, Clone, Copy)]
pub struct Holes {
    /// Height of the sheet above the floor.
    pub height: f64,
    pub side: f64,
    pub pitch: f64,
}

/// Horizontal displacement of a ray per unit of height.
fn slope(direction: Vec3) -> DVec2 {
    let direction = direction.as_dvec3();
    direction.truncate() / direction.z
}

impl Grooves {
    /// The unit vector across the grooves, to which the walls are normal.
    pub fn across(&self) -> Vec3 {
        DVec2::from_angle(self.azimuth_deg.to_radians()).extend(0.0).as_vec3()
    }

    /// Horizontal displacement of a ray across the grooves per unit of height.
    fn slope(&self, direction: Vec3) -> f64 {
        slope(direction).dot(DVec2::from_angle(self.azimuth_deg.to_radians()))
    }

    /// The area of the lands per base area.
    pub fn land(&self) -> f64 {
        1.0 - self.width / self.pitch
    }

    /// The area of the walls on one side that both directions see, per base area: those that face [`Grooves::across`]
    /// if `side` is 1, and the others if it is -1.
    pub fn wall(&self, pair: &Pair, side: f64) -> f64 {
        let visible = |direction| {
            let slope = side * self.slope(direction);
            if slope > 0.0 { self.width / slope } else { 0.0 }
        };
        self.depth.min(visible(pair.i)).min(visible(pair.o)) / self.pitch
    }

    /// The area of the bottoms that both directions see, per base area.
    pub fn bottom(&self, pair: &Pair) -> f64 {
        let [i, o] = [pair.i, pair.o].map(|direction| self.depth * self.slope(direction));
        // A point x of the bottom sees the light if 0 < x + i < width: then no wall is in the way.
        let (low, high) = (0.0_f64.max(-i).max(-o), self.width.min(self.width - i).min(self.width - o));
        (high - low).max(0.0) / self.pitch
    }
}

impl Holes {
    /// The area of the floor that both directions see, per base area.
    pub fn share(&self, pair: &Pair) -> f64 {
        // Light and viewer see the holes' images on the floor, displaced against each other.
        let displacement = self.height * (slope(pair.i) - slope(pair.o));
        let overlap = |d: f64| {
            let d = d - (d / self.pitch).floor() * self.pitch;
            (self.side - d).max(0.0) + (self.side - (self.pitch - d)).max(0.0)
        };
        overlap(displacement.x) * overlap(displacement.y) / self.pitch.powi(2)
    }
}
