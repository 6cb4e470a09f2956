//! RGL tensor files (Dupuy and Jakob 2018): `.bsdf`, read by Mitsuba 3's `measured`, pbrt-v4 and brdf-loader. A file is
//! anisotropic, or covers three angles if the scene's plan finds the tile isotropic.
//!
//! The format's `i`, the direction with the slices, is the view direction here. The format's value is the BRDF times
//! the cosine of the other direction, which is exactly `f̄`. Samples lie on half vectors, because lobes depend little
//! on the other angles there. A warp makes the samples dense where normals are frequent.

pub mod sampling;
mod slices;

use std::io::{self, Write};

use glam::{DVec3, Vec3};

use super::ReadingError;
use super::sampler::{in_parallel, reading_error};
use super::{ExportResolution, ExportTask, Written};
use crate::brdf::rgl::table::RglTable;
use crate::brdf::rgl::tensor_file::TensorWriter;
use crate::brdf::rgl::warp::Warp;
use crate::brdf::spectrum::{WRITTEN_NM, spectra_of_primaries};
use slices::{Sizes, ViewSlice, one_slice, planes};

/// Polar angles and azimuths of the viewer, then samples along both axes of a warp: files of 3, 20 and 105 MB.
const RESOLUTIONS: [[usize; 4]; 3] = [[9, 24, 24, 24], [13, 48, 36, 36], [19, 72, 56, 56]];
/// Bounds the mean reading error; the first resolution within it is used.
const MAX_MEAN_ERROR: f64 = 0.008;

/// A table as a program reads it, and its slices as stored.
struct Tabulated {
    sizes: Sizes,
    table: RglTable,
    slices: Vec<ViewSlice>,
    reading: ReadingError,
}

impl Tabulated {
    fn new(task: &ExportTask<'_>, resolution: &ExportResolution) -> io::Result<Self> {
        let ExportTask { brdf, progress, .. } = *task;
        let sizes = Sizes::new(resolution, task.meta.isotropic);
        let planes = planes(brdf, &sizes);
        let count = sizes.phis * sizes.thetas;
        let slices = in_parallel(count, progress, |slice| one_slice(brdf, &planes, &sizes, slice))?;
        let slices: Vec<ViewSlice> = slices.into_iter().collect::<io::Result<_>>()?;
        let vndf = Warp::new(sizes.vndf, widened(&slices, |slice| &slice.vndf)).map_err(io::Error::other)?;
        let table = RglTable { vndf, rgb: (sizes.samples, widened(&slices, |slice| &slice.rgb)), ..planes };
        let read = |i: Vec3, o: Vec3| table.eval(o.as_dvec3(), i.as_dvec3()).as_vec3();
        let reading = reading_error(brdf, read);
        Ok(Self { sizes, table, slices, reading })
    }

    /// Tabulates at the requested resolution, or at the first of `resolutions` whose error is small enough.
    fn with_resolution(task: &ExportTask<'_>, resolutions: &[[usize; 4]]) -> io::Result<Self> {
        if let Some(resolution) = &task.options.resolution {
            return Self::new(task, resolution);
        }
        let cost = |sizes: &[usize; 4]| sizes.iter().product::<usize>() as f32;
        let all: f32 = resolutions.iter().map(cost).sum();
        let (mut done, mut last) = (0.0, None);
        for sizes in resolutions {
            let [theta_i, phi_i, theta_o, phi_o] = *sizes;
            let progress = |part: f32| (task.progress)((done + part * cost(sizes)) / all);
            let step = ExportTask { progress: &progress, ..*task };
            let tabulated = Self::new(&step, &ExportResolution { theta_i, phi_i, theta_o, phi_o })?;
            done += cost(sizes);
            if tabulated.reading.mean <= MAX_MEAN_ERROR {
                return Ok(tabulated);
            }
            last = Some(tabulated);
        }
        last.ok_or_else(|| io::Error::other("no resolution to choose from"))
    }
}

fn widened(slices: &[ViewSlice], of: impl Fn(&ViewSlice) -> &Vec<f32>) -> Vec<f64> {
    slices.iter().flat_map(|slice| of(slice).iter().map(|&value| f64::from(value))).collect()
}

/// Colour representation of a file; a file may not contain both.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colors {
    Rgb,
    /// Smooth spectra that match the RGB values in daylight, for spectral renderers.
    Spectra,
}

