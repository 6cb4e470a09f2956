//! The stages whose results are kept between runs, and what each depends on.

use std::time::Instant;

use super::make::see;
use crate::base::{Cancel, Result};
use crate::cache::{Cache, KeyBuilder};
use crate::effective::{Direct, Nodes, ShadingTable};
use crate::geometry::{Facets, TileMesh};
use crate::gpu::Gpu;
use crate::plan::{Settings, VisibilityAlgorithm};
use crate::visibility::Visibility;

/// What the times of a run call visibility that was made in an earlier one.
pub(super) const VISIBILITY: &str = "cached_visibility";

/// [`see`], or what it made before; and whether that was read.
pub(super) fn visibility(
    cache: &Cache,
    route: VisibilityAlgorithm,
    mesh: &TileMesh,
    facets: &Facets,
    settings: &Settings,
    gpu: Option<&Gpu>,
    cancel: &Cancel,
) -> Result<(Visibility, bool)> {
    // A device's maps are that device's, and quick.
    let cache = if route == VisibilityAlgorithm::GpuMaps { &Cache::off() } else { cache };
    let entry = cache.entry("visibility", |key| identify_sight(key, route, mesh, facets, settings));
    if let Some(seen) = entry.read().filter(|seen: &Visibility| seen.facets() == facets.len()) {
        return Ok((seen, true));
    }
    let start = Instant::now();
    let seen = see(route, mesh, facets, settings, gpu, cancel)?;
    // What was told to stop may have made anything.
    cancel.check()?;
    entry.keep(start, &seen);
    Ok((seen, false))
}

/// All that [`see`] reads.
pub(super) fn identify_sight(
    key: &mut KeyBuilder,
    route: VisibilityAlgorithm,
    mesh: &TileMesh,
    facets: &Facets,
    settings: &Settings,
) {
    key.counts("route", [route as usize]).numbers("tile", &[mesh.size]);
    key.numbers("vertices", &mesh.positions).numbers("triangles", &mesh.triangles);
    if let Some(heights) = &mesh.height_grid {
        key.numbers("samples", &[heights.size]).numbers("heights", &heights.heights);
    }
    key.numbers("positions", &facets.positions).numbers("normals", &facets.normals);
    key.numbers("geometric normals", &facets.geometric_normals).numbers("on triangles", &facets.triangles);
    key.counts("azimuths", [settings.horizon_azimuths, settings.slice_azimuths]);
    key.numbers("penumbra", &[settings.penumbra]);
    key.counts("maps", [settings.map_grid.rings, settings.map_grid.azimuths]);
    key.numbers("texels", &[settings.map_resolution]);
}

/// [`ShadingTable::build`], or what it made before; and whether that was read.
pub(super) fn table(
    cache: &Cache,
    direct: &Direct,
    nodes: Nodes,
    cancel: &Cancel,
) -> Result<Option<(ShadingTable, bool)>> {
    let entry = cache.entry("table", |key| {
        direct.sum.hash_into(key);
        direct.visibility.hash_into(key);
        nodes.hash_into(key);
    });
    if let Some(table) = entry.read().and_then(|content| ShadingTable::of_content(direct, nodes.grid, content)) {
        return Ok(Some((table, true)));
    }
    let start = Instant::now();
    let made = ShadingTable::build(direct, nodes, cancel)?;
    if let Some(table) = &made {
        entry.keep(start, &table.content());
    }
    Ok(made.map(|table| (table, false)))
}
