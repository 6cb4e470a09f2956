//! Undo and redo with named entries and bounded memory. A brush stroke stores only the image patches that it changed.

use std::collections::VecDeque;
use std::sync::Arc;

use crate::scene::{Painted, Pixels, Scene};
use glam::Vec3;

/// A change of one entry, with the values before and after it.
#[derive(Debug, Clone)]
pub enum Change {
    Scene {
        before: Arc<Scene>,
        after: Arc<Scene>,
    },
    /// The image was added, removed or resized.
    HeightImage {
        before: Option<Arc<Pixels<f32>>>,
        after: Option<Arc<Pixels<f32>>>,
    },
    ColorImage {
        before: Option<Arc<Pixels<Vec3>>>,
        after: Option<Arc<Pixels<Vec3>>>,
    },
    SlotImage {
        before: Option<Arc<Pixels<u8>>>,
        after: Option<Arc<Pixels<u8>>>,
    },
    Heights(Vec<ImagePatch<f32>>),
    Colors(Vec<ImagePatch<Vec3>>),
    Slots(Vec<ImagePatch<u8>>),
}

/// A rectangle of an image before and after a change.
#[derive(Debug, Clone, PartialEq)]
pub struct ImagePatch<T> {
    pub x: usize,
    pub y: usize,
    pub width: usize,
    pub before: Vec<T>,
    pub after: Vec<T>,
}

/// Side of an image patch [texels].
const PATCH_SIDE: usize = 16;

impl<T: Copy + PartialEq> ImagePatch<T> {
    /// Returns the patches in which two images of the same size differ.
    pub fn between(before: &Pixels<T>, after: &Pixels<T>) -> Vec<Self> {
        let (width, height) = (after.size.x as usize, after.size.y as usize);
        let mut patches = Vec::new();
        if before.size != after.size {
            return patches;
        }
        for y in (0..height).step_by(PATCH_SIDE) {
            for x in (0..width).step_by(PATCH_SIDE) {
                let columns = PATCH_SIDE.min(width - x);
                let cut = |image: &Pixels<T>| -> Vec<T> {
                    let rows = y..(y + PATCH_SIDE).min(height);
                    rows.flat_map(|row| image.values[row * width + x..row * width + x + columns].to_vec()).collect()
                };
                let (old, new) = (cut(before), cut(after));
                if old != new {
                    patches.push(Self { x, y, width: columns, before: old, after: new });
                }
            }
        }
        patches
    }

    fn apply(&self, image: &mut Pixels<T>, values: &[T]) {
        let width = image.size.x as usize;
        for (y, values) in values.chunks(self.width.max(1)).enumerate() {
            let start = (self.y + y) * width + self.x;
            if let Some(row) = image.values.get_mut(start..start + values.len()) {
                row.copy_from_slice(values);
            }
        }
    }
}

/// The part of a document that undo and redo change.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    pub scene: Arc<Scene>,
    pub painted: Painted,
}

impl Change {
    /// Applies this change to `state` (`forward`) or reverts it.
    fn apply(&self, state: &mut State, forward: bool) {
        match self {
            Self::Scene { before, after } => state.scene = if forward { after } else { before }.clone(),
            Self::HeightImage { before, after } => {
                state.painted.heights = if forward { after } else { before }.clone();
            }
            Self::ColorImage { before, after } => state.painted.colors = if forward { after } else { before }.clone(),
            Self::SlotImage { before, after } => state.painted.slots = if forward { after } else { before }.clone(),
            Self::Heights(patches) => apply_patches(&mut state.painted.heights, patches, forward),
            Self::Colors(patches) => apply_patches(&mut state.painted.colors, patches, forward),
            Self::Slots(patches) => apply_patches(&mut state.painted.slots, patches, forward),
        }
    }

    fn bytes(&self) -> usize {
        let image = |size: Option<glam::UVec2>, texel: usize| size.map_or(0, |s| (s.x * s.y) as usize * texel);
        match self {
            Self::Scene { after, .. } => scene_bytes(after),
            Self::HeightImage { before, .. } => image(before.as_ref().map(|image| image.size), 4),
            Self::ColorImage { before, .. } => image(before.as_ref().map(|image| image.size), 12),
            Self::SlotImage { before, .. } => image(before.as_ref().map(|image| image.size), 1),
            Self::Heights(patches) => patches.iter().map(|patch| 64 + 8 * patch.before.len()).sum(),
            Self::Colors(patches) => patches.iter().map(|patch| 64 + 24 * patch.before.len()).sum(),
            Self::Slots(patches) => patches.iter().map(|patch| 64 + 2 * patch.before.len()).sum(),
        }
    }
}

