//! Profile and path curves of objects: natural cubic splines and polylines with rounded corners.

use glam::{DVec2, DVec3};

/// A natural cubic spline through points, parameterised by chord length on [0, 1]. It is C², so that highlights on its
/// surfaces have no kinks.
pub(super) struct Spline {
    points: Vec<DVec3>,
    /// Parameter of each point.
    knots: Vec<f64>,
    /// Second derivatives at the points.
    curvatures: Vec<DVec3>,
}

impl Spline {
    pub fn through(points: &[[f64; 2]]) -> Self {
        let points: Vec<DVec3> = points.iter().map(|p| DVec3::new(p[0], p[1], 0.0)).collect();
        let mut knots = vec![0.0];
        for pair in points.windows(2) {
            knots.push(knots[knots.len() - 1] + pair[0].distance(pair[1]));
        }
        let total = knots[knots.len() - 1];
        knots.iter_mut().for_each(|knot| *knot /= total);
        let curvatures = natural_curvatures(&points, &knots);
        Self { points, knots, curvatures }
    }

    /// Returns the point at `t`; slightly outside [0, 1] the end pieces extrapolate.
    pub fn at(&self, t: f64) -> DVec3 {
        let last = self.points.len() - 2;
        let piece = self.knots.partition_point(|knot| *knot <= t).saturating_sub(1).min(last);
        let width = self.knots[piece + 1] - self.knots[piece];
        let (a, b) = ((self.knots[piece + 1] - t) / width, (t - self.knots[piece]) / width);
        let bend = (self.curvatures[piece] * (a * a * a - a) + self.curvatures[piece + 1] * (b * b * b - b))
            * (width * width / 6.0);
        self.points[piece] * a + self.points[piece + 1] * b + bend
    }

    /// Returns the unit tangent at `t`.
    pub fn tangent(&self, t: f64) -> DVec3 {
        (self.at(t + 1e-5) - self.at(t - 1e-5)).try_normalize().unwrap_or(DVec3::Y)
    }
}

/// Solves the tridiagonal system for the second derivatives that vanish at both ends.
fn natural_curvatures(points: &[DVec3], knots: &[f64]) -> Vec<DVec3> {
    let count = points.len();
    let mut curvatures = vec![DVec3::ZERO; count];
    let mut upper = vec![0.0; count];
    for k in 1..count - 1 {
        let (below, above) = (knots[k] - knots[k - 1], knots[k + 1] - knots[k]);
        let slopes = (points[k + 1] - points[k]) / above - (points[k] - points[k - 1]) / below;
        let pivot = 2.0 * (below + above) - below * upper[k - 1];
        upper[k] = above / pivot;
        curvatures[k] = (slopes * 6.0 - curvatures[k - 1] * below) / pivot;
    }
    for k in (1..count - 1).rev() {
        let next = curvatures[k + 1];
        curvatures[k] -= next * upper[k];
    }
    curvatures
}

enum Piece {
    Line { from: DVec2, to: DVec2 },
    Arc { center: DVec2, radius: f64, start: f64, sweep: f64 },
}

impl Piece {
    fn length(&self) -> f64 {
        match self {
            Self::Line { from, to } => from.distance(*to),
            Self::Arc { radius, sweep, .. } => radius * sweep.abs(),
        }
    }

    fn at(&self, fraction: f64) -> DVec2 {
        match self {
            Self::Line { from, to } => from.lerp(*to, fraction),
            Self::Arc { center, radius, start, sweep } => {
                *center + DVec2::from_angle(start + sweep * fraction) * *radius
            }
        }
    }
}

/// A polyline whose inner corners are rounded by arcs, parameterised by arc length on [0, 1].
pub(super) struct RoundedPolyline {
    pieces: Vec<Piece>,
    /// Parameter at which each piece ends.
    ends: Vec<f64>,
}

