//! Presets and settings: the accuracy of every computation, as typed values.

use super::SceneFeatures;
use crate::effective::{BasisGrid, ErrorBound, Interpolation, LowRankSettings};
use crate::interreflection::InterreflectionSettings;
use crate::math::directions::{HalfDifferenceGrid, HemispherePairGrid, PolarGrid, ReducedGrid};
use crate::scene::{Effects, Quality, Scene};

/// Named settings of the `[quality]` table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preset {
    Draft,
    Standard,
    Fine,
    Reference,
    Wu2011,
}

impl Preset {
    pub fn name(self) -> &'static str {
        match self {
            Self::Draft => "draft",
            Self::Standard => "standard",
            Self::Fine => "fine",
            Self::Reference => "reference",
            Self::Wu2011 => "wu2011",
        }
    }
}

/// The way to compute the product.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProductMethod {
    /// The way that the plan expects to be fastest within the tolerance.
    Auto,
    Direct,
    LowRank,
}

/// The way to compute visibility.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VisibilityMethod {
    /// A horizon map if nothing overhangs, else occlusion intervals.
    Auto,
    /// Occlusion intervals, from slices through the mesh along azimuths.
    OcclusionIntervals,
    /// Shadow maps along directions.
    Maps,
}

/// The processor to compute on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Backend {
    Auto,
    Gpu,
    Cpu,
}

/// The values of all settings.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    pub preset: Preset,
    /// Facets that sample the surface.
    pub facets: usize,
    /// Azimuths of horizon maps.
    pub horizon_azimuths: usize,
    /// Azimuths of occlusion intervals.
    pub slice_azimuths: usize,
    /// Rings and azimuths of visibility maps, for overhangs. Azimuths change the error more than rings.
    pub map_grid: PolarGrid,
    /// Texels per side of the shadow maps that these maps are made from.
    pub map_resolution: u32,
    /// Width of the transition at a horizon [rad].
    pub penumbra: f32,
    pub visibility_method: VisibilityMethod,
    /// Bins of normals whose facets share one lobe; `None` to keep each normal.
    pub normal_bins: Option<usize>,
    pub method: ProductMethod,
    pub keep_m: f64,
    pub keep_n: f64,
    pub max_rank: usize,
    /// Directions of the visibility factor.
    pub grid: PolarGrid,
    pub pairs: HalfDifferenceGrid,
    pub normal_rings: usize,
    /// Interpolation between the nodes of factors and shading tables.
    pub interpolation: Interpolation,
    pub colors: Option<usize>,
    pub keep_color: f64,
    /// The largest relative L2 of the low-rank representation against the direct sum.
    pub tolerance: f64,
    /// The smallest PSNR [dB] of the low-rank representation against the direct sum: if `f̄` is broad, a small relative
    /// error is still a low PSNR. It is some 5 dB above what the preset promises, because the direct sum has errors
    /// too.
    pub tolerance_db: f64,
    /// Grids of the table that images read, from coarse to fine. The first that is close enough is taken. Without a
    /// grid, images evaluate the BRDF itself.
    pub image_grids: Vec<HemispherePairGrid>,
    /// The largest relative L2 and the smallest PSNR [dB] of the table against its BRDF.
    pub image_tolerance: (f64, f64),
    pub reference_facets: usize,
    pub reference_passes: usize,
    /// Relative L2 of the standard errors at which the reference ends.
    pub reference_target: f64,
    pub backend: Backend,
    pub seed: u64,
    /// The most facets to which a result may be refined, to keep its error within [`Settings::error_bound`]. `None` if
    /// the scene sets the resolution itself or forbids refinement.
    pub max_refined_facets: Option<usize>,
    /// Facets that the method `faces` of a slab sums; `None` for those of the preset.
    pub slab_facets: Option<usize>,
    /// Paths per pixel through a slab; `None` for those of the preset.
    pub paths: Option<usize>,
    /// Effects that the user forces on or off.
    pub effects: Effects,
}

const fn hemisphere_pair_grid(rings: usize, azimuths: usize, phi_d: usize, theta_d: usize) -> HemispherePairGrid {
    HemispherePairGrid { rings, azimuths, phi_d, theta_d }
}

impl Settings {
    /// The settings of a scene.
    pub fn of(scene: &Scene) -> Self {
        Self { effects: scene.effects.clone(), ..Self::from_quality(&scene.quality) }
    }

