//! Pictures of the object, as they are asked for and as they come back.

use std::sync::Arc;
use std::time::Instant;

use crate::effective::EffectiveBrdf;
use crate::plan::Effect;
use crate::render::{DirectionalLight, Image, ObjectMesh};
use crate::scene::{Camera, LoadedScene};
use eframe::egui::ColorImage;

use super::screen::DeviceImage;

/// A picture to make.
#[derive(Debug, Clone)]
pub struct ImageJob {
    /// The document's version, handed back with every answer.
    pub version: u64,
    pub loaded: Arc<LoadedScene>,
    /// Pixels of the view.
    pub size: [usize; 2],
    pub asked: Instant,
}

/// How far a picture is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Grade {
    Draft,
    /// On the way from draft to final.
    Refining,
    Final,
}

/// A picture as the view shows it.
#[derive(Debug, Clone)]
pub enum DisplayImage {
    /// To be uploaded.
    Pixels(Arc<ColorImage>),
    /// Where the window draws; it never was anywhere else.
    OnDevice(Arc<DeviceImage>),
}

impl DisplayImage {
    pub fn size(&self) -> [usize; 2] {
        match self {
            Self::Pixels(image) => image.size,
            Self::OnDevice(image) => image.size,
        }
    }

    /// Its pixels, read back where they are on a device; `None` where that is lost.
    pub fn pixels(&self) -> Option<Arc<ColorImage>> {
        match self {
            Self::Pixels(image) => Some(image.clone()),
            Self::OnDevice(image) => image.read().ok().map(Arc::new),
        }
    }
}

/// A picture and how it came about.
#[derive(Debug, Clone)]
pub struct Made {
    pub version: u64,
    pub grade: Grade,
    /// Its radiance, where that is not on the device.
    pub radiance: Option<Arc<Image>>,
    pub image: DisplayImage,
    /// Absent where the device made the picture from the tile itself.
    pub brdf: Option<Arc<EffectiveBrdf>>,
    /// Milliseconds of what ran for it.
    pub stages: Vec<(&'static str, f64)>,
    /// From the edit to here.
    pub latency_ms: f64,
    pub device: String,
    /// What became of a device that failed.
    pub trouble: Option<String>,
    /// The object and its lights.
    pub set: Option<(Arc<ObjectMesh>, Arc<Vec<DirectionalLight>>)>,
    pub camera: Camera,
    /// From the camera to the object, in radii.
    pub distance: f32,
    pub notes: Vec<String>,
    /// What is weak about the material, known once the picture is final.
    pub warnings: Vec<String>,
    pub effects: Vec<Effect>,
    /// What the preset that made it is called.
    pub preset: &'static str,
}

/// What comes back.
#[derive(Debug, Clone)]
pub enum ImageAnswer {
    Made(Box<Made>),
    /// What is being done, for the status line.
    Doing(u64, &'static str),
    Failed(u64, String),
    /// The worker met a fault and went on anew.
    Fault(String),
}
