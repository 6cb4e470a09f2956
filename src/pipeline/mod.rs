//! From a scene to its effective BRDF: stages in order, each a pure function of keyed inputs.
//!
//! ```text
//! BuildTile ─▶ LoadMaterials ─▶ SampleFacets ─▶ Plan ─▶ ComputeVisibility ─▶ direct sum | low rank ─▶ Interreflect ─▶ Outcome
//! BuildFace (top, bottom) ─▶ CorrelateFaces ─▶ TraceInner ─▶ SlabOutcome
//! ```
//! A [`Stage`] hashes its settings and the keys of its inputs. [`Pipeline::get`] returns the last result of a stage if
//! the key is the same, else reads it from the disk cache, else runs the stage. An edit therefore recomputes what lies
//! downstream of it.

pub mod color_filter;
#[cfg(test)]
mod color_filter_tests;
mod env;
mod features;
mod gpu_tile;
mod inputs;
mod low_rank;
mod outcome;
mod reference;
mod refine;
mod shading;
mod shading_check;
mod slab;
mod slab_values;
mod stage;
mod stages;
#[cfg(test)]
mod slab_tests;
#[cfg(test)]
mod tests;
mod wu2011;

use std::path::Path;
use std::sync::{Arc, Mutex, OnceLock};
use std::time::Instant;

pub use self::env::{Env, GpuAccess, GpuOpener};
pub use self::gpu_tile::GpuTile;
use self::inputs::{Processor, TileInputs};
use self::low_rank::FactorInputs;
pub use self::outcome::Outcome;
use self::outcome::{ExaminedSum, limits};
use self::refine::RefinedSum;
pub use self::shading::ShadingBrdf;
use self::shading::{RecentTables, Shading, ShadingKeys};
pub use self::slab::{SlabOutcome, refuse_slab};
pub use self::slab_values::{PHOTON_TARGET, SlabValues, require_faces};
pub use self::stage::{Codec, Keyed, Stage, StageTimes};
use self::stage::{Memo, elapsed_ms, lock};
use self::stages::{
    BuildCells, BuildHierarchy, BuildTile, CastTransport, ColorFacets, ColorTile, ComputeVisibility, FacetsRole,
    FindMirrorPlanes, Interreflect, LoadMaterials, MeasureBouncedShare, MeasureRelief, PaperTables, PrepareSamplers,
    Reflection, SampleDrivers, SampleFacets, TileShape,
};
use crate::base::{Cancel, Result};
use crate::brdf::MaterialAssignment;
use crate::cache::{Cache, Key, KeyBuilder};
use crate::diagnostics::{Health, HealthInputs, VisibilityInput};
use crate::effective::{Direct, EffectiveBrdf, Representation};
use crate::geometry::{Facets, TileMesh};
use crate::interreflection::{InterreflectionSettings, InterreflectionTable};
use crate::metrics::Errors;
use crate::plan::{Preset, ProductMethod, Refinement, Settings, VisibilityAlgorithm};
use crate::scene::{LoadedScene, Scene};
use crate::visibility::Visibility;

/// Computes effective BRDFs. Clones share the memo.
#[derive(Debug, Clone, Default)]
pub struct Pipeline {
    env: Env,
    memo: Arc<Memo>,
    last_outcome: Arc<Mutex<Option<(Key, Outcome)>>>,
    recent_tables: Arc<RecentTables>,
    /// The last settings and their key: most edits keep them.
    last_settings: Arc<Mutex<Option<(Settings, Key)>>>,
    disk: Cache,
}

/// A tile with its visibility and its materials.
struct VisibleSurface<'a> {
    tile: &'a Keyed<TileShape>,
    facets: &'a Keyed<Facets>,
    visibility: &'a Keyed<Visibility>,
    assignment: &'a Keyed<MaterialAssignment>,
    material_of_slot: &'a [usize],
}

impl Pipeline {
    /// A pipeline that runs on the CPU and stores nothing on disk. `crate::gpu::pipeline` returns one that may open a
    /// GPU.
    pub fn new() -> Self {
        Self::default()
    }

