//! Images of the object: the job that a worker receives and the result that it reports.

use std::sync::Arc;
use std::time::Instant;

use crate::effective::{EffectiveBrdf, ErrorEstimate};
use crate::plan::Effect;
use crate::render::{Image, RenderScene};
use crate::scene::{Camera, LoadedScene};
use eframe::egui::ColorImage;

use super::screen::GpuImage;

/// An image to render.
#[derive(Debug, Clone)]
pub struct ImageJob {
    /// Version of the document, returned with every result.
    pub version: u64,
    pub loaded: Arc<LoadedScene>,
    /// Size of the view in pixels.
    pub size: [usize; 2],
    pub submitted: Instant,
}

/// Stage of refinement of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Grade {
    Draft,
    /// Between draft and final.
    Refining,
    Final,
}

/// An image as the view shows it.
#[derive(Debug, Clone)]
pub enum DisplayImage {
    /// Pixels that the view uploads.
    Pixels(Arc<ColorImage>),
    /// A texture on the window's GPU that was never in CPU memory.
    OnGpu(Arc<GpuImage>),
}

impl DisplayImage {
    pub fn size(&self) -> [usize; 2] {
        match self {
            Self::Pixels(image) => image.size,
            Self::OnGpu(image) => image.size,
        }
    }

    /// The pixels, read back if they are on the GPU; `None` if the GPU is lost.
    pub fn pixels(&self) -> Option<Arc<ColorImage>> {
        match self {
            Self::Pixels(image) => Some(image.clone()),
            Self::OnGpu(image) => image.read().ok().map(Arc::new),
        }
    }
}

/// A rendered image of the object, with the times and inputs that produced it.
#[derive(Debug, Clone)]
pub struct RenderedPreview {
    pub version: u64,
    pub grade: Grade,
    /// Radiance, absent if it is only on the GPU.
    pub radiance: Option<Arc<Image>>,
    pub image: DisplayImage,
    /// Absent if the GPU rendered the image from the tile itself.
    pub brdf: Option<Arc<EffectiveBrdf>>,
    /// Milliseconds per stage that ran for this image.
    pub stages: Vec<(&'static str, f64)>,
    /// Time from the edit to the finished image.
    pub latency_ms: f64,
    /// Description of the processor that shaded the image.
    pub rendered_on: String,
    /// Reason why the GPU failed.
    pub gpu_error: Option<String>,
    /// The object and its lights.
    pub lit_object: Option<RenderScene>,
    pub camera: Camera,
    /// Distance from the camera to the object, in the object's radii.
    pub distance: f32,
    pub notes: Vec<String>,
    pub effects: Vec<Effect>,
    /// Name of the preset that was used.
    pub preset: &'static str,
}

/// A report of a worker that renders images.
#[derive(Debug, Clone)]
pub enum ImageResult {
    Rendered(Box<RenderedPreview>),
    /// The current work, for the status line.
    Doing(u64, &'static str),
    /// Warnings about the material of a version, after its final image.
    Warnings(u64, Vec<String>),
    /// The error that a BRDF states, after its image came to rest.
    Stated(Arc<EffectiveBrdf>, ErrorEstimate),
    Failed(u64, String),
    /// A panic in the worker, which continues with a fresh state.
    Fault(String),
}
