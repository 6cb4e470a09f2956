//! Images painted over the tile: heights, colour weights, material slots. The scene names each image. Adding, removing
//! and painting an image are history entries.

use std::path::PathBuf;
use std::sync::Arc;

use crate::scene::{Geometry, Heightfield, Painted, Pixels, Scene};
use glam::Vec3;

use super::{Change, Document, ImagePatch};

impl Document {
    /// Drops painted images that the user replaced by another file.
    pub(super) fn dropped_images(&mut self, before: &Scene, after: &Scene) -> Vec<Change> {
        let mut changes = Vec::new();
        let painted = &mut self.state.painted;
        if let (Geometry::Heightfield(old), Geometry::Heightfield(new)) = (&before.tile.geometry, &after.tile.geometry)
            && (&old.path, &old.values) != (&new.path, &new.values)
            && let Some(image) = painted.heights.take()
        {
            changes.push(Change::HeightImage { before: Some(image), after: None });
        }
        if before.tile.color_path != after.tile.color_path
            && let Some(image) = painted.colors.take()
        {
            changes.push(Change::ColorImage { before: Some(image), after: None });
        }
        if before.tile.slot_path != after.tile.slot_path
            && let Some(image) = painted.slots.take()
        {
            changes.push(Change::SlotImage { before: Some(image), after: None });
        }
        changes
    }

    /// Replaces the heights by a painted image. The geometry becomes a height field.
    pub fn paint_heights(&mut self, name: &str, heights: Pixels<f32>, height_scale: Option<f32>) {
        let mut scene = (*self.state.scene).clone();
        let mut field = match scene.tile.geometry {
            Geometry::Heightfield(field) => field,
            _ => Heightfield { height_scale: 0.2, ..Heightfield::default() },
        };
        (field.path, field.values) = (Some(self.image_file("heights.exr")), None);
        field.height_scale = height_scale.unwrap_or(field.height_scale);
        scene.tile.geometry = Geometry::Heightfield(field);
        let after = Some(Arc::new(heights));
        let before = std::mem::replace(&mut self.state.painted.heights, after.clone());
        self.push_image(name, scene, Change::HeightImage { before, after });
    }

    /// Sets or removes the painted colours.
    pub fn paint_colors(&mut self, name: &str, colors: Option<Pixels<Vec3>>) {
        let mut scene = (*self.state.scene).clone();
        scene.tile.color_path = colors.as_ref().map(|_| self.image_file("colors.exr"));
        let after = colors.map(Arc::new);
        let before = std::mem::replace(&mut self.state.painted.colors, after.clone());
        self.push_image(name, scene, Change::ColorImage { before, after });
    }

    /// Sets or removes the painted materials. `scene` contains them.
    pub fn paint_slots(&mut self, name: &str, mut scene: Scene, slots: Option<Pixels<u8>>) {
        scene.tile.slot_path = slots.as_ref().map(|_| self.image_file("materials.png"));
        let after = slots.map(Arc::new);
        let before = std::mem::replace(&mut self.state.painted.slots, after.clone());
        self.push_image(name, scene, Change::SlotImage { before, after });
    }

    /// Returns the file name of a painted image, beside the scene.
    fn image_file(&self, suffix: &str) -> PathBuf {
        PathBuf::from(format!("{}_{suffix}", self.name))
    }

    fn push_image(&mut self, name: &str, scene: Scene, image: Change) {
        let mut changes = Vec::new();
        if scene != *self.state.scene {
            let after = Arc::new(scene);
            let before = std::mem::replace(&mut self.state.scene, after.clone());
            changes.push(Change::Scene { before, after });
        }
        changes.push(image);
        self.push(name, changes);
    }

    /// Displays a stroke while the user draws it. [`Document::end_stroke`] adds it to the history.
    pub fn show_stroke(&mut self, painted: Painted) {
        self.state.painted = painted;
        self.version += 1;
    }

    /// Adds the stroke that led from `before` to the current images as one entry.
    pub fn end_stroke(&mut self, name: &str, before: &Painted) {
        let current = &self.state.painted;
        let mut changes = Vec::new();
        changes.extend(patches(&before.heights, &current.heights).map(Change::Heights));
        changes.extend(patches(&before.colors, &current.colors).map(Change::Colors));
        changes.extend(patches(&before.slots, &current.slots).map(Change::Slots));
        if !changes.is_empty() {
            self.push(name, changes);
        }
    }
}

/// Returns the patches in which two images differ; `None` if they are equal.
fn patches<T: Copy + PartialEq>(
    before: &Option<Arc<Pixels<T>>>,
    after: &Option<Arc<Pixels<T>>>,
) -> Option<Vec<ImagePatch<T>>> {
    let (Some(before), Some(after)) = (before, after) else { return None };
    let found = if Arc::ptr_eq(before, after) { Vec::new() } else { ImagePatch::between(before, after) };
    (!found.is_empty()).then_some(found)
}