    /// Later calls return [`crate::base::Error::Cancelled`] soon after `cancel` is set. Finished stages stay in the
    /// memo.
    pub fn set_cancel(&mut self, cancel: Cancel) {
        self.env.cancel = cancel;
    }

    /// Sets the function that opens the GPU when a scene first needs it.
    pub fn with_gpu_opener(mut self, opener: GpuOpener) -> Self {
        self.env.gpu_opener = Some(opener);
        self
    }

    /// Allows or forbids the GPU. Without it, everything is computed as on a machine that has no adapter worth using.
    pub fn allow_gpu(&mut self, allowed: bool) {
        self.env.gpu_forbidden = !allowed;
    }

    /// Uses a GPU that is already open.
    pub fn set_gpu(&mut self, gpu: Arc<dyn GpuAccess>) {
        self.env.open_gpu = OnceLock::from(Some(gpu));
    }

    /// Reads results that take long to compute from `cache`, and stores them there.
    pub fn set_cache(&mut self, cache: Cache) {
        self.disk = cache;
    }

    /// The result of a stage: from the memo, from disk, or computed. Times are added only if the stage ran or was read.
    ///
    /// # Errors
    /// As the stage, or [`crate::base::Error::Cancelled`].
    pub fn get<S: Stage>(&self, stage: S, times: &mut StageTimes) -> Result<Keyed<S::Output>> {
        self.memo.get_or_run(&stage, &self.env, &self.disk, times)
    }

    /// The number of times that each of these stages ran or was read from disk. A stage that the plan drops stays at 0.
    pub fn runs(&self) -> Vec<(&'static str, u64)> {
        let names = [
            BuildTile::NAME,
            SampleFacets::NAME,
            LoadMaterials::NAME,
            ComputeVisibility::NAME,
            FindMirrorPlanes::NAME,
            BuildCells::NAME,
            BuildHierarchy::NAME,
            PrepareSamplers::NAME,
            MeasureBouncedShare::NAME,
            CastTransport::NAME,
            Interreflect::NAME,
            PaperTables::NAME,
            "slab_top",
            "slab_bottom",
            stages::CorrelateFaces::NAME,
            stages::TraceInner::NAME,
            SampleDrivers::NAME,
            MeasureRelief::NAME,
            ColorTile::NAME,
            ColorFacets::NAME,
        ];
        names.into_iter().map(|name| (name, self.memo.runs(name))).collect()
    }

    /// A key of a file's content. `path` is relative to `base_dir`, or `asset:` and a name.
    pub fn file_key(&self, base_dir: &Path, path: &Path) -> Key {
        self.env.file_key(base_dir, path)
    }

    fn tile(&self, loaded: &LoadedScene, times: &mut StageTimes) -> Result<Keyed<TileShape>> {
        let tile = &self.get(BuildTile::new(loaded, &self.env), times)?;
        let Some(map) = &loaded.scene.color_map else { return Ok(tile.clone()) };
        let drivers = &self.get(SampleDrivers::new(loaded, map, &self.env), times)?;
        let relief = &self.get(MeasureRelief { tile, surface: map.surface.as_ref() }, times)?;
        self.get(ColorTile { tile, map, drivers, relief }, times)
    }

    /// The facets of a tile. An edit of a colour map keeps their places.
    fn facets(
        &self,
        tile: &Keyed<TileShape>,
        settings: &Settings,
        role: FacetsRole,
        times: &mut StageTimes,
    ) -> Result<Keyed<Facets>> {
        // The facet of a level tile has the mean colour of the tile. Bins lose the interpolated normals.
        let keeps_places = !tile.flat && (settings.normal_bins.is_none() || tile.mesh.corner_normals.is_none());
        let below = tile.below.as_ref().filter(|_| keeps_places);
        let placed = below.unwrap_or(tile);
        // Stages of their own, which interreflection shares and whose times are stated apart.
        let mut grid = None;
        if SampleFacets::needs_grid(placed, settings) {
            let cells = self.get(BuildCells { tile: placed }, times)?.value;
            self.get(BuildHierarchy { tile: placed, grid: &cells }, times)?;
            grid = Some(cells);
        }
        let facets = self.get(SampleFacets { tile: placed, settings, grid, role }, times)?;
        if below.is_none() {
            return Ok(facets);
        }
        let facets = &facets;
        self.get(ColorFacets { tile, facets, settings, role }, times)
    }

