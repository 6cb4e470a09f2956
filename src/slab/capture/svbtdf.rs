//! A spatially varying BTDF and its `.npz` file (Dai et al. 2009, Eqs. 13 and 20).

use std::io;
use std::path::Path;
use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};

use super::super::dual::blend;
use super::super::ring_table::{RINGS, RingTable, TURNS};
use super::bounced::{ALPHAS, Bounced, ROUGHNESSES, SheetBounces};
use super::lobe::{LobeOptics, PointModel, SlopeGrid};
use crate::base::npz::{Arrays, array, arrays};
use crate::base::zip::ZipWriter;
use crate::base::{Error, InputError, Result, atomic_file};
use crate::scene::files;

/// Least logarithm of a density, below which f32 has no numbers.
const LEAST_LN: f64 = -80.0;
/// Limits of a file.
const MAX_FILE: u64 = 2 << 30;
const MAX_SIDE: usize = 256;
const MAX_MODELS: usize = 1 << 24;

/// The captured slab of a sheet: models of representative points, and weights of a few of them for every pixel.
///
/// Pixel `(column, row)` has the index `row * width + column`; columns run along +x and rows along +y.
#[derive(Debug, Clone, PartialEq)]
pub struct Svbtdf {
    /// Columns and rows.
    pub size: [usize; 2],
    pub optics: LobeOptics,
    pub grid: SlopeGrid,
    /// Models of mass 1.
    pub models: Vec<PointModel>,
    /// Representatives per pixel.
    pub neighbours: usize,
    /// Indices of the representatives of each pixel, and their weights, which are not negative and sum to 1.
    pub index: Vec<u32>,
    pub weight: Vec<f32>,
    /// `k_s` and `ρ_d` [1/sr] of Eq. 13 for each pixel.
    pub scale: Vec<Vec3>,
    pub diffuse: Vec<Vec3>,
    /// Light that is reflected inside, as a part of `scale` beside the lobe; absent if the lobe holds it.
    pub bounced: Option<SheetBounces>,
}

/// The far appearance of an SVBTDF: the mean over its pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct MeanBtdf {
    optics: LobeOptics,
    /// Representatives with their part of the mean lobe.
    models: Vec<(PointModel, DVec3)>,
    diffuse: DVec3,
    /// Light that is reflected inside, per channel.
    bounced: Option<[RingTable; 3]>,
}

impl Svbtdf {
    /// Index of the pixel at a place of the sheet, 0 to 1 along both axes. The sheet repeats.
    pub fn pixel_at(&self, place: DVec2) -> usize {
        let at = |x: f64, count: usize| ((x.rem_euclid(1.0) * count as f64) as usize).min(count - 1);
        at(place.y, self.size[1]) * self.size[0] + at(place.x, self.size[0])
    }

    /// Indices of the representatives of a pixel with their weights.
    fn indices(&self, pixel: usize) -> impl Iterator<Item = (usize, f64)> {
        let range = pixel * self.neighbours..(pixel + 1) * self.neighbours;
        let parts = self.index[range.clone()].iter().zip(&self.weight[range]);
        parts.filter(|(_, weight)| **weight > 0.0).map(|(k, weight)| (*k as usize, f64::from(*weight)))
    }

    /// The representatives of a pixel with their weights.
    fn parts(&self, pixel: usize) -> impl Iterator<Item = (&PointModel, f64)> {
        self.indices(pixel).map(|(k, weight)| (&self.models[k], weight))
    }

    /// The model of a pixel: α and D are interpolated between its representatives (Eq. 20). Its scale is left out.
    pub fn model(&self, pixel: usize) -> PointModel {
        let node = |k: usize| self.parts(pixel).map(|(model, weight)| weight * model.ln_density[k].exp()).sum::<f64>();
        let ln_density = (0..self.grid.side * self.grid.side).map(|k| node(k).ln().max(LEAST_LN)).collect();
        PointModel { grid: self.grid, alpha: self.alpha(pixel), ln_density }
    }

    fn alpha(&self, pixel: usize) -> f64 {
        self.parts(pixel).map(|(model, weight)| weight * model.alpha).sum::<f64>().clamp(0.0, 1.0)
    }

