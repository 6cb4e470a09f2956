//! The stages in order, each with its last result and the input that made it: an edit recomputes what lies downstream.

mod factored;
mod findings;
mod gpu_tile;
mod images;
mod inputs;
mod interreflection;
mod kept;
#[cfg(test)]
mod kept_tests;
mod make;
mod outcome;
mod stage;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use self::factored::{Factored, Made, Source};
pub use self::gpu_tile::GpuTile;
use self::images::Images;
pub use self::images::ShadingBrdf;
use self::make::{grouped, names, same_lobes, sample};
pub use self::outcome::Outcome;
use self::outcome::limits;
use self::stage::{Stage, Version};
use crate::base::{Cancel, Result};
use crate::brdf::MeasuredCache;
use crate::cache::Cache;
use crate::diagnostics::{Health, HealthInputs, VisibilityInput};
use crate::effective::{
    Direct, EffectiveBrdf, FacetSum, Material, MaterialFactors, Representation, VisibilityRows, VisibleFacets, Wu2011,
    Wu2011Settings,
};
use crate::geometry::PeriodicGrid;
use crate::geometry::{Facets, TileMesh};
use crate::gpu::Gpu;
use crate::interreflection::{InterreflectionTable, Transport};
use crate::math::directions::{ParaboloidMap, PolarGrid};
use crate::plan::{Costs, Plan, Preset, SceneFeatures, Settings, VisibilityAlgorithm, decide};
use crate::reference::Reference;
use crate::scene::{LoadedScene, MaterialSpec, Painted, Switch, Tile};
use crate::visibility::{Visibility, visibility_maps_cpu};