    /// The settings of a preset, overridden by those that the scene gives.
    pub fn from_quality(quality: &Quality) -> Self {
        let preset = match quality.preset.as_str() {
            "draft" => Preset::Draft,
            "fine" => Preset::Fine,
            "reference" => Preset::Reference,
            "wu2011" => Preset::Wu2011,
            _ => Preset::Standard,
        };
        let mut settings = Self::of_preset(preset);
        settings.seed = quality.seed;
        settings.backend = match quality.backend.as_str() {
            "gpu" => Backend::Gpu,
            "cpu" => Backend::Cpu,
            _ => Backend::Auto,
        };
        let set = |setting: &mut usize, value: Option<usize>| {
            if let Some(value) = value {
                *setting = value;
            }
        };
        set(&mut settings.facets, quality.facets);
        if let Some(azimuths) = quality.azimuths {
            settings.horizon_azimuths = azimuths;
            settings.slice_azimuths = azimuths;
            settings.map_grid = PolarGrid::new(settings.map_grid.rings, azimuths);
        }
        if let Some(rings) = quality.rings {
            settings.map_grid = PolarGrid::new(rings, settings.map_grid.azimuths);
        }
        match quality.method.as_deref() {
            Some("direct") => settings.method = ProductMethod::Direct,
            Some("low_rank") => settings.method = ProductMethod::LowRank,
            Some("auto") => settings.method = ProductMethod::Auto,
            _ => {}
        }
        match quality.visibility.as_deref() {
            Some("slices") => settings.visibility_method = VisibilityMethod::OcclusionIntervals,
            Some("maps") => settings.visibility_method = VisibilityMethod::Maps,
            Some("auto") => settings.visibility_method = VisibilityMethod::Auto,
            _ => {}
        }
        match quality.interpolation.as_deref() {
            Some("linear") => settings.interpolation = Interpolation::Linear,
            Some("cubic") => settings.interpolation = Interpolation::Cubic,
            _ => {}
        }
        if let Some(energy) = quality.keep_m {
            settings.keep_m = f64::from(energy);
        }
        if let Some(energy) = quality.keep_n {
            settings.keep_n = f64::from(energy);
        }
        if let Some([rings, azimuths]) = quality.grid {
            settings.grid = PolarGrid::new(rings, azimuths);
        }
        let sets_resolution = quality.facets.is_some() || quality.azimuths.is_some() || quality.penumbra_deg.is_some();
        settings.max_refined_facets = (quality.adaptive && !sets_resolution).then_some(quality.max_facets);
        if let Some(degrees) = quality.penumbra_deg {
            settings.penumbra = degrees.to_radians();
        }
        if let Some(samples) = quality.reference_samples {
            settings.reference_passes = samples.div_ceil(settings.reference_facets).max(2);
        }
        settings.reference_target = f64::from(quality.reference_target);
        settings.slab_facets = quality.slab_facets;
        settings.paths = quality.paths;
        settings.colors = quality.colors.or(settings.colors);
        settings.normal_bins = quality.normal_bins.or(settings.normal_bins);
        settings
    }

    pub fn of_preset(preset: Preset) -> Self {
        let standard = Self {
            preset,
            facets: 6144,
            horizon_azimuths: 48,
            slice_azimuths: 40,
            map_grid: PolarGrid::new(32, 192),
            map_resolution: 256,
            penumbra: 0.02,
            visibility_method: VisibilityMethod::Auto,
            normal_bins: None,
            method: ProductMethod::Auto,
            keep_m: 0.9995,
            keep_n: 0.9995,
            max_rank: 40,
            grid: PolarGrid::new(16, 36),
            pairs: HalfDifferenceGrid { rings: 32, azimuths: 64, theta_d: 16, phi_d: 8 },
            normal_rings: 64,
            interpolation: Interpolation::Cubic,
            colors: None,
            keep_color: 0.999,
            tolerance: 0.04,
            tolerance_db: 41.0,
            image_grids: vec![
                hemisphere_pair_grid(16, 32, 12, 12),
                hemisphere_pair_grid(20, 40, 16, 16),
                hemisphere_pair_grid(24, 48, 16, 20),
            ],
            image_tolerance: (0.08, 38.0),
            reference_facets: 16_384,
            reference_passes: 32,
            reference_target: 0.002,
            backend: Backend::Auto,
            seed: 1,
            max_refined_facets: Some(131_072),
            slab_facets: None,
            paths: None,
            effects: Effects::default(),
        };
        match preset {
            Preset::Standard => standard,
            Preset::Wu2011 => Self { facets: 12_000, map_resolution: 512, ..standard },
            Preset::Draft => Self {
                facets: 2048,
                horizon_azimuths: 24,
                slice_azimuths: 20,
                map_grid: PolarGrid::new(20, 40),
                map_resolution: 160,
                keep_m: 0.999,
                keep_n: 0.999,
                max_rank: 32,
                grid: PolarGrid::new(12, 24),
                pairs: HalfDifferenceGrid { rings: 24, azimuths: 48, theta_d: 12, phi_d: 6 },
                normal_rings: 48,
                tolerance: 0.12,
                tolerance_db: 28.0,
                image_grids: vec![hemisphere_pair_grid(16, 24, 6, 8)],
                image_tolerance: (0.35, 26.0),
                ..standard
            },
            Preset::Fine | Preset::Reference => Self {
                facets: 32_768,
                horizon_azimuths: 96,
                slice_azimuths: 128,
                map_grid: PolarGrid::new(48, 192),
                map_resolution: 384,
                penumbra: 0.01,
                keep_m: 0.9999,
                keep_n: 0.9999,
                max_rank: 64,
                grid: PolarGrid::new(24, 48),
                pairs: HalfDifferenceGrid { rings: 48, azimuths: 96, theta_d: 20, phi_d: 10 },
                normal_rings: 64,
                tolerance: 0.015,
                tolerance_db: 48.0,
                image_grids: if preset == Preset::Fine {
                    vec![hemisphere_pair_grid(24, 48, 16, 20)]
                } else {
                    Vec::new()
                },
                image_tolerance: (0.03, 46.0),
                ..standard
            },
        }
    }

