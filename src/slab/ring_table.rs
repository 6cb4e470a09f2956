//! Values over the polar angles of light and viewer and the azimuth between them.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

/// Rings of the polar angle, for the light and for the viewer.
pub const RINGS: usize = 24;
/// Steps of the azimuth between light and viewer, 0 to 180°.
pub const TURNS: usize = 12;

/// A table by ring of the light, ring of the viewer and azimuth.
#[derive(Debug, Clone, PartialEq)]
pub struct RingTable {
    values: Vec<f32>,
}

impl RingTable {
    /// Number of values.
    pub const LEN: usize = RINGS * RINGS * TURNS;

    /// A table of [`Self::LEN`] values; missing ones are 0.
    pub fn new(mut values: Vec<f32>) -> Self {
        values.resize(Self::LEN, 0.0);
        Self { values }
    }

    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Adds a table times a factor.
    pub fn add(&mut self, factor: f32, other: &Self) {
        self.values.iter_mut().zip(&other.values).for_each(|(sum, value)| *sum += factor * value);
    }

    /// The value at a pair of directions, linear in both polar angles and in the azimuth between the directions of travel of
    /// straight light.
    pub fn read(&self, i: DVec3, o: DVec3) -> f64 {
        self.read_at(i, o, ring_taps(i), ring_taps(o))
    }

    /// The value at a pair of directions whose rings have these weights.
    pub(super) fn read_at(&self, i: DVec3, o: DVec3, a: [(usize, f64); 2], b: [(usize, f64); 2]) -> f64 {
        let turn = turn(i, o) / PI * TURNS as f64 - 0.5;
        let (low, t) = (turn.floor(), turn - turn.floor());
        let turns = [low.max(0.0) as usize, (low + 1.0).min((TURNS - 1) as f64) as usize];
        let mut sum = 0.0;
        for (ring_i, u) in a {
            for (ring_o, v) in b {
                let at = (ring_i * RINGS + ring_o) * TURNS;
                let values = turns.map(|turn| f64::from(self.values[at + turn]));
                sum += u * v * ((1.0 - t) * values[0] + t * values[1]);
            }
        }
        sum
    }

    /// Light and viewer exchanged.
    pub fn transposed(&self) -> Self {
        Self { values: (0..Self::LEN).map(|k| self.values[transposed(k)]).collect() }
    }

    /// Integral over the viewers of each ring of the light, by projected solid angle.
    pub fn totals(&self) -> [f64; RINGS] {
        let of_viewers = |(ring, values): (usize, &[f32])| {
            projected_solid_angle(ring) / TURNS as f64 * values.iter().map(|value| f64::from(*value)).sum::<f64>()
        };
        let row = |ring: usize| &self.values[ring * RINGS * TURNS..(ring + 1) * RINGS * TURNS];
        std::array::from_fn(|ring| row(ring).chunks_exact(TURNS).enumerate().map(of_viewers).sum())
    }
}

/// Index of the entry with light and viewer exchanged.
pub(super) fn transposed(k: usize) -> usize {
    (k / TURNS % RINGS * RINGS + k / TURNS / RINGS) * TURNS + k % TURNS
}

/// The ring of a direction.
pub(super) fn ring_of(w: DVec3) -> usize {
    ((w.z.abs().min(1.0).acos() / FRAC_PI_2 * RINGS as f64) as usize).min(RINGS - 1)
}

/// The step of the azimuth between two directions.
pub(super) fn turn_of(i: DVec3, o: DVec3) -> usize {
    ((turn(i, o) / PI * TURNS as f64) as usize).min(TURNS - 1)
}

/// Angle between the azimuths of `-i` and `o`, 0 to π.
fn turn(i: DVec3, o: DVec3) -> f64 {
    let (a, b) = (-i.truncate(), o.truncate());
    if a.length_squared() * b.length_squared() <= 1e-24 { FRAC_PI_2 } else { a.perp_dot(b).atan2(a.dot(b)).abs() }
}

/// The two rings around a direction, with weights.
pub fn ring_taps(w: DVec3) -> [(usize, f64); 2] {
    let theta = w.z.abs().min(1.0).acos();
    let at = (theta / FRAC_PI_2 * RINGS as f64 - 0.5).clamp(0.0, (RINGS - 1) as f64);
    let low = (at as usize).min(RINGS - 2);
    [(low, 1.0 - (at - low as f64)), (low + 1, at - low as f64)]
}

/// Squared sine of the lower edge of a ring.
pub(super) fn edge(ring: usize) -> f64 {
    (ring as f64 / RINGS as f64 * FRAC_PI_2).sin().powi(2)
}

/// Projected solid angle of a ring [sr].
pub(super) fn projected_solid_angle(ring: usize) -> f64 {
    PI * (edge(ring + 1) - edge(ring))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_reads_back_and_its_totals_are_pi_times_it() {
        let table = RingTable::new(vec![0.5; RingTable::LEN]);
        for degrees in [0.0, 30.0, 89.9_f64] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            assert!((table.read(DVec3::new(sin, 0.0, cos), DVec3::new(0.6, 0.0, -0.8)) - 0.5).abs() < 1e-6);
        }
        assert!(table.totals().iter().all(|total| (total - 0.5 * PI).abs() < 1e-6));
    }

    #[test]
    fn transposed_tables_exchange_light_and_viewer() {
        let table = RingTable::new((0..RingTable::LEN).map(|k| (k as f32 * 0.37).sin()).collect());
        let (i, o) = (DVec3::new(0.6, 0.1, 0.7).normalize(), DVec3::new(-0.2, 0.3, -0.9).normalize());
        assert!((table.transposed().read(i, o) - table.read(o, i)).abs() < 1e-12);
        assert_eq!(table.transposed().transposed(), table);
    }
}