    /// BTDF [1/sr] of a pixel for directions on opposite sides of the sheet: that of its [`Self::model`] and of the light that
    /// is reflected inside, scaled and with the diffuse part.
    pub fn btdf(&self, pixel: usize, i: DVec3, o: DVec3) -> DVec3 {
        let Some((i, o)) = from_above(i, o) else { return DVec3::ZERO };
        let lobe = self.optics.terms(i, o).map_or(0.0, |terms| {
            let part = |ln_factor: f64, slope: DVec2| {
                let Some(stencil) = self.grid.stencil(slope) else { return 0.0 };
                let node = |k: u32| {
                    let sum: f64 =
                        self.parts(pixel).map(|(model, weight)| weight * model.ln_density[k as usize].exp()).sum();
                    sum.ln().max(LEAST_LN)
                };
                let ln_density: f64 =
                    stencil.nodes.iter().zip(&stencil.weights).map(|(k, weight)| weight * node(*k)).sum();
                (ln_factor + ln_density).exp()
            };
            let top = part(terms.ln_top, terms.slope_top);
            blend(top, part(terms.ln_bottom, terms.slope_bottom), self.alpha(pixel))
        });
        let bounced = self.bounced.as_ref().map_or(0.0, |bounced| {
            let roughness = bounced.roughness(self.indices(pixel));
            bounced.light.btdf(roughness, self.alpha(pixel), i, o)
        });
        self.scale[pixel].as_dvec3() * (lobe + bounced) + self.diffuse[pixel].as_dvec3()
    }

    /// The mean over the pixels. The weights of a pixel also interpolate the lobes of its representatives (Eq. 21), so that
    /// the mean is a sum over representatives.
    pub fn mean(&self) -> MeanBtdf {
        let mut parts = vec![DVec3::ZERO; self.models.len()];
        let pixels = self.scale.len().max(1) as f64;
        for (pixel, scale) in self.scale.iter().enumerate() {
            let range = pixel * self.neighbours..(pixel + 1) * self.neighbours;
            for (index, weight) in self.index[range.clone()].iter().zip(&self.weight[range]) {
                parts[*index as usize] += f64::from(*weight) / pixels * scale.as_dvec3();
            }
        }
        let bounced = self.bounced.as_ref().map(|bounced| {
            let slab =
                |(k, part): (usize, &DVec3)| (bounced.roughness([(k, 1.0)].into_iter()), self.models[k].alpha, *part);
            let slabs: Vec<(f64, f64, DVec3)> = parts.iter().enumerate().map(slab).collect();
            [0, 1, 2].map(|channel| {
                bounced.light.mean(slabs.iter().map(|(roughness, alpha, part)| (*roughness, *alpha, part[channel])))
            })
        });
        let models = self.models.iter().cloned().zip(parts).filter(|(_, part)| *part != DVec3::ZERO).collect();
        let diffuse = self.diffuse.iter().map(|value| value.as_dvec3()).sum::<DVec3>() / pixels;
        MeanBtdf { optics: self.optics.clone(), models, diffuse, bounced }
    }

