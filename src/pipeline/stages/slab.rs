//! Slabs: the normals of each face, their correlation, and the light of inner reflections.

use std::path::Path;
use std::sync::Arc;

use glam::DVec2;

use super::BuildTile;
use crate::base::{Error, InputError, Result};
use crate::cache::{Key, KeyBuilder};
use crate::geometry;
use crate::pipeline::Env;
use crate::pipeline::stage::{Keyed, Stage};
use crate::plan::SlabSettings;
use crate::scene::{self, LoadedScene, SlabFace};
use crate::slab::capture::svbtdf::{MeanBtdf, Svbtdf};
use crate::slab::{self, Inner, Ndf, Optics, Profile, Spread, table_file, virtual_face};

/// The normals of a face.
#[derive(Debug)]
pub struct FaceNormals {
    pub ndf: Arc<Ndf>,
    /// Height of the relief [tile units]; 0 for a face without geometry.
    pub relief: f64,
}

/// Computes the normals of a face.
pub struct BuildFace<'a> {
    /// `top` or `bottom`.
    pub side: &'static str,
    pub face: &'a SlabFace,
    loaded: &'a LoadedScene,
    /// The scene whose tile the face is.
    tile: Option<LoadedScene>,
    /// Key of the tile or of the table.
    file: Option<Key>,
    table_side: usize,
}

/// Largest file of a table of slopes [bytes].
const MAX_TABLE: u64 = 64 << 20;

impl<'a> BuildFace<'a> {
    /// # Errors
    /// The face names a scene that cannot be read, or that leads back to itself.
    pub fn new(
        loaded: &'a LoadedScene,
        (side, face): (&'static str, &'a SlabFace),
        settings: &SlabSettings,
        env: &Env,
    ) -> Result<Self> {
        let tile = match face {
            SlabFace::Tile(tile) => Some(tile_scene(loaded, side, tile.scene.as_deref())?),
            _ => None,
        };
        let file = match (&tile, face) {
            (Some(tile), _) => Some(BuildTile::new(tile, env).surface()),
            (None, SlabFace::Table(table)) => Some(env.file_key(&loaded.base_dir, &table.path)),
            _ => None,
        };
        Ok(Self { side, face, loaded, tile, file, table_side: settings.face_table })
    }

    fn rotation(&self) -> f64 {
        let degrees = match self.face {
            SlabFace::Smooth {} => 0.0,
            SlabFace::Beckmann(face) | SlabFace::Ggx(face) => face.rotation_deg,
            SlabFace::Table(face) => face.rotation_deg,
            SlabFace::Tile(face) => face.rotation_deg,
        };
        f64::from(degrees).to_radians()
    }
}

/// The scene whose tile is a face: the slab's own, or the one that it names. Scenes that name each other in a circle are
/// refused.
fn tile_scene(loaded: &LoadedScene, side: &str, named: Option<&Path>) -> Result<LoadedScene> {
    let Some(mut named) = named.map(Path::to_owned) else { return Ok(loaded.clone()) };
    let place = format!("slab.{side}.scene");
    let mut base_dir = loaded.base_dir.clone();
    let mut visited = Vec::new();
    let mut first = None;
    loop {
        let full = scene::files::resolve(&base_dir, &named);
        let canonical = full.canonicalize().unwrap_or_else(|_| full.clone());
        if visited.contains(&canonical) {
            let found = format!("`{}`, which leads back to itself", named.display());
            return Err(InputError::new(place, found, "scenes that do not name each other in a circle").into());
        }
        visited.push(canonical);
        let name =
            if full.exists() { full.to_string_lossy().into_owned() } else { named.to_string_lossy().into_owned() };
        let next = scene::open(&name, &[])?;
        let faces = next.scene.slab.iter().flat_map(|slab| slab.faces());
        let onward = faces
            .filter_map(|(_, face)| if let SlabFace::Tile(tile) = face { tile.scene.clone() } else { None })
            .next();
        base_dir.clone_from(&next.base_dir);
        let first = first.get_or_insert(next);
        match onward {
            Some(onward) => named = onward,
            None => return Ok(first.clone()),
        }
    }
}