/// Writes a file and returns its conventions and error.
pub fn write(task: &ExportTask<'_>, out: &mut dyn Write, colors: Colors) -> io::Result<Written> {
    // Spectra take five times the space, so the largest size is used only on request.
    let sizes = if colors == Colors::Rgb { &RESOLUTIONS[..] } else { &RESOLUTIONS[..2] };
    let Tabulated { sizes, table, slices, reading } = Tabulated::with_resolution(task, sizes)?;
    let narrow = |values: &[f64]| values.iter().map(|&value| value as f32).collect::<Vec<f32>>();
    let Sizes { thetas, phis, samples, vndf, ndf } = sizes;
    let joined = |of: fn(&ViewSlice) -> &Vec<f32>| slices.iter().flat_map(of).copied().collect::<Vec<f32>>();
    let per_slice = [phis, thetas, samples.height, samples.width];
    let mut file = TensorWriter::default();
    file.bytes("description", task.summary().as_bytes());
    file.floats("phi_i", &[phis], &narrow(&table.phi_i));
    file.floats("theta_i", &[thetas], &narrow(&table.theta_i));
    file.floats("sigma", &[ndf.height, ndf.width], &narrow(&table.sigma.1));
    file.floats("ndf", &[ndf.height, ndf.width], &narrow(&table.ndf.1));
    file.floats("vndf", &[phis, thetas, vndf.height, vndf.width], &joined(|slice| &slice.vndf));
    file.floats("luminance", &per_slice, &joined(|slice| &slice.luminance));
    match colors {
        Colors::Rgb => {
            file.floats("rgb", &[phis, thetas, 3, samples.height, samples.width], &joined(|slice| &slice.rgb));
        }
        Colors::Spectra => {
            file.floats("wavelengths", &[WRITTEN_NM.len()], &narrow(&WRITTEN_NM));
            let shape = [phis, thetas, WRITTEN_NM.len(), samples.height, samples.width];
            file.floats("spectra", &shape, &spectra(&slices, samples.len()));
        }
    }
    file.bytes("jacobian", &[1]);
    file.write(out)?;
    Ok(Written {
        pairs: thetas * phis * samples.len(),
        reading,
        conventions: conventions(colors, task.meta.isotropic),
        anisotropy_lost: None,
    })
}

/// Converts the RGB planes of slices to `[slice][wavelength][sample]`.
fn spectra(slices: &[ViewSlice], plane: usize) -> Vec<f32> {
    let primaries = spectra_of_primaries();
    let mut values = Vec::with_capacity(slices.len() * primaries.len() * plane);
    for slice in slices {
        for primary in &primaries {
            values.extend((0..plane).map(|at| {
                let rgb = DVec3::from_array(std::array::from_fn(|c| f64::from(slice.rgb[c * plane + at])));
                primary.dot(rgb).max(0.0) as f32
            }));
        }
    }
    values
}

fn conventions(colors: Colors, isotropic: bool) -> Vec<String> {
    let what = match colors {
        Colors::Rgb => "Field rgb: linear RGB, Rec. 709 primaries; for RGB variants of Mitsuba (pbrt upsamples).",
        Colors::Spectra => {
            "Fields spectra, wavelengths (nm): smooth spectra that look like our RGB in daylight (D65); for spectral variants."
        }
    };
    let azimuths = if isotropic {
        "Slices (theta_i) are directions of the viewer, Mitsuba's wi, at phi 0; isotropic: other azimuths turn the half vector back."
    } else {
        "Slices (phi_i, theta_i) are directions of the viewer, Mitsuba's wi; phi_i runs from -pi to pi, the seam twice."
    };
    let lines = [
        what,
        "RGL tensor file (Dupuy and Jakob 2018): Mitsuba 3's `measured`, pbrt-v4's `measured`, RGL's brdf-loader.",
        azimuths,
        "A value, rgb(s) ndf(u_m) / (4 sigma(u_i)), is the BRDF times the cosine of the other direction, Mitsuba's wo: f_bar.",
        "u = (sqrt(2 theta / pi), (phi + pi) / 2 pi); m is the half vector; s is u_m through the inverse of the warp by vndf.",
        "sigma is the visible projected area over the tile's area; ndf is the root of the luminance of G(m, m), of its largest, floored.",
        "vndf is that density of normals, in part as this viewer sees them; luminance is what the warp by it leaves to sample.",
    ];
    lines.map(str::to_owned).to_vec()
}