    /// The error that the preset allows; `None` for the reference and the paper's method.
    pub fn error_bound(&self) -> Option<ErrorBound> {
        let (rel_l2, psnr_db) = match self.preset {
            Preset::Draft => (0.35, None),
            Preset::Standard => (0.1, Some(35.0)),
            Preset::Fine => (0.04, Some(43.0)),
            Preset::Reference | Preset::Wu2011 => return None,
        };
        Some(ErrorBound { rel_l2, psnr_db })
    }

    /// The relative error of an image where the material is interpolated between points: a tenth of what a table may have.
    pub fn point_tolerance(&self) -> f32 {
        if self.preset == Preset::Reference { 0.0 } else { 0.1 * self.image_tolerance.0 as f32 }
    }

    /// The bound to which refinement brings the error; `None` if the settings are not refined.
    pub fn refinement_bound(&self) -> Option<ErrorBound> {
        self.error_bound().filter(|_| self.max_refined_facets.is_some())
    }

    /// The bound to which refinement brings the part of an error that is due to light between facets. At `standard` it is
    /// smaller than that of the whole error, because more rays cost less time than more facets.
    pub fn bounced_bound(&self, whole: ErrorBound) -> ErrorBound {
        const AT_STANDARD: f64 = 0.04;
        if self.preset == Preset::Standard { ErrorBound { rel_l2: AT_STANDARD, ..whole } } else { whole }
    }

    /// The part of the reflected light that may be missing because interreflection is left out.
    pub fn bounced_tolerance(&self) -> f64 {
        match self.preset {
            Preset::Draft => 0.35,
            Preset::Standard | Preset::Wu2011 => 0.04,
            Preset::Fine => 0.015,
            Preset::Reference => 0.0,
        }
    }

    /// The resolution of interreflection. Where it is a small share of the light, fewer rays and a coarser table have a small
    /// error in f̄, unless a lobe is narrower than the steps of the table. There are as many elements for any share, because
    /// walks read the visibility of the nearest one.
    pub fn interreflection(&self, features: &SceneFeatures) -> InterreflectionSettings {
        /// Smallest share that is computed with four times the rays and the finer table: what `draft` may leave out.
        const LARGE_SHARE: f64 = 0.35;
        /// Share of interreflection below which the coarsest table suffices, if all facets are matte.
        const SMALL_SHARE: f64 = 0.2;
        /// Smallest roughness of lobes in the coarser tables.
        const WIDE_LOBE: f32 = 0.2;
        let (elements, rays, rings) = match self.preset {
            Preset::Draft => (2048, 600, [8, 8, 8]),
            Preset::Standard | Preset::Wu2011 => (6144, 1800, [8, 10, 12]),
            Preset::Fine | Preset::Reference => (16_384, 10_000, [12, 12, 16]),
        };
        let share = features.bounced.map_or(1.0, |bounced| bounced.share);
        let is_large = share >= LARGE_SHARE;
        let has_narrow_lobe = features.narrowest_lobe < WIDE_LOBE || features.lookups > 0;
        let [small, middle, large] = rings;
        let rings = if is_large || has_narrow_lobe {
            large
        } else if features.is_matte() && share < SMALL_SHARE {
            small
        } else {
            middle
        };
        // The rays of a matte element share what reaches the viewers, so that twice as many take less than twice the time.
        let rays = if features.is_matte() { 2 * rays } else { rays };
        InterreflectionSettings {
            elements: self.facets.min(elements),
            useful_rays: if is_large { 4 * rays } else { rays },
            bounces: self.effects.bounces,
            grid: ReducedGrid::new(rings),
            mirrors: [false; 2],
        }
    }

    /// The settings of the low-rank representation.
    pub fn low_rank(&self, whole_sphere: bool) -> LowRankSettings {
        LowRankSettings {
            directions: self.grid,
            basis: BasisGrid {
                pairs: self.pairs,
                normal_rings: self.normal_rings,
                whole_sphere,
                interpolation: self.interpolation,
            },
            keep_m: self.keep_m,
            keep_n: self.keep_n,
            max_rank: self.max_rank,
            colors: self.colors,
            keep_color: self.keep_color,
            seed: self.seed,
        }
    }
}
