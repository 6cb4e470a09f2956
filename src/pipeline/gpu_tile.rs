//! A tile as a device takes it that makes visibility and product itself: what comes before them.

use super::{For, Pipeline, Prepared, StageTimes};
use crate::base::Result;
use crate::effective::{FacetSum, GpuTileInput, GpuVisibilityInput, Heights, Maps, Nodes, Sliced};
use crate::geometry::PeriodicGrid;
use crate::geometry::mirror_planes_in;
use crate::math::directions::HemispherePairGrid;
use crate::plan::{Plan, Preset, Settings, VisibilityAlgorithm, VisibilityMethod};
use crate::scene::{LoadedScene, Switch};

/// What is known of a tile without its visibility.
#[derive(Debug)]
pub struct GpuTile {
    pub sum: GpuTileInput,
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

/// Azimuths along which facets see at most where a table is made of them, on height-fields and under overhangs. What this and
/// [`HALF_VECTORS`] change of its error, the same section tells.
const AZIMUTHS: [usize; 2] = [48, 96];

/// Rings and azimuths of half vectors that a table has at most: picks leave more error than the steps between more of these.
const HALF_VECTORS: [usize; 2] = [24, 48];

/// Facets of few normals, whose lobes are exact: placed anew, as many as the sequence that places them spreads well over the tiles
/// that ship. Steps between the many leave grooves and pyramids unevenly covered.
const FEW_FACETS: usize = 700;

/// Of more normals, too few facets are left to each: the CPU makes what is shown.
const FEW_NORMALS: usize = 16;

/// Whether normals are few, and seen along horizons.
fn is_few(sum: &FacetSum, route: VisibilityAlgorithm) -> bool {
    sum.has_few_normals() && matches!(route, VisibilityAlgorithm::HeightMarch | VisibilityAlgorithm::HorizonScan)
}

impl Pipeline {
    /// What a device needs that makes visibility and product itself. `None` where only the CPU makes what the scene calls
    /// for: measured BRDFs summed over facets, light between facets, the paper's own tables.
    ///
    /// # Errors
    /// As [`Pipeline::effective`].
    pub fn unseen(&mut self, loaded: &LoadedScene) -> Result<Option<GpuTile>> {
        let mut times = StageTimes::new();
        let few = self.few_facets(loaded, &mut times)?;
        let is_thin = few.is_some();
        let prepared = match few {
            Some(prepared) => prepared,
            None => self.prepare(loaded, For::Device, &mut times)?,
        };
        let Prepared { sum, plan, settings, .. } = &prepared;
        if settings.preset == Preset::Wu2011 || plan.interreflection || sum.measured_count() > 0 {
            return Ok(None);
        }
        if !is_thin && is_few(sum, plan.route) {
            return Ok(None);
        }
        // What is thin is exact between nodes, too.
        let grid =
            settings.image_grids.last().filter(|_| plan.try_shading_table && !is_thin).map(|grid| HemispherePairGrid {
                rings: grid.rings.min(HALF_VECTORS[0]),
                azimuths: grid.azimuths.min(HALF_VECTORS[1]),
                ..*grid
            });
        let [of_horizons, of_slices] = AZIMUTHS.map(|most| if grid.is_some() { most } else { usize::MAX });
        let of_horizons = settings.horizon_azimuths.min(of_horizons);
        let of_slices = settings.slice_azimuths.min(of_slices);
        let (mesh, facets) = (&prepared.shape.mesh, prepared.facets.clone());
        let sight = match (plan.route, &mesh.height_grid) {
            (VisibilityAlgorithm::HeightMarch, Some(samples)) => GpuVisibilityInput::Heights(Heights {
                samples: samples.clone(),
                tile_size: mesh.size,
                facets,
                azimuths: of_horizons,
                ramp: settings.penumbra,
            }),
            (VisibilityAlgorithm::GpuMaps | VisibilityAlgorithm::CpuMaps, _)
                if settings.sighting == VisibilityMethod::Maps =>
            {
                GpuVisibilityInput::Maps(Box::new(Maps {
                    mesh: mesh.clone(),
                    facets,
                    grid: settings.map_grid,
                    resolution: settings.map_resolution,
                }))
            }
            (
                VisibilityAlgorithm::HorizonScan
                | VisibilityAlgorithm::OcclusionIntervals
                | VisibilityAlgorithm::GpuMaps
                | VisibilityAlgorithm::CpuMaps,
                _,
            ) => {
                let overhangs = plan.route != VisibilityAlgorithm::HorizonScan;
                let cells = || Ok(PeriodicGrid::new(mesh));
                let grid = self.cells.get("cells", prepared.shape_version, &mut times, &self.cancel, cells)?.0;
                GpuVisibilityInput::OcclusionIntervals(Box::new(Sliced {
                    grid,
                    facets,
                    azimuths: if overhangs { of_slices } else { of_horizons },
                    ramp: settings.penumbra,
                    overhangs,
                }))
            }
            _ => GpuVisibilityInput::Seen(self.seen(&prepared, &mut times)?.0),
        };
        let Prepared { shape, settings, sum, plan, shape_version, .. } = prepared;
        let is_large = grid.is_some_and(|grid| grid.nodes() > MIRRORED_FROM);
        let mirrors = if is_large && settings.effects.mirror_symmetry != Switch::Off {
            let cells = match &sight {
                GpuVisibilityInput::OcclusionIntervals(of) => Some(&*of.grid),
                _ => None,
            };
            let find = || Ok(mirror_planes_in(&shape.mesh, cells));
            *self.mirrors.get("mirrors", shape_version, &mut times, &self.cancel, find)?.0
        } else {
            [false; 2]
        };
        let base_area = f64::from(shape.mesh.base_area());
        let nodes = grid.map(|grid| Nodes { mirrors, facets: Some(PICKED), ..Nodes::all(grid) });
        let sum = GpuTileInput { sum, sight, base_area, nodes, interpolation: settings.interpolation };
        Ok(Some(GpuTile { sum, notes: shape.mesh.notes.clone(), plan, settings, times }))
    }

    /// Where normals are few and seen along horizons, few facets and what comes of them; more where one material has a small share.
    fn few_facets(&mut self, loaded: &LoadedScene, times: &mut StageTimes) -> Result<Option<Prepared>> {
        let (shape, _) = self.shape(loaded, times)?;
        if shape.mesh.distinct_normals(FEW_NORMALS).is_none() {
            return Ok(None);
        }
        for most in [1, 4, 16].map(|times| times * FEW_FACETS) {
            let prepared = self.prepare(loaded, For::DeviceOfFew(most), times)?;
            let Prepared { sum, plan, settings, .. } = &prepared;
            if is_few(sum, plan.route) && sum.distinct_normals().is_some_and(|normals| normals <= FEW_NORMALS) {
                return Ok(Some(prepared));
            }
            let is_seen_so = matches!(plan.route, VisibilityAlgorithm::HeightMarch | VisibilityAlgorithm::HorizonScan);
            if !is_seen_so || sum.colors_vary() || settings.facets < most {
                break;
            }
        }
        Ok(None)
    }
}
