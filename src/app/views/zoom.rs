//! Zoom of the object view: by a factor, and to a size of the tiles in pixels.

use crate::render::tile_view::on_object::TILE_RADII;
use crate::scene::{Camera, Scene};

/// Minimum distance of the camera, in radii of the object. Zooming further narrows the field of view.
const MIN_DISTANCE: f32 = 2.2;
const MAX_DISTANCE: f32 = 60.0;
/// Below this field of view [degrees], zooming out widens it and does not move the camera.
const NARROW_FOV: f32 = 14.0;
const MIN_FOV: f32 = 1.0;

/// Scales the camera's distance by a factor. Near the object the field of view narrows instead, until single tiles are
/// visible.
pub fn zoom(scene: &mut Scene, factor: f32, distance: f32) {
    let camera = scene.camera.get_or_insert_default();
    let from = if camera.distance > 0.0 { camera.distance } else { distance };
    let narrows = factor < 1.0 && from * factor < MIN_DISTANCE || factor > 1.0 && camera.fov_deg < NARROW_FOV;
    if narrows {
        camera.fov_deg = (camera.fov_deg * factor).clamp(MIN_FOV, Camera::default().fov_deg.max(camera.fov_deg));
        camera.distance = from;
    } else {
        camera.distance = (from * factor).clamp(MIN_DISTANCE.min(from), MAX_DISTANCE);
    }
}

/// Pixels per tile in a view of the object, at its nearest point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TileScale {
    /// Distance of a camera that frames the object by itself, in the object's radii.
    pub framing: f32,
    /// Height of the view in pixels.
    pub height: f32,
}

impl TileScale {
    /// `tan(fov / 2)` times the distance from the nearest point, over which pixels per tile are inverse.
    fn extent(fov_deg: f32, distance: f32) -> f32 {
        (0.5 * fov_deg.to_radians()).tan() * (distance - 1.0).max(1e-3)
    }

    fn of_extent(&self, extent: f32) -> f32 {
        0.5 * TILE_RADII * self.height / extent
    }

    pub fn pixels(&self, camera: &Camera) -> f32 {
        let distance = if camera.distance > 0.0 { camera.distance } else { self.framing };
        self.of_extent(Self::extent(camera.fov_deg, distance))
    }

    /// The smallest and the largest number of pixels that [`Self::set`] reaches.
    pub fn range(&self) -> (f32, f32) {
        let fov = Camera::default().fov_deg;
        (self.of_extent(Self::extent(fov, MAX_DISTANCE)), self.of_extent(Self::extent(MIN_FOV, MIN_DISTANCE)))
    }

    /// Moves the camera until tiles have this many pixels; near the object the field of view narrows instead.
    pub fn set(&self, camera: &mut Camera, pixels: f32) {
        let extent = self.of_extent(pixels.max(1e-3));
        let fov = Camera::default().fov_deg;
        let distance = 1.0 + extent / Self::extent(fov, 2.0);
        if distance >= MIN_DISTANCE {
            (camera.fov_deg, camera.distance) = (fov, distance.min(MAX_DISTANCE));
        } else {
            let half = (extent / (MIN_DISTANCE - 1.0)).atan();
            (camera.fov_deg, camera.distance) = ((2.0 * half).to_degrees().clamp(MIN_FOV, fov), MIN_DISTANCE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_that_was_set_shows_that_many_pixels_per_tile() {
        let scale = TileScale { framing: 4.2, height: 800.0 };
        let mut camera = Camera::default();
        let (least, most) = scale.range();
        assert!(least < 0.5 && most > 300.0, "{least} {most}");
        for pixels in [least, 1.0, 7.0, 25.0, 100.0, most] {
            scale.set(&mut camera, pixels);
            assert!((scale.pixels(&camera) / pixels - 1.0).abs() < 1e-3, "{pixels}: {camera:?}");
        }
        camera.distance = 0.0;
        let framed = scale.pixels(&camera);
        camera.distance = scale.framing;
        assert_eq!(scale.pixels(&camera), framed, "a camera that frames the object has its framing distance");
    }
}
