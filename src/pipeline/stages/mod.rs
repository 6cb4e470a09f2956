//! The stages from scene to effective BRDF, one file per step.

mod factors;
mod interreflection;
mod paper;
mod tile;
mod visibility;

pub(super) use factors::{Factorize, LookUpVisibility, TabulateFactors, TabulateForCheck};
pub(super) use interreflection::{CastTransport, FindMirrorPlanes, Interreflect};
pub(super) use paper::PaperTables;
pub(super) use tile::{BuildTile, LoadMaterials, SampleFacets, TileShape};
pub(super) use visibility::{BuildCells, ComputeVisibility, EstimateScanWork};

use crate::cache::KeyBuilder;

/// Adds anything that prints all that it depends on. Floats print every digit that tells them apart.
fn hash_debug(key: &mut KeyBuilder, name: &str, value: &impl std::fmt::Debug) {
    key.numbers(name, format!("{value:?}").as_bytes());
}
