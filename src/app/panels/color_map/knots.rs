//! Edits of stops. A knot is a value with one stop, or with several: a jump.

use crate::color_map::layers::stop_map;
use crate::scene::GradientStop;
use glam::Vec3;

/// Largest number of stops that the editor adds to a map.
const MAX_STOPS: usize = 256;

/// The values at which stops lie, ascending, each with the range of its stops.
pub fn knots(stops: &[GradientStop]) -> Vec<std::ops::Range<usize>> {
    let mut found: Vec<std::ops::Range<usize>> = Vec::new();
    for (k, stop) in stops.iter().enumerate() {
        match found.last_mut().filter(|knot| stops[knot.start].value == stop.value) {
            Some(knot) => knot.end = k + 1,
            None => found.push(k..k + 1),
        }
    }
    found
}

/// Moves a knot. It stays between its neighbours, at a distance of at least `gap`.
pub fn move_knot(stops: &mut [GradientStop], knot: usize, value: f64, gap: f64) {
    let all = knots(stops);
    let Some(range) = all.get(knot).cloned() else { return };
    let low = knot.checked_sub(1).map_or(f64::NEG_INFINITY, |k| stops[all[k].start].value + gap);
    let high = all.get(knot + 1).map_or(f64::INFINITY, |next| stops[next.start].value - gap);
    if value.is_finite() && low <= high {
        stops[range].iter_mut().for_each(|stop| stop.value = value.clamp(low, high));
    }
}

/// Adds a stop with the colour that the map has at a value. Returns its knot; `None` if a knot is closer than `gap`.
pub fn add_stop(stops: &mut Vec<GradientStop>, value: f64, gap: f64) -> Option<usize> {
    if stops.len() >= MAX_STOPS || !value.is_finite() || stops.iter().any(|stop| (stop.value - value).abs() < gap) {
        return None;
    }
    let color = stop_map(stops).color(value).as_vec3();
    let at = stops.partition_point(|stop| stop.value < value);
    stops.insert(at, GradientStop { value, color });
    knots(stops).iter().position(|knot| knot.start == at)
}

/// Removes a knot, unless it is the only one.
pub fn remove_knot(stops: &mut Vec<GradientStop>, knot: usize) -> bool {
    let all = knots(stops);
    let removes = all.len() > 1 && knot < all.len();
    if removes {
        stops.drain(all[knot].clone());
    }
    removes
}

/// Makes a knot a jump, or a single stop with the colour above the jump. A new jump goes to the colour of the next stop, or
/// comes from that of the previous one.
pub fn set_jump(stops: &mut Vec<GradientStop>, knot: usize, jump: bool) {
    let all = knots(stops);
    let Some(range) = all.get(knot).cloned() else { return };
    if jump == (range.len() > 1) {
        return;
    }
    let stop = stops[range.end - 1];
    if !jump {
        stops.drain(range.start..range.end - 1);
        return;
    }
    let (previous, next) = (range.start.checked_sub(1).map(|k| stops[k].color), stops.get(range.end));
    let (below, above) = match (previous, next.map(|stop| stop.color)) {
        (_, Some(next)) if next != stop.color => (stop.color, next),
        (Some(previous), _) if previous != stop.color => (previous, stop.color),
        _ => (stop.color, (Vec3::ONE - stop.color).max(Vec3::ZERO)),
    };
    stops[range.start].color = below;
    stops.insert(range.end, GradientStop { color: above, ..stop });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stops(values: &[(f64, f32)]) -> Vec<GradientStop> {
        values.iter().map(|&(value, grey)| GradientStop { value, color: Vec3::splat(grey) }).collect()
    }

    #[test]
    fn a_knot_stays_between_its_neighbours_and_a_jump_moves_as_one() {
        let mut map = stops(&[(-1.0, 0.0), (0.0, 0.2), (0.0, 0.7), (1.0, 1.0)]);
        assert_eq!(knots(&map), [0..1, 1..3, 3..4]);
        move_knot(&mut map, 1, 0.5, 0.01);
        assert_eq!(map, stops(&[(-1.0, 0.0), (0.5, 0.2), (0.5, 0.7), (1.0, 1.0)]));
        move_knot(&mut map, 1, 9.0, 0.01);
        assert_eq!(map[1].value, 0.99);
        move_knot(&mut map, 2, -9.0, 0.01);
        assert_eq!(map[3].value, 1.0);
        move_knot(&mut map, 0, f64::NAN, 0.01);
        assert_eq!(map[0].value, -1.0);
    }

    #[test]
    fn an_added_stop_changes_no_colour_and_the_last_knot_cannot_be_removed() {
        let mut map = stops(&[(0.0, 0.2), (1.0, 0.6)]);
        assert_eq!(add_stop(&mut map, 0.25, 0.01), Some(1));
        assert!((map[1].color.x - 0.3).abs() < 1e-6);
        assert_eq!(add_stop(&mut map, 0.251, 0.01), None);
        assert_eq!(add_stop(&mut map, 2.0, 0.01), Some(3));
        assert!((0..3).all(|_| remove_knot(&mut map, 0)) && !remove_knot(&mut map, 0));
        assert_eq!(map.len(), 1);
    }

    #[test]
    fn a_jump_takes_the_colour_of_its_neighbour_and_without_jump_the_upper_colour_stays() {
        let mut map = stops(&[(0.0, 0.25), (1.0, 0.75)]);
        set_jump(&mut map, 0, true);
        assert_eq!(map, stops(&[(0.0, 0.25), (0.0, 0.75), (1.0, 0.75)]));
        set_jump(&mut map, 1, true);
        assert_eq!(map, stops(&[(0.0, 0.25), (0.0, 0.75), (1.0, 0.75), (1.0, 0.25)]));
        set_jump(&mut map, 0, false);
        assert_eq!(map[0], stops(&[(0.0, 0.75)])[0]);
        let mut one = stops(&[(0.5, 0.125)]);
        set_jump(&mut one, 0, true);
        assert_eq!(one, stops(&[(0.5, 0.125), (0.5, 0.875)]));
    }
}