    fn assignment(
        &self,
        loaded: &LoadedScene,
        tile: &TileShape,
        times: &mut StageTimes,
    ) -> Result<Keyed<MaterialAssignment>> {
        self.get(LoadMaterials::new(loaded, &tile.mesh.slots, &self.env), times)
    }

    /// Visibility of the facets by the plan's algorithm. Without an algorithm, no stage runs.
    fn visibility(&self, inputs: &TileInputs, times: &mut StageTimes) -> Result<Keyed<Visibility>> {
        self.finer_visibility(inputs, None, times)
    }

    /// As [`Pipeline::visibility`], from that of the same facets along fewer azimuths, if there is one.
    fn finer_visibility(
        &self,
        inputs: &TileInputs,
        coarser: Option<&Visibility>,
        times: &mut StageTimes,
    ) -> Result<Keyed<Visibility>> {
        let TileInputs { tile, facets, settings, plan, refined, .. } = inputs;
        if plan.algorithm == VisibilityAlgorithm::None {
            let mut key = KeyBuilder::of_stage("unblocked");
            key.key("facets", &facets.key);
            let value = Arc::new(Visibility::Unblocked { facets: facets.len() });
            return Ok(Keyed { key: key.finish(), value });
        }
        let (algorithm, refined) = (plan.algorithm, *refined);
        self.get(ComputeVisibility { tile, facets, algorithm, settings, refined, coarser }, times)
    }

    /// The key of all settings.
    fn settings_key(&self, settings: &Settings) -> Key {
        let mut last = lock(&self.last_settings);
        if let Some((_, key)) = last.as_ref().filter(|(last, _)| last == settings) {
            return *key;
        }
        let key = KeyBuilder::of_stage("settings").debug("settings", settings).finish();
        *last = Some((settings.clone(), key));
        key
    }

    /// Keys of the surface and of the lobes on it.
    fn shading_keys(&self, inputs: &TileInputs, visibility: &Keyed<Visibility>) -> ShadingKeys {
        let TileInputs { settings, facets, materials, material_of_slot, .. } = inputs;
        let mut surface = KeyBuilder::of_stage("surface");
        surface.key("settings", &self.settings_key(settings));
        surface.key("facets", &facets.key).key("visibility", &visibility.key);
        let mut lobes = KeyBuilder::of_stage("lobes");
        lobes.counts("material of slot", material_of_slot.iter().copied());
        let effects = &settings.effects;
        lobes.debug("effects", &[effects.exact_lobes, effects.color_weights, effects.black_materials]);
        for material in &materials.materials {
            material.hash_lobes_into(&mut lobes);
        }
        let (surface, lobes) = (surface.finish(), lobes.finish());
        ShadingKeys { surface, lobes, facets: facets.key, visibility: visibility.key }
    }

    /// The effective BRDF of a scene at its own quality.
    ///
    /// # Errors
    /// A file that the scene names cannot be used, a factorization fails, or [`crate::base::Error::Cancelled`].
    pub fn effective(&self, loaded: &LoadedScene) -> Result<Outcome> {
        let mut times = StageTimes::new();
        let inputs = self.tile_inputs(loaded, Processor::Cpu(Refinement::NONE), &mut times)?;
        if inputs.settings.preset == Preset::Wu2011 {
            return self.wu2011(&loaded.scene, inputs, times);
        }
        let visibility = self.visibility(&inputs, &mut times)?;
        let key = outcome_key(&self.shading_keys(&inputs, &visibility), &inputs.materials.key);
        if let Some((_, outcome)) = lock(&self.last_outcome).as_ref().filter(|(last, _)| *last == key) {
            return Ok(Outcome { times, ..outcome.clone().for_scene(&loaded.scene) });
        }
        self.env.cancel.check()?;
        let refined = self.refined_sum(loaded, inputs, visibility, &mut times)?;
        let outcome = self.outcome_of(&loaded.scene, refined, times)?;
        *lock(&self.last_outcome) = Some((key, outcome.clone()));
        Ok(outcome)
    }