fn apply_patches<T: Copy + PartialEq>(image: &mut Option<Arc<Pixels<T>>>, patches: &[ImagePatch<T>], forward: bool) {
    if let Some(image) = image {
        let image = Arc::make_mut(image);
        for patch in patches {
            patch.apply(image, if forward { &patch.after } else { &patch.before });
        }
    }
}

fn scene_bytes(scene: &Scene) -> usize {
    let heights = match &scene.tile.geometry {
        crate::scene::Geometry::Heightfield(field) => {
            field.values.as_ref().map_or(0, |rows| rows.iter().map(|row| 24 + 4 * row.len()).sum())
        }
        _ => 0,
    };
    1024 + 256 * scene.materials.len() + heights
}

#[derive(Debug, Clone)]
struct Entry {
    name: String,
    changes: Vec<Change>,
    /// Identifier of the state after this entry.
    state: u64,
    /// True if further edits of the same name join this entry.
    open: bool,
    bytes: usize,
}

/// Entries before and after the present state.
#[derive(Debug)]
pub struct History {
    undo: VecDeque<Entry>,
    redo: Vec<Entry>,
    /// Identifier of the state before the first entry.
    base: u64,
    next: u64,
    bytes: usize,
    budget: usize,
}

impl History {
    /// Makes an empty history. If the entries exceed `budget` bytes, the oldest are dropped.
    pub fn new(budget: usize) -> Self {
        Self { undo: VecDeque::new(), redo: Vec::new(), base: 0, next: 1, bytes: 0, budget }
    }

    /// Returns the identifier of the current state. Undo followed by redo gives the same identifier.
    pub fn state(&self) -> u64 {
        self.undo.back().map_or(self.base, |entry| entry.state)
    }

    /// Adds an entry. A scene edit joins the last entry if that is open and has the same name.
    pub fn push(&mut self, name: &str, changes: Vec<Change>) {
        self.clear_redo();
        let state = self.next;
        self.next += 1;
        if let ([Change::Scene { after, .. }], Some(last)) = (changes.as_slice(), self.undo.back_mut())
            && last.open
            && last.name == name
            && let [Change::Scene { after: joined, .. }] = last.changes.as_mut_slice()
        {
            *joined = after.clone();
            last.state = state;
            return;
        }
        let bytes = 256 + changes.iter().map(Change::bytes).sum::<usize>();
        self.bytes += bytes;
        self.undo.push_back(Entry { name: name.to_owned(), changes, state, open: true, bytes });
        while self.bytes > self.budget && self.undo.len() > 1 {
            if let Some(oldest) = self.undo.pop_front() {
                self.base = oldest.state;
                self.bytes -= oldest.bytes;
            }
        }
    }

    /// Closes the last entry, so that the next edit starts a new one.
    pub fn close(&mut self) {
        if let Some(last) = self.undo.back_mut() {
            last.open = false;
        }
    }

    pub fn undo(&mut self, state: &mut State) -> Option<String> {
        let mut entry = self.undo.pop_back()?;
        entry.changes.iter().rev().for_each(|change| change.apply(state, false));
        entry.open = false;
        self.bytes -= entry.bytes;
        let name = entry.name.clone();
        self.redo.push(entry);
        Some(name)
    }

    pub fn redo(&mut self, state: &mut State) -> Option<String> {
        let entry = self.redo.pop()?;
        entry.changes.iter().for_each(|change| change.apply(state, true));
        let name = entry.name.clone();
        self.bytes += entry.bytes;
        self.undo.push_back(entry);
        Some(name)
    }

    fn clear_redo(&mut self) {
        self.redo.clear();
    }

    pub fn undo_name(&self) -> Option<&str> {
        self.undo.back().map(|entry| entry.name.as_str())
    }

    pub fn redo_name(&self) -> Option<&str> {
        self.redo.last().map(|entry| entry.name.as_str())
    }

    /// Number of entries that can be undone.
    #[cfg(test)]
    pub fn len(&self) -> usize {
        self.undo.len()
    }

    /// Bytes of the entries that can be undone.
    #[cfg(test)]
    pub fn bytes(&self) -> usize {
        self.bytes
    }
}