    /// Writes the arrays `ndf[model, y, x]` (the exponential of the coefficients of a biquadratic B-spline), `alpha[model]`,
    /// `index[row, column, neighbour]` (u32), `weight[row, column, neighbour]`, `scale[row, column, rgb]`,
    /// `diffuse[row, column, rgb]` and the scalars `span`, `eta` and `shadowing`; f32 but for the indices. `bounced[roughness,
    /// alpha, ring, ring, azimuth]` holds the light that is reflected inside, if any.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        atomic_file::write_atomically(path, |out| {
            let mut zip = ZipWriter::new(out);
            self.write_arrays(&mut zip)?;
            zip.finish()
        })
    }

    fn write_arrays(&self, zip: &mut ZipWriter<'_>) -> io::Result<()> {
        let ([width, height], side, near) = (self.size, self.grid.side, self.neighbours);
        let ndf: Vec<f32> = self.models.iter().flat_map(|model| &model.ln_density).map(|ln| ln.exp() as f32).collect();
        let alpha: Vec<f32> = self.models.iter().map(|model| model.alpha as f32).collect();
        let floats = |zip: &mut ZipWriter<'_>, name: &str, shape: &[usize], values: &[f32]| {
            array(zip, name, "f4", shape, bytemuck::cast_slice(values))
        };
        floats(zip, "ndf", &[self.models.len(), side, side], &ndf)?;
        floats(zip, "alpha", &[self.models.len()], &alpha)?;
        array(zip, "index", "u4", &[height, width, near], bytemuck::cast_slice(&self.index))?;
        floats(zip, "weight", &[height, width, near], &self.weight)?;
        floats(zip, "scale", &[height, width, 3], bytemuck::cast_slice(&self.scale))?;
        floats(zip, "diffuse", &[height, width, 3], bytemuck::cast_slice(&self.diffuse))?;
        for (name, value) in [("span", self.grid.span), ("eta", self.optics.eta), ("shadowing", self.optics.shadowing)]
        {
            floats(zip, name, &[], &[value as f32])?;
        }
        if let Some(bounced) = &self.bounced {
            let values: Vec<f32> = bounced.light.tables().iter().flat_map(RingTable::values).copied().collect();
            floats(zip, "bounced", &BOUNCED_SHAPE, &values)?;
        }
        Ok(())
    }

    /// Reads a file that [`Self::write`] wrote.
    ///
    /// # Errors
    /// The file is missing or too large, or is no SVBTDF.
    pub fn read(path: &Path) -> Result<Self> {
        Self::of_scene(Path::new(""), path)
    }

    /// As [`Self::read`], for a file that a scene in the folder `base_dir` names.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn of_scene(base_dir: &Path, path: &Path) -> Result<Self> {
        let bytes = files::read(base_dir, path, MAX_FILE)?;
        let sheet = arrays(&bytes).and_then(|mut arrays| Self::of_arrays(&mut arrays));
        sheet.map_err(|error| Error::from(error.in_file(files::resolve(base_dir, path))))
    }

    fn of_arrays(arrays: &mut Arrays) -> std::result::Result<Self, InputError> {
        let span = scalar(arrays, "span", 1e-3, 100.0)?;
        let eta = scalar(arrays, "eta", 1.0 + 1e-6, 4.0)?;
        let shadowing = scalar(arrays, "shadowing", 0.0, 4.0)?;
        let (ndf_shape, ndf) = taken(arrays, "ndf", 0.0, f32::MAX)?;
        let [models, side, other] = *ndf_shape.as_slice() else { return Err(wrong_shape("ndf", &ndf_shape)) };
        let is_table = side == other && (4..=MAX_SIDE).contains(&side) && (1..=MAX_MODELS).contains(&models);
        if !is_table {
            return Err(wrong_shape("ndf", &ndf_shape));
        }
        let alpha = of_shape(arrays, "alpha", &[models], 0.0, 1.0)?;
        let (shape, index) = taken(arrays, "index", 0.0, (models - 1) as f32)?;
        let [height, width, neighbours] = *shape.as_slice() else { return Err(wrong_shape("index", &shape)) };
        if height * width * neighbours == 0 {
            return Err(wrong_shape("index", &shape));
        }
        let weight = of_shape(arrays, "weight", &shape, 0.0, 1.0)?;
        let rgb = [height, width, 3];
        let (scale, diffuse) =
            (of_shape(arrays, "scale", &rgb, 0.0, 1e18)?, of_shape(arrays, "diffuse", &rgb, 0.0, 1e18)?);
        let grid = SlopeGrid { side, span };
        let model = |(values, alpha): (&[f32], &f32)| PointModel {
            grid,
            alpha: f64::from(*alpha),
            ln_density: values.iter().map(|value| f64::from(*value).ln().max(LEAST_LN)).collect(),
        };
        let models: Vec<PointModel> = ndf.chunks_exact(side * side).zip(&alpha).map(model).collect();
        let bounced = if arrays.contains_key("bounced") {
            let values = of_shape(arrays, "bounced", &BOUNCED_SHAPE, 0.0, 1e18)?;
            let tables = values.chunks_exact(RingTable::LEN).map(|table| RingTable::new(table.to_vec())).collect();
            Some(SheetBounces::new(Arc::new(Bounced::of_tables(tables)), &models))
        } else {
            None
        };
        Ok(Self {
            size: [width, height],
            optics: LobeOptics::new(eta, shadowing),
            grid,
            models,
            neighbours,
            index: index.into_iter().map(|value| value as u32).collect(),
            weight,
            scale: bytemuck::cast_slice(&scale).to_vec(),
            diffuse: bytemuck::cast_slice(&diffuse).to_vec(),
            bounced,
        })
    }
}

