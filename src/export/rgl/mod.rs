//! RGL tensor files (Dupuy and Jakob 2018), anisotropic, or of three angles where the plan knows that turning the tile changes
//! nothing: `.bsdf`, read by Mitsuba 3's `measured`, pbrt-v4 and brdf-loader.
//!
//! `i` of the format, the side with the slices, is our viewer; its value is the BRDF times the cosine of the other side,
//! which is exactly `f̄`. Samples lie on half vectors, where lobes stand still, crowded by a warp where normals are.

mod slices;

use std::io::{self, Write};

use glam::{DVec3, Vec3};

use super::ReadingError;
use super::sampler::{in_parallel, reading_error};
use super::{ExportResolution, Job, Written};
use crate::brdf::rgl::table::RglTable;
use crate::brdf::rgl::tensor_file::TensorWriter;
use crate::brdf::rgl::warp::Warp;
use crate::brdf::spectrum::{WRITTEN_NM, spectra_of_primaries};
use slices::{Sizes, Slice, one_slice, planes};

/// Elevations and azimuths of the viewer, samples along both axes of a warp: 3, 20 and 105 MB.
const RESOLUTIONS: [[usize; 4]; 3] = [[9, 24, 24, 24], [13, 48, 36, 36], [19, 72, 56, 56]];
/// The first of them that reads with this mean error is taken: below 1 % at other pairs, too.
const GOOD_ENOUGH: f64 = 0.008;

/// A table in memory as a reader has it, and its slices as they are stored.
struct Tabulated {
    sizes: Sizes,
    table: RglTable,
    slices: Vec<Slice>,
    reading: ReadingError,
}

impl Tabulated {
    fn new(job: &Job<'_>, resolution: &ExportResolution) -> io::Result<Self> {
        let Job { brdf, progress, .. } = *job;
        let sizes = Sizes::new(resolution, job.meta.isotropic);
        let planes = planes(brdf, &sizes);
        let count = sizes.phis * sizes.thetas;
        let slices = in_parallel(count, progress, |slice| one_slice(brdf, &planes, &sizes, slice))?;
        let slices: Vec<Slice> = slices.into_iter().collect::<io::Result<_>>()?;
        let vndf = Warp::new(sizes.vndf, widened(&slices, |slice| &slice.vndf)).map_err(io::Error::other)?;
        let table = RglTable { vndf, rgb: (sizes.samples, widened(&slices, |slice| &slice.rgb)), ..planes };
        let read = |i: Vec3, o: Vec3| table.eval(o.as_dvec3(), i.as_dvec3()).as_vec3();
        let reading = reading_error(brdf, read);
        Ok(Self { sizes, table, slices, reading })
    }

    /// Of the size asked for, else the smallest of a few that reads well.
    fn chosen(job: &Job<'_>, resolutions: &[[usize; 4]]) -> io::Result<Self> {
        if let Some(resolution) = &job.options.resolution {
            return Self::new(job, resolution);
        }
        let cost = |sizes: &[usize; 4]| sizes.iter().product::<usize>() as f32;
        let all: f32 = resolutions.iter().map(cost).sum();
        let (mut before, mut last) = (0.0, None);
        for sizes in resolutions {
            let [theta_i, phi_i, theta_o, phi_o] = *sizes;
            let progress = |part: f32| (job.progress)((before + part * cost(sizes)) / all);
            let step = Job { progress: &progress, ..*job };
            let tabulated = Self::new(&step, &ExportResolution { theta_i, phi_i, theta_o, phi_o })?;
            before += cost(sizes);
            if tabulated.reading.mean <= GOOD_ENOUGH {
                return Ok(tabulated);
            }
            last = Some(tabulated);
        }
        last.ok_or_else(|| io::Error::other("no resolution to choose from"))
    }
}

fn widened(slices: &[Slice], of: impl Fn(&Slice) -> &Vec<f32>) -> Vec<f64> {
    slices.iter().flat_map(|slice| of(slice).iter().map(|&value| f64::from(value))).collect()
}

/// What a file holds; one may not hold both.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colors {
    Rgb,
    /// For spectral renderers: smooth spectra that look like the RGB values in daylight.
    Spectra,
}

/// Writes a file.
pub fn write(job: &Job<'_>, out: &mut dyn Write, colors: Colors) -> io::Result<Written> {
    // Spectra take five times the room: the largest size is left to those who ask for it.
    let sizes = if colors == Colors::Rgb { &RESOLUTIONS[..] } else { &RESOLUTIONS[..2] };
    let Tabulated { sizes, table, slices, reading } = Tabulated::chosen(job, sizes)?;
    let narrow = |values: &[f64]| values.iter().map(|&value| value as f32).collect::<Vec<f32>>();
    let Sizes { thetas, phis, samples, vndf, ndf } = sizes;
    let joined = |of: fn(&Slice) -> &Vec<f32>| slices.iter().flat_map(of).copied().collect::<Vec<f32>>();
    let per_slice = [phis, thetas, samples.height, samples.width];
    let mut file = TensorWriter::default();
    file.bytes("description", job.summary().as_bytes());
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
        conventions: conventions(colors, job.meta.isotropic),
        anisotropy_lost: None,
    })
}

/// `[slice][wavelength][place]` of slices of RGB planes.
fn spectra(slices: &[Slice], plane: usize) -> Vec<f32> {
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
