//! The stages of an image of a slab: what lies behind the object, and the slab as a viewer sees it.

use glam::Vec3;

use super::{Backdrop, Plane, Pyramid};
use crate::base::Result;
use crate::cache::{Key, KeyBuilder};
use crate::geometry::image_file;
use crate::pipeline::{Env, Keyed, Pipeline, SlabOutcome, Stage};
use crate::render::lighting::environment::Environment;
use crate::scene::{Background, Checkerboard, LoadedScene};
use crate::slab::SlabView;

/// Texels along the side of a square of a checkerboard.
const SQUARE: usize = 128;

/// Builds the backdrop of a scene.
pub struct BuildBackdrop<'a> {
    loaded: &'a LoadedScene,
    environment: &'a Keyed<Environment>,
    /// Key of the image.
    file: Option<Key>,
    /// Smallest z of the object.
    rear: f32,
}

impl<'a> BuildBackdrop<'a> {
    /// `rear` is the smallest z of the object.
    pub fn new(loaded: &'a LoadedScene, pipeline: &Pipeline, environment: &'a Keyed<Environment>, rear: f32) -> Self {
        let path = loaded.scene.background.as_ref().and_then(Background::path);
        let file = path.map(|path| pipeline.file_key(&loaded.base_dir, path));
        Self { loaded, environment, file, rear }
    }

    fn plane(&self) -> Result<Option<Plane>> {
        Ok(match &self.loaded.scene.background {
            None | Some(Background::Environment {}) => None,
            Some(Background::Checkerboard(board)) => {
                let scale = SQUARE as f32 / board.size;
                Some(Plane { z: self.rear - board.distance, scale, origin: glam::Vec2::ZERO, pyramid: squares(board) })
            }
            Some(Background::Image(image)) => {
                let pixels = image_file::read_colors(&self.loaded.base_dir, &image.path)?;
                let size = [pixels.size.x as usize, pixels.size.y as usize];
                let scale = size[0] as f32 / image.size;
                let origin = 0.5 * pixels.size.as_vec2();
                let pyramid = Pyramid::new(size, pixels.values, true);
                Some(Plane { z: self.rear - image.distance, scale, origin, pyramid })
            }
        })
    }
}

/// Two by two squares, which repeat.
fn squares(board: &Checkerboard) -> Pyramid {
    let side = 2 * SQUARE;
    let texel = |k: usize| board.colors[(k % side / SQUARE + k / side / SQUARE) % 2];
    Pyramid::new([side; 2], (0..side * side).map(texel).collect::<Vec<Vec3>>(), true)
}

/// Draws the slopes of both faces that paths meet, and tabulates the lobes of drafts.
pub struct BuildView<'a> {
    pub outcome: &'a SlabOutcome,
}

impl Stage for BuildView<'_> {
    type Output = SlabView;
    const NAME: &'static str = "slab_view";
    const IGNORES_CANCEL: bool = true;

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("slab", &self.outcome.paths_key);
    }

    fn run(&self, _: &Env) -> Result<SlabView> {
        let slab = self.outcome.slab.clone();
        Ok(match &self.outcome.svbtdf {
            Some(sheet) => SlabView::of_sheet(slab, sheet.clone()),
            None => SlabView::new(slab),
        })
    }
}

impl Stage for BuildBackdrop<'_> {
    type Output = Backdrop;
    const NAME: &'static str = "backdrop";
    const IGNORES_CANCEL: bool = true;

    fn hash_into(&self, key: &mut KeyBuilder) {
        let light = &self.loaded.scene.light;
        key.key("environment", &self.environment.key).debug("background", &self.loaded.scene.background);
        key.numbers("placement", &[light.rotation_deg, light.intensity, self.rear]);
        if let Some(file) = &self.file {
            key.key("file", file);
        }
    }

    fn run(&self, _: &Env) -> Result<Backdrop> {
        let light = &self.loaded.scene.light;
        let rotation = light.rotation_deg.to_radians();
        Ok(Backdrop::new(&self.environment.value.map, rotation, light.intensity, self.plane()?))
    }
}
