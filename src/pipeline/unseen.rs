//! A tile as a device takes it that makes visibility and product itself: what comes before them.

use std::sync::Arc;

use super::pictures::THINNED;
use super::{Pipeline, Prepared, StageTimes};
use crate::error::Result;
use crate::filtering::{FacetSum, Heights, Maps, Nodes, Sight, Sliced, UnseenSum};
use crate::geometry::mirror_planes_in;
use crate::plan::{Plan, Preset, Route, Settings, Sighting};
use crate::scene::{LoadedScene, Switch};
use crate::visibility::PeriodicGrid;

/// What is known of a tile without its visibility.
#[derive(Debug)]
pub struct Unseen {
    pub sum: UnseenSum,
    pub plan: Plan,
    pub settings: Settings,
    /// Of the stages that ran.
    pub times: StageTimes,
    pub notes: Vec<String>,
}

/// To find mirror planes takes some milliseconds: more than half of a table of fewer nodes takes a device.
const MIRRORED_FROM: usize = 60_000;

/// Facets that are picked for each half vector of a table; how far it is off then, docs/speed.md tells ("On a graphics processor").
const PICKED: usize = 1600;

/// Facets that are kept at least of few normals, whose lobes are exact. How far these are off stands there, too. Nothing checks
/// them before refinement does, so they are taken at the CPU's steps only: of every 82nd facet those of grooves fell in step (272 % off).
const THIN: usize = 600;

/// Of more normals, each would keep too many: the CPU picks.
const FEW_NORMALS: usize = 16;

/// Few of the facets of few normals, and their places, where a facet sees along horizons: they are left out before they see
/// anything.
fn thinned(sum: &FacetSum, route: Route) -> Option<(FacetSum, Vec<usize>)> {
    let few = sum.distinct_normals().is_some_and(|normals| normals <= FEW_NORMALS);
    let step = THINNED.into_iter().find(|step| sum.facet_count() >= THIN * step).unwrap_or(1);
    (few && is_few(sum, route)).then(|| sum.thinned(step)).flatten()
}

/// Whether normals are few, and seen along horizons.
fn is_few(sum: &FacetSum, route: Route) -> bool {
    sum.has_few_normals() && matches!(route, Route::HeightMarch | Route::HorizonScan)
}

impl Pipeline {
    /// What a device needs that makes visibility and product itself. `None` where only the CPU makes what the scene calls
    /// for: measured BRDFs summed over facets, light between facets, the paper's own tables.
    ///
    /// # Errors
    /// As [`Pipeline::effective`].
    pub fn unseen(&mut self, loaded: &LoadedScene) -> Result<Option<Unseen>> {
        let mut times = StageTimes::new();
        let prepared = self.prepare(loaded, false, &mut times)?;
        let Prepared { sum, plan, settings, .. } = &prepared;
        if settings.preset == Preset::Wu2011 || plan.interreflection || sum.measured_count() > 0 {
            return Ok(None);
        }
        let thinned = thinned(sum, plan.route);
        if thinned.is_none() && is_few(sum, plan.route) {
            return Ok(None);
        }
        let (mesh, facets) = (&prepared.shape.mesh, prepared.facets.clone());
        let facets = thinned.as_ref().map_or(facets, |(_, kept)| Arc::new(prepared.facets.picked(kept)));
        let sight = match (plan.route, &mesh.height_grid) {
            (Route::HeightMarch, Some(samples)) => Sight::Heights(Heights {
                samples: samples.clone(),
                tile_size: mesh.size,
                facets,
                azimuths: settings.horizon_azimuths,
                ramp: settings.penumbra,
            }),
            (Route::GpuMaps | Route::CpuMaps, _) if settings.sighting == Sighting::Maps => {
                Sight::Maps(Box::new(Maps {
                    mesh: mesh.clone(),
                    facets,
                    grid: settings.map_grid,
                    resolution: settings.map_resolution,
                }))
            }
            (Route::HorizonScan | Route::Slices | Route::GpuMaps | Route::CpuMaps, _) => {
                let overhangs = plan.route != Route::HorizonScan;
                let cells = || Ok(PeriodicGrid::new(mesh));
                let grid = self.cells.get("cells", prepared.shape_version, &mut times, &self.cancel, cells)?.0;
                Sight::Slices(Box::new(Sliced {
                    grid,
                    facets,
                    azimuths: if overhangs { settings.slice_azimuths } else { settings.horizon_azimuths },
                    ramp: settings.penumbra,
                    overhangs,
                }))
            }
            _ => Sight::Seen(self.seen(&prepared, &mut times)?.0),
        };
        let is_thin = thinned.is_some();
        let Prepared { shape, settings, sum, plan, shape_version, .. } = prepared;
        let sum = thinned.map_or(sum, |(thinned, _)| thinned);
        // What is thin is exact between nodes, too.
        let grid = settings.picture_grids.last().copied().filter(|_| plan.try_picture_table && !is_thin);
        let is_large = grid.is_some_and(|grid| grid.nodes() > MIRRORED_FROM);
        let mirrors = if is_large && settings.effects.mirror_symmetry != Switch::Off {
            let cells = match &sight {
                Sight::Slices(of) => Some(&*of.grid),
                _ => None,
            };
            let find = || Ok(mirror_planes_in(&shape.mesh, cells));
            *self.mirrors.get("mirrors", shape_version, &mut times, &self.cancel, find)?.0
        } else {
            [false; 2]
        };
        let base_area = f64::from(shape.mesh.base_area());
        let nodes = grid.map(|grid| Nodes { mirrors, facets: Some(PICKED), ..Nodes::all(grid) });
        let sum = UnseenSum { sum, sight, base_area, nodes, interpolation: settings.interpolation };
        Ok(Some(Unseen { sum, notes: shape.mesh.notes.clone(), plan, settings, times }))
    }
}
