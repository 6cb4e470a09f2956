//! The stages from scene to effective BRDF, one file per step.

mod color_map;
mod factors;
mod interreflection;
mod paper;
mod slab;
mod tile;
mod visibility;

pub(super) use color_map::{ColorFacets, ColorTile, MeasureRelief, SampleDrivers};
pub(super) use factors::{Factorize, LookUpVisibility, TabulateFactors, TabulateForCheck};
pub(super) use interreflection::{
    CastTransport, FindMirrorPlanes, Interreflect, MeasureBouncedShare, PrepareSamplers, Reflection,
};
pub(super) use paper::PaperTables;
pub(super) use slab::{BuildFace, CorrelateFaces, FaceNormals, ReadSvbtdf, TraceInner};
pub(super) use tile::{BuildTile, FacetsRole, LoadMaterials, SampleFacets, TileShape};
pub(super) use visibility::{BuildCells, BuildHierarchy, ComputeVisibility, EstimateScanWork};
