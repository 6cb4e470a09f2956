//! A slab as a viewer sees through it: paths from the viewer through facets of both faces, and the lobes that they make.

mod btdf;
mod face_samples;
mod lobe_table;
mod sheet;
mod walk;

use std::sync::Arc;

use glam::{Vec2, Vec3};

pub use self::btdf::BtdfView;
use self::face_samples::FaceSamples;
use self::lobe_table::LobeTable;
use self::sheet::{SheetPoint, SheetView};
use super::capture::svbtdf::Svbtdf;
use super::model::Slab;
use super::ndf::Ndf;
use crate::effective::{PathEnd, VaryingSurface, ViewLobes, ViewPaths, Viewer};

/// Colour channels that refract alike.
#[derive(Debug, Clone, Copy)]
struct ChannelGroup {
    eta: f32,
    /// 1 for the channels of the group, otherwise 0.
    mask: Vec3,
}

/// The faces that paths meet.
#[derive(Debug, Clone)]
struct Faces {
    top: FaceSamples,
    bottom: FaceSamples,
    /// The normals of both faces.
    normals: [Arc<Ndf>; 2],
    /// Groups whose index is not that of the surroundings.
    groups: Vec<ChannelGroup>,
    /// Absorption times thickness.
    depth: Vec3,
    bounces: bool,
    diffuse: Vec3,
}

/// A slab prepared for images: light from behind and from the viewer's side, exact for Eq. 1 of Dai et al. 2009 and with
/// all reflections inside, or a captured sheet by Eq. 11.
#[derive(Debug, Clone)]
pub struct SlabView {
    slab: Arc<Slab>,
    source: Source,
}

#[derive(Debug, Clone)]
enum Source {
    Faces { faces: Faces, lobes: LobeTable },
    Sheet(SheetView),
}

/// A slab at one place.
#[derive(Debug, Clone)]
pub struct SlabPoint<'a> {
    slab: &'a Slab,
    source: PointSource<'a>,
}

#[derive(Debug, Clone)]
enum PointSource<'a> {
    Faces { faces: &'a Faces, lobes: &'a LobeTable },
    Sheet(SheetPoint<'a>),
}

impl SlabView {
    /// Prepares a slab whose top faces the viewer.
    pub fn new(slab: Arc<Slab>) -> Self {
        let mut groups: Vec<ChannelGroup> = Vec::new();
        for (k, axis) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().enumerate() {
            let eta = slab.optics.eta[k] as f32;
            match groups.iter_mut().find(|group| group.eta == eta) {
                Some(group) => group.mask += axis,
                None => groups.push(ChannelGroup { eta, mask: axis }),
            }
        }
        groups.retain(|group| group.eta != 1.0);
        let depth = (slab.optics.absorption * slab.optics.thickness).max(glam::DVec3::ZERO).as_vec3();
        let faces = Faces {
            top: FaceSamples::new(&slab.top, false),
            bottom: FaceSamples::new(&slab.bottom, true),
            normals: [slab.top.clone(), slab.bottom.clone()],
            groups,
            depth,
            bounces: slab.inner.is_some(),
            diffuse: slab.optics.diffuse.as_vec3(),
        };
        let lobes = LobeTable::new(&faces, &slab);
        Self { slab, source: Source::Faces { faces, lobes } }
    }

    /// Prepares a captured sheet whose top faces the viewer; `slab` is its mean.
    pub fn of_sheet(slab: Arc<Slab>, sheet: Arc<Svbtdf>) -> Self {
        Self { slab, source: Source::Sheet(SheetView::new(sheet)) }
    }
}

impl SlabView {
    /// Lobes at 33 x 33 directions of the viewer, over the square around the disc of stereographic coordinates. Means
    /// are relative to the straight direction. `None` for a captured sheet, whose lobes vary.
    pub fn lobe_nodes(&self) -> Option<&[ViewLobes]> {
        match &self.source {
            Source::Faces { lobes, .. } => Some(lobes.nodes()),
            Source::Sheet(_) => None,
        }
    }
}

impl VaryingSurface for SlabView {
    type Point<'a> = SlabPoint<'a>;

    fn at(&self, place: Vec2) -> SlabPoint<'_> {
        let source = match &self.source {
            Source::Faces { faces, lobes } => PointSource::Faces { faces, lobes },
            Source::Sheet(sheet) => PointSource::Sheet(sheet.at(place)),
        };
        SlabPoint { slab: &self.slab, source }
    }
}

impl ViewPaths for SlabPoint<'_> {
    fn follow(&self, viewer: &Viewer, end: impl FnMut(PathEnd)) -> [Vec3; 2] {
        match &self.source {
            PointSource::Faces { faces, .. } => faces.follow(viewer, end),
            PointSource::Sheet(sheet) => sheet.follow(viewer, end),
        }
    }

    fn lobes(&self, o: Vec3) -> ViewLobes {
        match &self.source {
            PointSource::Faces { lobes, .. } => lobes.at(o),
            PointSource::Sheet(sheet) => sheet.lobes(o),
        }
    }

    fn straight(&self, o: Vec3) -> [Vec3; 2] {
        self.slab.straight(o.as_dvec3()).map(|part| part.as_vec3())
    }
}

/// The middle of a captured sheet; a slab of two faces is the same everywhere.
impl ViewPaths for SlabView {
    fn follow(&self, viewer: &Viewer, end: impl FnMut(PathEnd)) -> [Vec3; 2] {
        self.at(Vec2::splat(0.5)).follow(viewer, end)
    }

    fn lobes(&self, o: Vec3) -> ViewLobes {
        self.at(Vec2::splat(0.5)).lobes(o)
    }

    fn straight(&self, o: Vec3) -> [Vec3; 2] {
        self.at(Vec2::splat(0.5)).straight(o)
    }
}

#[cfg(test)]
mod tests;