/// Turns a pair of directions so that the light is above; `None` for directions on one side.
fn from_above(i: DVec3, o: DVec3) -> Option<(DVec3, DVec3)> {
    let (i, o) = if i.z > 0.0 { (i, o) } else { (o, i) };
    (i.z > 0.0 && o.z < 0.0).then_some((i, o))
}

impl MeanBtdf {
    /// BTDF [1/sr] for directions on opposite sides of the sheet.
    pub fn btdf(&self, i: DVec3, o: DVec3) -> DVec3 {
        let Some((i, o)) = from_above(i, o) else { return DVec3::ZERO };
        let inside = self.bounced.as_ref().map_or(DVec3::ZERO, |channels| {
            DVec3::from_array([0, 1, 2].map(|channel: usize| channels[channel].read(i, o)))
        });
        let even = self.diffuse + inside;
        let Some(terms) = self.optics.terms(i, o) else { return even };
        self.models.iter().map(|(model, part)| *part * model.btdf(&terms)).sum::<DVec3>() + even
    }

    /// The sheet turned over: the top is the bottom, and all slopes are turned by 180°.
    pub fn turned(&self) -> Self {
        let turn = |(model, part): &(PointModel, DVec3)| {
            let ln_density = model.ln_density.iter().rev().copied().collect();
            (PointModel { alpha: 1.0 - model.alpha, ln_density, ..model.clone() }, *part)
        };
        let bounced = self.bounced.as_ref().map(|channels| [0, 1, 2].map(|k: usize| channels[k].transposed()));
        Self { models: self.models.iter().map(turn).collect(), bounced, ..self.clone() }
    }

    /// Number of representatives.
    pub fn len(&self) -> usize {
        self.models.len()
    }

    /// Returns true for a sheet without a lobe.
    pub fn is_empty(&self) -> bool {
        self.models.is_empty()
    }

    /// Root mean square slope of the virtual faces.
    pub fn deviation(&self) -> f64 {
        let (mut squares, mut total) = (0.0, 0.0);
        for (model, part) in &self.models {
            let ((_, mean, variance), part) = (model.moments(), part.element_sum());
            squares += part * (mean.length_squared() + variance.element_sum());
            total += part;
        }
        if total > 0.0 { (squares / total).sqrt() } else { 0.0 }
    }
}

/// Shape of the light that is reflected inside.
const BOUNCED_SHAPE: [usize; 5] = [ROUGHNESSES, ALPHAS, RINGS, RINGS, TURNS];

const EXPECTED: &str = "an .npz that `biscale capture` wrote";

fn wrong_shape(name: &str, shape: &[usize]) -> InputError {
    let expected = match name {
        "ndf" => format!("[models, side, side] with a side of 4 to {MAX_SIDE}"),
        _ => "[rows, columns, neighbours]".to_owned(),
    };
    InputError::new(format!("array \"{name}\""), format!("shape {shape:?}"), expected)
}

/// Takes an array out of an archive. Its values lie between `least` and `most`.
fn taken(
    arrays: &mut Arrays,
    name: &str,
    least: f32,
    most: f32,
) -> std::result::Result<(Vec<usize>, Vec<f32>), InputError> {
    let (shape, values) =
        arrays.remove(name).ok_or_else(|| InputError::new("archive", format!("no array \"{name}\""), EXPECTED))?;
    // NaN is outside every range.
    if let Some(at) = values.iter().position(|value| !(least..=most).contains(value)) {
        let expected = format!("numbers from {least} to {most}");
        return Err(InputError::new(format!("array \"{name}\", number {at}"), values[at], expected));
    }
    Ok((shape, values))
}

fn of_shape(
    arrays: &mut Arrays,
    name: &str,
    expected: &[usize],
    least: f32,
    most: f32,
) -> std::result::Result<Vec<f32>, InputError> {
    let (shape, values) = taken(arrays, name, least, most)?;
    if shape != expected {
        let place = format!("array \"{name}\"");
        return Err(InputError::new(place, format!("shape {shape:?}"), format!("{expected:?}, as the other arrays")));
    }
    Ok(values)
}

fn scalar(arrays: &mut Arrays, name: &str, least: f64, most: f64) -> std::result::Result<f64, InputError> {
    Ok(f64::from(of_shape(arrays, name, &[], least as f32, most as f32)?[0]))
}