impl Stage for BuildFace<'_> {
    type Output = FaceNormals;
    const NAME: &'static str = "slab_face";

    fn slot(&self) -> &'static str {
        if self.side == "top" { "slab_top" } else { "slab_bottom" }
    }

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.debug("face", self.face).counts("table", [self.table_side]);
        if let Some(file) = &self.file {
            key.key("file", file);
        }
    }

    fn run(&self, _: &Env) -> Result<FaceNormals> {
        let analytic = |profile, face: &scene::RoughFace| {
            Ndf::analytic(
                profile,
                DVec2::new(f64::from(face.roughness.x), f64::from(face.roughness.y)),
                self.rotation(),
            )
        };
        let mut relief = 0.0;
        let ndf = match self.face {
            SlabFace::Smooth {} => Ndf::smooth(),
            SlabFace::Beckmann(face) => analytic(Profile::Beckmann, face),
            SlabFace::Ggx(face) => analytic(Profile::Ggx, face),
            SlabFace::Table(face) => {
                let path = scene::files::resolve(&self.loaded.base_dir, &face.path);
                let bytes = scene::files::read(&self.loaded.base_dir, &face.path, MAX_TABLE)?;
                let text = std::str::from_utf8(&bytes)
                    .map_err(|error| InputError::new("", error, "a CSV table (UTF-8)").in_file(&path))?;
                table_file::read(text, f64::from(face.span), self.rotation()).map_err(|error| error.in_file(&path))?
            }
            SlabFace::Tile(_) => {
                let LoadedScene { scene, base_dir, painted, .. } = self.tile.as_ref().unwrap_or(self.loaded);
                let mesh = geometry::build_painted(&scene.tile, base_dir, painted)?;
                let (low, high) = mesh.z_range();
                relief = f64::from(high - low);
                slab::of_mesh(&mesh, self.rotation(), self.table_side).map_err(|error| self.of_side(error))?
            }
        };
        Ok(FaceNormals { ndf: Arc::new(ndf), relief })
    }
}

impl BuildFace<'_> {
    /// Puts the key of the face before the place of an error.
    fn of_side(&self, error: Error) -> Error {
        match error {
            Error::Input(mut input) => {
                input.place = format!("slab.{} ({})", self.side, input.place);
                Error::Input(input)
            }
            other => other,
        }
    }
}

/// A captured sheet.
#[derive(Debug)]
pub struct CapturedSheet {
    pub svbtdf: Arc<Svbtdf>,
    pub mean: Arc<MeanBtdf>,
}

/// Reads a captured sheet.
pub struct ReadSvbtdf<'a> {
    loaded: &'a LoadedScene,
    path: &'a Path,
    file: Key,
}

impl<'a> ReadSvbtdf<'a> {
    pub fn new(loaded: &'a LoadedScene, path: &'a Path, env: &Env) -> Self {
        Self { loaded, path, file: env.file_key(&loaded.base_dir, path) }
    }
}

impl Stage for ReadSvbtdf<'_> {
    type Output = CapturedSheet;
    const NAME: &'static str = "slab_svbtdf";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("file", &self.file);
    }

    fn run(&self, _: &Env) -> Result<CapturedSheet> {
        let svbtdf = Svbtdf::of_scene(&self.loaded.base_dir, self.path)?;
        let mean = Arc::new(svbtdf.mean());
        Ok(CapturedSheet { svbtdf: Arc::new(svbtdf), mean })
    }
}

/// Correlates the rough slopes of both faces.
pub struct CorrelateFaces<'a> {
    pub top: &'a Keyed<FaceNormals>,
    pub bottom: &'a Keyed<FaceNormals>,
    pub table_side: usize,
}

impl Stage for CorrelateFaces<'_> {
    type Output = Spread;
    const NAME: &'static str = "slab_correlation";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("top", &self.top.key).key("bottom", &self.bottom.key).counts("table", [self.table_side]);
    }

    fn run(&self, _: &Env) -> Result<Spread> {
        Ok(virtual_face(&self.top.ndf, &self.bottom.ndf, self.table_side))
    }
}

/// Traces the light that is reflected between the faces.
pub struct TraceInner<'a> {
    pub top: &'a Keyed<FaceNormals>,
    pub bottom: &'a Keyed<FaceNormals>,
    pub optics: Optics,
    pub photons: usize,
    pub seed: u64,
}

impl Stage for TraceInner<'_> {
    type Output = Inner;
    const NAME: &'static str = "slab_inner";

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("top", &self.top.key).key("bottom", &self.bottom.key);
        // The diffuse part scales the light afterwards.
        let Optics { eta, thickness, absorption, diffuse: _ } = self.optics;
        key.numbers("eta", &[eta]).numbers("depth", &[absorption * thickness]);
        key.counts("photons", [self.photons]).numbers("seed", &[self.seed]);
    }

    fn run(&self, env: &Env) -> Result<Inner> {
        Inner::new(&self.top.ndf, &self.bottom.ndf, &self.optics, self.photons, self.seed, &env.cancel)
    }
}
