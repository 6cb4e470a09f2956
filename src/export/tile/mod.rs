//! Export of the tile itself: a mesh (`.obj`), a solid to print (`.stl`), heights (`.png`), or a pattern to cut, fold
//! and glue (`.svg`, `.pdf`; Wu et al. 2011, Fig. 9).

mod heights;
mod mesh;
mod page;
mod pattern;
mod solid;

use std::path::Path;

use glam::{UVec2, Vec3};

use crate::base::atomic_file::replace_large_file;
use crate::base::progress::part;
use crate::base::{InputError, Progress, Result};
use crate::geometry::TileMesh;
use crate::scene::{BrdfSpec, Scene, TermSpec, Tile, millimetres};

/// Options of a tile's files.
#[derive(Debug, Clone, PartialEq)]
pub struct TileOptions {
    /// Number of periods in x and y.
    pub repeat: UVec2,
    /// Enlargement of solid and pattern.
    pub scale: f32,
    /// Thickness of the solid below its lowest point, millimetres; `None` selects a tenth of the solid's longer side.
    pub base_mm: Option<f32>,
    /// Number of height samples per period in x and y.
    pub samples: UVec2,
}

impl Default for TileOptions {
    fn default() -> Self {
        Self { repeat: UVec2::ONE, scale: 1.0, base_mm: None, samples: UVec2::splat(256) }
    }
}

/// Bounds the number of periods.
const MAX_PERIODS: u32 = 10_000;
/// Bounds the height samples of all periods together: a solid of 400 MB.
const MAX_SAMPLES: u64 = 1 << 22;
/// Bounds the triangles of all periods together in an OBJ file: some hundred MB.
const MAX_TRIANGLES: u64 = 1 << 24;

/// Bounds the enlargement.
const MAX_SCALE: f32 = 1e6;
/// Bounds the thickness of a solid below its lowest point [mm].
const MAX_BASE_MM: f32 = 1e4;

impl TileOptions {
    fn check(&self) -> Result<()> {
        let input_error = |place: &str, found: String, expected: String| InputError::new(place, found, expected).into();
        let periods = u64::from(self.repeat.x) * u64::from(self.repeat.y);
        if periods == 0 || periods > u64::from(MAX_PERIODS) {
            return Err(input_error("repeat", self.repeat.to_string(), format!("1 to {MAX_PERIODS} periods")));
        }
        if !(self.scale > 0.0 && self.scale <= MAX_SCALE) {
            let expected = format!("a number above 0 and at most {MAX_SCALE}");
            return Err(input_error("scale", self.scale.to_string(), expected));
        }
        if let Some(base) = self.base_mm.filter(|base| !(*base > 0.0 && *base <= MAX_BASE_MM)) {
            let expected = format!("a number above 0 and at most {MAX_BASE_MM} [mm]");
            return Err(input_error("base", base.to_string(), expected));
        }
        Ok(())
    }
}

/// Checks the number of height samples of a solid or an image.
fn check_samples(options: &TileOptions) -> Result<()> {
    let all = options.repeat.as_u64vec2() * options.samples.as_u64vec2();
    if options.samples.min_element() < 2 || all.x.saturating_mul(all.y) > MAX_SAMPLES {
        let expected = format!("2 to {MAX_SAMPLES} in all periods together");
        return Err(InputError::new("samples", options.samples, expected).into());
    }
    Ok(())
}

/// Checks the number of triangles of an OBJ file.
fn check_triangles(mesh: &TileMesh, options: &TileOptions) -> Result<()> {
    let all = u64::from(options.repeat.x) * u64::from(options.repeat.y) * mesh.triangles.len() as u64;
    if all > MAX_TRIANGLES {
        let expected = format!("at most {MAX_TRIANGLES} in all periods together");
        return Err(InputError::new("repeat", format!("{all} triangles"), expected).into());
    }
    Ok(())
}

/// File formats of a tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum TileFormat {
    Obj,
    Stl,
    Png,
    Svg,
    Pdf,
}