/// Milliseconds of the stages that ran, in order; a stage whose input did not change is not listed.
pub type StageTimes = Vec<(&'static str, f64)>;

/// A geometry that is drawn on: the mesh and its parts that later stages ask for.
#[derive(Debug)]
struct TileShape {
    mesh: TileMesh,
    flat: bool,
    height_field: bool,
    /// The largest angle between a surface normal and z [rad].
    steepest: f32,
}

/// The material of each slot of a mesh, by number, and the materials.
type MaterialAssignment = (Vec<usize>, Vec<Material>);
type PaperFactors = Vec<Option<Arc<MaterialFactors>>>;
type ShapeKey = (Tile, PathBuf, Painted);
type MaterialKey = (Vec<MaterialSpec>, Vec<String>, PathBuf);
/// Mesh, count, seed, whether they are drawn as the paper does, and whether their colours count.
type FacetKey = (Version, [Option<usize>; 2], u64, bool, Switch);
type VisibilityKey = (Version, VisibilityAlgorithm, [usize; 2], PolarGrid, u32, u32);
/// Materials, facets (and so the mesh), visibility.
type OutcomeKey = (Settings, [Version; 3]);

/// All that comes before visibility.
#[derive(Debug)]
struct Prepared {
    shape: Arc<TileShape>,
    settings: Settings,
    materials: Arc<MaterialAssignment>,
    facets: Arc<Facets>,
    material_of_slot: Vec<usize>,
    sum: FacetSum,
    plan: Plan,
    shape_version: Version,
    /// Of materials and facets.
    versions: [Version; 2],
}

/// Who is to find out what facets see.
#[derive(Debug, Clone, Copy, PartialEq)]
enum For {
    /// What that will cost is told, too.
    Processor,
    Device,
    /// Of no more facets than these, as their normals are few.
    DeviceOfFew(usize),
}

/// The last effective BRDF, and what a colour edit makes the next one from.
#[derive(Debug)]
struct Last {
    key: OutcomeKey,
    materials: Arc<MaterialAssignment>,
    factors: Option<Made>,
    outcome: Outcome,
}

/// All stages from scene to effective BRDF.
#[derive(Debug, Default)]
pub struct Pipeline {
    cache: MeasuredCache,
    kept: Cache,
    cancel: Cancel,
    gpu: Option<Arc<Gpu>>,
    gpu_asked: bool,
    /// Nobody may open a device here.
    without_device: bool,
    /// Work of one slice of the mesh, for a version of the facets.
    scan_work: Option<(Version, f64)>,
    shape: Stage<ShapeKey, TileShape>,
    facets: Stage<FacetKey, Facets>,
    /// Those that devices see for where normals are few.
    few_facets: Stage<FacetKey, Facets>,
    visibility: Stage<VisibilityKey, Visibility>,
    /// Visibility on the nodes that the factored form reads.
    rows: Stage<([Version; 2], PolarGrid), VisibilityRows>,
    materials: Stage<MaterialKey, MaterialAssignment>,
    /// Rays between facets: facets, elements, rays of each.
    transport: Stage<(Version, usize, usize), Transport>,
    interreflection: Stage<OutcomeKey, InterreflectionTable>,
    /// Planes that mirror the mesh.
    mirrors: Stage<Version, [bool; 2]>,
    /// The mesh as devices cut it.
    cells: Stage<Version, PeriodicGrid>,
    /// M of each material, factored as the paper does, for a version of the materials, a seed and a number of colours.
    paper_factors: Stage<(Version, u64, usize), PaperFactors>,
    last: Option<Last>,
}

impl Pipeline {
    pub fn new() -> Self {
        Self::default()
    }

    /// What is asked of this pipeline from now on ends with [`crate::base::Error::Cancelled`] soon after `cancel` is set. Stages
    /// that were finished before stay.
    pub fn cancel_with(&mut self, cancel: Cancel) {
        self.cancel = cancel;
    }

    /// Whether a device may be opened. Without one all is computed as where there is no adapter that is worth it.
    pub fn allow_device(&mut self, allowed: bool) {
        self.without_device = !allowed;
    }

    /// A device that is open already, to be used in place of one of its own.
    pub fn use_device(&mut self, gpu: Arc<Gpu>) {
        (self.gpu, self.gpu_asked) = (Some(gpu), true);
    }

    /// What takes long to make is looked for in `cache` from now on, and kept there. Without this nothing is.
    pub fn set_cache(&mut self, cache: Cache) {
        self.kept = cache;
    }

    /// All that comes before visibility.
    fn prepare(&mut self, loaded: &LoadedScene, of: For, times: &mut StageTimes) -> Result<Prepared> {
        let scene = &loaded.scene;
        let (shape, shape_version) = self.shape(loaded, times)?;
        let mut settings = Settings::of(scene).for_shape(shape.height_field);
        if let For::DeviceOfFew(most) = of {
            settings.facets = settings.facets.min(most);
        }
        let (materials, materials_version) = self.materials(loaded, &shape.mesh, times)?;
        let colors = settings.effects.color_weights;
        let counts = [Some(settings.facets), settings.normal_bins];
        let facet_key = (shape_version, counts, settings.seed, settings.preset == Preset::Wu2011, colors);
        let stage = if matches!(of, For::DeviceOfFew(_)) { &mut self.few_facets } else { &mut self.facets };
        let (facets, facets_version) =
            stage.get("facets", facet_key, times, &self.cancel, || Ok(sample(&shape.mesh, &settings)))?;
        let material_of_slot = grouped(&materials.0, &facets, &settings);
        let mut sum = FacetSum::new(&facets, &material_of_slot, &materials.1);
        sum.force(&facets, &settings.effects);
        let costs_of = (of == For::Processor).then_some(facets_version);
        let found = self.findings(scene, &shape, &facets, &sum, &material_of_slot, &materials.1, &settings, costs_of);
        let mirrors = self.mirror_planes(&shape, shape_version, &settings, times)?;
        let plan = decide(&SceneFeatures { mirrors, ..found }, &settings, &Costs::default());
        let versions = [materials_version, facets_version];
        Ok(Prepared { shape, settings, materials, facets, material_of_slot, sum, plan, shape_version, versions })
    }

    /// What the facets see, by the plan's route.
    fn seen(&mut self, of: &Prepared, times: &mut StageTimes) -> Result<(Arc<Visibility>, Version)> {
        let Prepared { shape, settings, facets, plan, versions: [_, facets_version], .. } = of;
        if plan.route == VisibilityAlgorithm::None {
            // Nothing is computed, and nothing kept.
            return Ok((Arc::new(Visibility::Unblocked { facets: facets.len() }), 0));
        }
        let key = (
            *facets_version,
            plan.route,
            [settings.horizon_azimuths, settings.slice_azimuths],
            settings.map_grid,
            settings.map_resolution,
            settings.penumbra.to_bits(),
        );
        let (gpu, cancel, cache) = (self.gpu.as_deref(), &self.cancel, &self.kept);
        let mut was_kept = false;
        let seen = self.visibility.get("visibility", key, times, cancel, || {
            let (seen, kept) = kept::visibility(cache, plan.route, &shape.mesh, facets, settings, gpu, cancel)?;
            was_kept = kept;
            Ok(seen)
        })?;
        if let (true, Some((name, _))) = (was_kept, times.last_mut()) {
            *name = kept::VISIBILITY;
        }
        Ok(seen)
    }

    /// The effective BRDF of a scene at its own quality.
    ///
    /// # Errors
    /// A file the scene names cannot be used, or a factorization fails.
    pub fn effective(&mut self, loaded: &LoadedScene) -> Result<Outcome> {
        let mut times = StageTimes::new();
        let prepared = self.prepare(loaded, For::Processor, &mut times)?;
        if prepared.settings.preset == Preset::Wu2011 {
            let names = names(&loaded.scene, &prepared.shape.mesh, &prepared.materials)?;
            return self.wu2011(prepared, names, times);
        }
        let (visibility, visibility_version) = self.seen(&prepared, &mut times)?;
        let Prepared { shape, settings, materials, facets, material_of_slot, sum, mut plan, versions, .. } = prepared;
        let ([materials_version, facets_version], scene) = (versions, &loaded.scene);
        let sum_materials = &materials.1;
        let material_of_slot = &material_of_slot;

        let key = (settings.clone(), [materials_version, facets_version, visibility_version]);
        let (mut factors, mut earlier) = (None, None);
        if let Some(last) = &self.last {
            if last.key == key {
                return Ok(Outcome { times, ..last.outcome.clone() });
            }
            if last.key.0 == key.0 && last.key.1[1..] == key.1[1..] {
                let same_lobes = same_lobes(&last.materials, &materials);
                earlier = last.outcome.images.latest(same_lobes);
                // Colours alone: the factors stay, and are judged anew.
                let kept = last.factors.as_ref().filter(|_| plan.try_low_rank && same_lobes);
                factors = kept.map(|factors| factors.recolored(sum_materials));
            }
        }
        self.cancel.check()?;
        let start = Instant::now();
        let evidence = HealthInputs {
            facets: facets.clone(),
            sight: VisibilityInput::Soft(visibility.clone()),
            materials: materials.clone(),
            names: names(scene, &shape.mesh, &materials)?,
            closes_plane: shape.mesh.closes_plane,
        };
        let direct = Direct::new(Arc::new(sum), visibility.clone());
        let base_area = f64::from(shape.mesh.base_area());
        let Factored { brdf, factors, errors: factored } = if plan.try_low_rank {
            let of = Source {
                facets: &facets,
                material_of_slot,
                materials: sum_materials,
                whole_sphere: !shape.height_field,
                base_area,
                versions: [facets_version, visibility_version],
            };
            self.factored(direct, &of, factors, &settings)?
        } else {
            Factored {
                brdf: EffectiveBrdf { form: Representation::Direct(direct), base_area },
                factors: None,
                errors: None,
            }
        };
        times.push(("product", start.elapsed().as_secs_f64() * 1e3));
        let is_factored = matches!(brdf.form, Representation::LowRank(_));
        let between = if plan.interreflection {
            let found = (facets_version, key.clone());
            let of = (&*facets, &*visibility, &materials.1[..], &material_of_slot[..]);
            Some(self.between_facets(&shape, of, &settings, plan.mirrors, found, &mut times)?)
        } else {
            None
        };
        for (name, ms) in &times {
            match *name {
                "product" if plan.try_low_rank => plan.measured("low_rank", *ms),
                name => plan.measured(name, *ms),
            }
        }
        let brdf = Arc::new(match between {
            Some(table) => brdf.interreflecting(table),
            None => brdf,
        });
        let mut notes = shape.mesh.notes.clone();
        if facets.skipped_triangles > 0 {
            notes.push(format!("{} triangles have no area and were left out", facets.skipped_triangles));
        }
        if let Some(errors) = factored {
            plan.factored(is_factored, errors.rel_l2);
        }
        let examined = Arc::default();
        let images =
            Arc::new(Images::new(brdf.clone(), &shape, &settings, plan.try_shading_table, earlier, &self.kept));
        let outcome = Outcome { brdf, plan, settings, times, factored, notes, evidence, examined, images };
        self.last = Some(Last { key, materials, factors, outcome: outcome.clone() });
        Ok(outcome)
    }

    /// The paper's own way (Sec. 3.2 to 3.7): its directions, its facets, its truncations. M is kept between edits.
    fn wu2011(&mut self, of: Prepared, names: Vec<String>, mut times: StageTimes) -> Result<Outcome> {
        let Prepared { shape, settings, materials: assigned, facets, material_of_slot, plan, .. } = of;
        let (materials_version, shape, facets) = (of.versions[0], &shape, &facets);
        let assigned = Arc::new((material_of_slot, assigned.1.clone()));
        let (material_of_slot, materials) = (&assigned.0, &assigned.1);
        let knobs =
            Wu2011Settings { seed: settings.seed, colors: settings.colors.unwrap_or(1), ..Wu2011Settings::default() };
        let timed =
            |times: &mut StageTimes, name, start: Instant| times.push((name, start.elapsed().as_secs_f64() * 1e3));
        let start = Instant::now();
        let directions = ParaboloidMap::nearest_to(Wu2011Settings::VISIBILITY_DIRECTIONS);
        let visibility = visibility_maps_cpu(&shape.mesh, facets, directions.directions(), settings.map_resolution);
        timed(&mut times, "visibility", start);
        let (factors, _) = self.paper_factors.get(
            "basis",
            (materials_version, knobs.seed, knobs.colors),
            &mut times,
            &self.cancel,
            || {
                let mut made: PaperFactors = Vec::with_capacity(materials.len());
                for (k, material) in materials.iter().enumerate() {
                    // Two colours of one BRDF share its factors.
                    let known = (0..k).find(|&earlier| materials[earlier].same_brdf(material));
                    made.push(match known {
                        Some(earlier) => made[earlier].clone(),
                        None => Some(Arc::new(MaterialFactors::new(material, &knobs)?)),
                    });
                }
                Ok(made)
            },
        )?;
        let start = Instant::now();
        let base_area = f64::from(shape.mesh.base_area());
        let tile = VisibleFacets { facets, visibility: &visibility, directions: &directions, base_area };
        let tables = Wu2011::from_factors(&tile, material_of_slot, materials, &factors, &knobs)?;
        timed(&mut times, "product", start);
        let brdf = Arc::new(EffectiveBrdf { form: Representation::Wu2011(tables), base_area });
        let evidence = HealthInputs {
            facets: facets.clone(),
            sight: VisibilityInput::Packed(Arc::new(visibility)),
            materials: assigned.clone(),
            names,
            closes_plane: shape.mesh.closes_plane,
        };
        let notes = shape.mesh.notes.clone();
        let images = Arc::new(Images::new(brdf.clone(), shape, &settings, false, None, &self.kept));
        let examined = Arc::default();
        Ok(Outcome { brdf, plan, settings, times, factored: None, notes, evidence, examined, images })
    }

    /// How often each stage ran: a stage that the plan drops stays at 0.
    pub fn runs(&self) -> Vec<(&'static str, u64)> {
        vec![
            ("geometry", self.shape.runs()),
            ("facets", self.facets.runs()),
            ("materials", self.materials.runs()),
            ("visibility", self.visibility.runs()),
            ("mirrors", self.mirrors.runs()),
            ("cells", self.cells.runs()),
            ("transport", self.transport.runs()),
            ("interreflection", self.interreflection.runs()),
            ("basis", self.paper_factors.runs()),
        ]
    }

    /// The tile's mesh.
    ///
    /// # Errors
    /// A file the geometry names cannot be used.
    pub fn mesh(&mut self, loaded: &LoadedScene) -> Result<TileMesh> {
        Ok(self.shape(loaded, &mut StageTimes::new())?.0.mesh.clone())
    }

    /// The materials of a scene, as sums see them, and the one of each slot of the mesh.
    ///
    /// # Errors
    /// A slot without a material, or a BRDF file that cannot be used.
    pub fn sum_materials(&mut self, loaded: &LoadedScene) -> Result<MaterialAssignment> {
        let mut times = StageTimes::new();
        let shape = self.shape(loaded, &mut times)?.0;
        Ok(self.materials(loaded, &shape.mesh, &mut times)?.0.as_ref().clone())
    }

    /// The health of what the reference sum is made from: mesh and materials.
    ///
    /// # Errors
    /// As [`Pipeline::sum_materials`].
    pub fn input_health(&mut self, loaded: &LoadedScene) -> Result<Health> {
        let mut times = StageTimes::new();
        let shape = self.shape(loaded, &mut times)?.0;
        let materials = self.materials(loaded, &shape.mesh, &mut times)?.0;
        let names = names(&loaded.scene, &shape.mesh, &materials)?;
        let settings = Settings::from_quality(&loaded.scene.quality);
        Ok(Health::of_input(&shape.mesh, &materials.1, &names, limits(&settings)))
    }

    /// Hands a reference evaluator of the scene to `work`.
    ///
    /// # Errors
    /// As [`Pipeline::effective`].
    pub fn with_reference<T>(&mut self, loaded: &LoadedScene, work: impl FnOnce(&Reference<'_>) -> T) -> Result<T> {
        let mut times = StageTimes::new();
        let shape = self.shape(loaded, &mut times)?.0;
        let materials = self.materials(loaded, &shape.mesh, &mut times)?.0;
        let effects = &loaded.scene.effects;
        let bounces = if effects.interreflection == Switch::On { effects.bounces } else { 0 };
        Ok(work(&Reference::new(&shape.mesh, &materials.0, &materials.1).with_bounces(bounces)))
    }
}