impl RoundedPolyline {
    /// `corners` are `(x, y, rounding radius)`; the radii of the first and the last are ignored. Neighbouring arcs must
    /// not overlap.
    pub fn new(corners: &[(f64, f64, f64)]) -> Self {
        let point = |corner: (f64, f64, f64)| DVec2::new(corner.0, corner.1);
        let mut pieces = Vec::new();
        let mut from = point(corners[0]);
        for three in corners.windows(3) {
            let corner = point(three[1]);
            let (back, forward) =
                ((point(three[0]) - corner).normalize_or_zero(), (point(three[2]) - corner).normalize_or_zero());
            let turn = (-back).angle_to(forward);
            let radius = three[1].2;
            let cut = radius * (turn.abs() / 2.0).tan();
            let start = corner + back * cut;
            pieces.push(Piece::Line { from, to: start });
            let inward = back.perp() * -turn.signum();
            let center = start + inward * radius;
            pieces.push(Piece::Arc { center, radius, start: (-inward).to_angle(), sweep: turn });
            from = corner + forward * cut;
        }
        pieces.push(Piece::Line { from, to: point(corners[corners.len() - 1]) });
        let total: f64 = pieces.iter().map(Piece::length).sum();
        let ends = pieces
            .iter()
            .scan(0.0, |sum, piece| {
                *sum += piece.length() / total;
                Some(*sum)
            })
            .collect();
        Self { pieces, ends }
    }

    pub fn at(&self, t: f64) -> DVec2 {
        let k = self.ends.partition_point(|end| *end < t).min(self.pieces.len() - 1);
        let start = if k == 0 { 0.0 } else { self.ends[k - 1] };
        self.pieces[k].at((t - start) / (self.ends[k] - start))
    }

    /// Returns parameters that divide each arc into steps of at most `max_turn` radians and each line into
    /// `line_steps`.
    pub fn parameters(&self, max_turn: f64, line_steps: usize) -> Vec<f64> {
        let mut parameters = vec![0.0];
        let mut start = 0.0;
        for (piece, &end) in self.pieces.iter().zip(&self.ends) {
            let steps = match piece {
                Piece::Line { .. } => line_steps,
                Piece::Arc { sweep, .. } => (sweep.abs() / max_turn).ceil() as usize,
            };
            parameters.extend((1..=steps).map(|k| start + (end - start) * k as f64 / steps as f64));
            start = end;
        }
        parameters
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spline_goes_through_its_points_and_reproduces_a_line() {
        let spline = Spline::through(&[[0.0, 0.0], [1.0, 2.0], [2.0, 1.0], [4.0, 0.0]]);
        for (point, knot) in spline.points.iter().zip(&spline.knots) {
            assert!(spline.at(*knot).distance(*point) < 1e-12);
        }
        let line = Spline::through(&[[0.0, 0.0], [1.0, 1.0], [4.0, 4.0]]);
        assert!(line.at(0.5).distance(DVec3::new(2.0, 2.0, 0.0)) < 1e-12);
        assert!(line.tangent(0.3).distance(DVec3::new(0.5f64.sqrt(), 0.5f64.sqrt(), 0.0)) < 1e-9);
    }

    #[test]
    fn a_rounded_corner_keeps_its_distance_and_its_length() {
        let curve = RoundedPolyline::new(&[(0.0, 0.0, 0.0), (1.0, 0.0, 0.25), (1.0, 1.0, 0.0)]);
        // Two lines of 0.75 and a quarter circle of radius 0.25 about (0.75, 0.25).
        let length: f64 = curve.pieces.iter().map(Piece::length).sum();
        assert!((length - (1.5 + 0.25 * std::f64::consts::FRAC_PI_2)).abs() < 1e-12);
        let middle = curve.at(0.5);
        assert!((middle.distance(DVec2::new(0.75, 0.25)) - 0.25).abs() < 1e-12);
        assert!(middle.x > 0.75 && middle.y < 0.25, "{middle}");
    }
}