    /// The outcome of a direct sum: its factors if the plan tries them and they pass their check, interreflection, and
    /// the representation that images read.
    fn outcome_of(&self, scene: &Scene, refined: RefinedSum, mut times: StageTimes) -> Result<Outcome> {
        let refinement_note = refined.note();
        let RefinedSum { inputs, visibility, direct, estimate, mut values, .. } = refined;
        let (mut close_to_bound, algorithm) = (estimate.is_some(), inputs.plan.algorithm);
        let keys = self.shading_keys(&inputs, &visibility);
        let start = Instant::now();
        let (mut brdf, factored) = self.product(direct.clone(), &inputs, &visibility, keys.lobes)?;
        times.push(("product", elapsed_ms(start)));
        let TileInputs { tile, settings, materials, facets, material_of_slot, mut plan, .. } = inputs;
        let is_low_rank = matches!(brdf.representation, Representation::LowRank(_));
        let mut notes = notes(scene, &tile.mesh, &facets);
        notes.extend(refinement_note);
        if let Some(first) = plan.interreflection {
            let surface = VisibleSurface {
                tile: &tile,
                facets: &facets,
                visibility: &visibility,
                assignment: &materials,
                material_of_slot: &material_of_slot,
            };
            let light = self.refined_interreflection(&surface, first, (&direct, &mut values, &settings), &mut times)?;
            close_to_bound |= light.close_to_bound;
            notes.extend(light.note(&first, settings.preset));
            plan.note_interreflection(light.settings);
            brdf = brdf.interreflecting(light.table);
        }
        plan.note_times(&times);
        if let Some(errors) = factored {
            plan.note_low_rank(is_low_rank, errors.rel_l2);
        }
        let brdf = Arc::new(brdf);
        let stored = (&self.recent_tables, &self.disk);
        let shading = Shading::new(brdf.clone(), &tile, &settings, plan.try_shading_table, keys, stored);
        let health_inputs = HealthInputs {
            facets: facets.value.clone(),
            visibility: VisibilityInput::Soft(visibility.value),
            names: material_names(scene, &tile.mesh, &materials)?,
            materials: materials.value,
            closes_plane: tile.mesh.closes_plane,
            size: tile.mesh.size,
            color: tile.mesh.color.clone(),
        };
        // Factors that are asked for are used whatever their error is.
        let asks_for_factors = is_low_rank && settings.method == ProductMethod::LowRank;
        Ok(Outcome {
            brdf,
            plan,
            settings,
            times,
            factored,
            notes,
            health_inputs,
            examined: Arc::default(),
            shading: Arc::new(shading),
            close_to_bound: close_to_bound || asks_for_factors,
            direct: Some(ExaminedSum { direct, tile, material_of_slot, algorithm, env: self.env.clone() }),
            estimator: Arc::default(),
        })
    }

    /// The direct sum, or factors if the plan tries them and they are close to it; and their errors if they were tried.
    fn product(
        &self,
        direct: Direct,
        inputs: &TileInputs,
        visibility: &Keyed<Visibility>,
        lobes: Key,
    ) -> Result<(EffectiveBrdf, Option<Errors>)> {
        let TileInputs { tile, settings, materials, facets, material_of_slot, plan, .. } = inputs;
        let base_area = f64::from(tile.mesh.base_area());
        if !plan.try_low_rank {
            self.forget_low_rank();
            return Ok((EffectiveBrdf { representation: Representation::Direct(direct), base_area }, None));
        }
        let factor_inputs = FactorInputs {
            facets,
            visibility,
            material_of_slot,
            materials: &materials.materials,
            lobes,
            whole_sphere: !tile.height_field,
            base_area,
        };
        let (brdf, errors) = self.low_rank(direct, &factor_inputs, settings)?;
        Ok((brdf, Some(errors)))
    }