impl TileFormat {
    fn of(path: &Path) -> Result<Self> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        Ok(match ending.as_str() {
            "obj" => Self::Obj,
            "stl" => Self::Stl,
            "png" => Self::Png,
            "svg" => Self::Svg,
            "pdf" => Self::Pdf,
            other => {
                let found = match other {
                    "" => "a name without an ending".to_owned(),
                    other => format!("the ending .{other}"),
                };
                let expected = "a name that ends in .obj, .stl, .png, .svg or .pdf";
                return Err(InputError::new("output", found, expected).in_file(path).into());
            }
        })
    }
}

/// Checks the extension of `path` and the options. Callers check them before they build the tile.
///
/// # Errors
/// An unknown extension, or an option out of range.
pub fn check(options: &TileOptions, path: &Path) -> Result<()> {
    options.check()?;
    match TileFormat::of(path)? {
        TileFormat::Stl | TileFormat::Png => check_samples(options),
        TileFormat::Obj | TileFormat::Svg | TileFormat::Pdf => Ok(()),
    }
}

/// Progress, 0 to 1, at which the content is complete and only has to be written.
const CONTENT_PROGRESS: f32 = 0.7;

/// Writes the tile of a scene in the format of the extension of `path`, and returns notes on the file.
///
/// # Errors
/// An unknown extension, an option out of range, a geometry without a pattern, a path that cannot be written, or
/// [`crate::base::Error::Cancelled`] if `progress` cancels. An existing file then stays unchanged.
pub fn write(
    scene: &Scene,
    mesh: &TileMesh,
    options: &TileOptions,
    path: &Path,
    progress: &Progress<'_>,
) -> Result<Vec<String>> {
    check(options, path)?;
    let format = TileFormat::of(path)?;
    let (making, writing) = (part(progress, 0.0, CONTENT_PROGRESS), part(progress, CONTENT_PROGRESS, 1.0));
    let drawing = part(&making, 0.5, 1.0);
    let sheet = || pattern::sheet(scene, options, millimetres(&scene.tile.unit)?, &part(&making, 0.0, 0.5));
    let (bytes, mut notes) = match format {
        TileFormat::Obj => {
            check_triangles(mesh, options)?;
            mesh::obj(mesh, options, &making)?
        }
        TileFormat::Stl => solid::stl(mesh, options, millimetres(&scene.tile.unit)?, &making)?,
        TileFormat::Png => heights::png(mesh, options, &scene.tile.unit, &making)?,
        TileFormat::Svg => {
            let (page, notes) = sheet()?;
            (page.svg(&drawing)?, notes)
        }
        TileFormat::Pdf => {
            let (page, notes) = sheet()?;
            (page.pdf(&drawing)?, notes)
        }
    };
    if matches!(format, TileFormat::Obj | TileFormat::Svg | TileFormat::Pdf) {
        notes.extend(left_out(&scene.tile));
    }
    replace_large_file(path, &bytes, &writing)?;
    Ok(notes)
}

/// Returns a note on the painted images that a file with materials cannot contain.
fn left_out(tile: &Tile) -> Option<String> {
    let painted = match (&tile.color_path, &tile.slot_path) {
        (None, None) => return None,
        (Some(_), None) => "the image of colours (`tile.color_path`) is",
        (None, Some(_)) => "the image of materials (`tile.slot_path`) is",
        (Some(_), Some(_)) => "the images of colours and of materials (`tile.color_path`, `tile.slot_path`) are",
    };
    Some(format!("{painted} left out: each face stands in the plain material of its own slot"))
}

/// Returns the colour of a slot's material on paper: the sum of its terms' colours, linear RGB.
fn paper_color(scene: &Scene, slot: &str) -> Result<Vec3> {
    let material = scene.material_for_slot(slot)?;
    let term_color = |term: &TermSpec| match term {
        TermSpec::Lambertian { albedo } => *albedo,
        TermSpec::BlinnPhong { specular, .. } | TermSpec::Ward { specular, .. } => *specular,
        TermSpec::CookTorrance { f0, .. } | TermSpec::Ggx { f0, .. } => *f0,
        TermSpec::Merl { .. } | TermSpec::Rgl { .. } | TermSpec::Utia { .. } | TermSpec::Npz { .. } => Vec3::splat(0.5),
    };
    let sum: Vec3 = BrdfSpec::terms(material.brdf).iter().map(term_color).sum();
    Ok((sum * material.color).clamp(Vec3::ZERO, Vec3::ONE))
}

#[cfg(test)]
mod tests;
