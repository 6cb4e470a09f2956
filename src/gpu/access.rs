//! The pipeline's door to the GPU.

use std::sync::Arc;

use glam::Vec3;

use super::visibility::visibility_maps_gpu;
use super::{Gpu, Tier};
use crate::base::{Cancel, Result};
use crate::geometry::{Facets, TileMesh};
use crate::pipeline::GpuAccess;
use crate::visibility::PackedVisibility;

impl GpuAccess for Gpu {
    fn is_hardware(&self) -> bool {
        self.tier == Tier::Hardware
    }

    fn visibility_maps(
        &self,
        mesh: &TileMesh,
        facets: &Facets,
        directions: &[Vec3],
        resolution: u32,
        cancel: &Cancel,
    ) -> Result<PackedVisibility> {
        Ok(visibility_maps_gpu(self, mesh, facets, directions, resolution, cancel)?)
    }
}

/// Opens the GPU of the machine; `None` if there is none.
pub(super) fn open() -> Option<Arc<dyn GpuAccess>> {
    Gpu::open().ok().map(|gpu| Arc::new(gpu) as Arc<dyn GpuAccess>)
}