    /// Interreflection. Rays are cast again only if the facets or the number of rays changed. `refined` settings leave the
    /// results of the main ones in the memo.
    fn interreflection(
        &self,
        surface: &VisibleSurface<'_>,
        (settings, refined): (&InterreflectionSettings, bool),
        times: &mut StageTimes,
    ) -> Result<Arc<InterreflectionTable>> {
        let VisibleSurface { tile, facets, visibility, assignment, material_of_slot } = *surface;
        let materials = &assignment.materials[..];
        let samplers = &self.get(PrepareSamplers { materials }, times)?;
        let grid = &self.get(BuildCells { tile }, times)?.value;
        self.get(BuildHierarchy { tile, grid }, times)?;
        let transport = &self.get(CastTransport { tile, grid, facets, settings, refined }, times)?;
        let reflection = &Reflection { assignment: assignment.key, material_of_slot, materials, samplers };
        Ok(self.get(Interreflect { tile, facets, visibility, transport, reflection, settings, refined }, times)?.value)
    }

    /// The tile's mesh.
    ///
    /// # Errors
    /// A file that the geometry names cannot be used.
    pub fn mesh(&self, loaded: &LoadedScene) -> Result<TileMesh> {
        Ok(self.tile(loaded, &mut StageTimes::new())?.mesh.clone())
    }

    /// The materials of a scene, and the material of each slot of the mesh.
    ///
    /// # Errors
    /// A slot has no material, or a BRDF file cannot be used.
    pub fn materials(&self, loaded: &LoadedScene) -> Result<MaterialAssignment> {
        let mut times = StageTimes::new();
        let tile = self.tile(loaded, &mut times)?;
        Ok(self.assignment(loaded, &tile, &mut times)?.value.as_ref().clone())
    }

    /// The health of the inputs of the reference sum: mesh and materials.
    ///
    /// # Errors
    /// As [`Pipeline::materials`].
    pub fn input_health(&self, loaded: &LoadedScene) -> Result<Health> {
        let mut times = StageTimes::new();
        let tile = self.tile(loaded, &mut times)?;
        let materials = self.assignment(loaded, &tile, &mut times)?;
        let names = material_names(&loaded.scene, &tile.mesh, &materials)?;
        let settings = Settings::from_quality(&loaded.scene.quality);
        Ok(Health::of_input(&tile.mesh, &materials.materials, &names, limits(&settings)))
    }
}

fn outcome_key(keys: &ShadingKeys, materials: &Key) -> Key {
    let mut key = KeyBuilder::of_stage("outcome");
    key.key("surface", &keys.surface).key("materials", materials);
    key.finish()
}

/// The name of each assigned material.
fn material_names(scene: &Scene, mesh: &TileMesh, assignment: &MaterialAssignment) -> Result<Vec<String>> {
    let mut names = vec![String::new(); assignment.materials.len()];
    for (slot, &material) in mesh.slots.iter().zip(&assignment.material_of_slot) {
        scene.material_for_slot(slot)?.name.clone_into(&mut names[material]);
    }
    Ok(names)
}

fn notes(scene: &Scene, mesh: &TileMesh, facets: &Facets) -> Vec<String> {
    let mut notes = mesh.notes.clone();
    for (name, slot) in scene.misspelt_materials(&mesh.slots) {
        notes.push(format!(
            "no part of the tile is called `{name}`, so that this material is not used (did you mean `{slot}`?)"
        ));
    }
    if facets.skipped_triangles > 0 {
        notes.push(format!("{} triangles have no area and were left out", facets.skipped_triangles));
    }
    notes
}
