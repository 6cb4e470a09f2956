//! Properties of a scene and prices of the machine, on which the decisions rest.

use std::sync::LazyLock;

use crate::interreflection::BouncedShare;
use crate::scene::Scene;

/// The properties of a scene on which the decisions rest.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneFeatures {
    pub flat: bool,
    /// The largest angle between a surface normal and z [rad].
    pub steepest: f32,
    /// The largest part of uniform light that a material reflects.
    pub albedo: f64,
    /// The part of the light that is reflected more than once; `None` if it was not measured.
    pub bounced: Option<BouncedShare>,
    /// True if all materials reflect all channels alike.
    pub grey: bool,
    /// Planes x = const and y = const that mirror the tile; `None` if they were not looked for.
    pub mirrors: Option<[bool; 2]>,
    pub height_samples: bool,
    pub height_field: bool,
    /// Nothing overhangs, and the surface does not change along one direction of the plane.
    pub extruded: bool,
    pub closes_plane: bool,
    /// True if a GPU draws shadow maps.
    pub maps_on_gpu: bool,
    pub triangles: usize,
    /// Cells and triangles that one slice of the mesh visits.
    pub scan_work: f64,
    /// Surface area over base area.
    pub area_ratio: f64,
    /// Materials that facets carry, without black ones.
    pub materials: usize,
    pub black_materials: usize,
    /// True if colour weights differ within a material.
    pub colors_vary: bool,
    /// Lobes that a direct sum adds up, and measured look-ups.
    pub lobes: usize,
    pub lookups: usize,
    /// The smallest roughness of analytic lobes; infinite without.
    pub narrowest_lobe: f32,
    pub distinct_normals: Option<usize>,
    pub large_scale: LargeScaleFeatures,
    /// Colour maps; `None` for a scene without.
    pub color_map: Option<ColorMapFeatures>,
}

/// Properties of the object and its lights, on which the effective BRDF does not depend.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LargeScaleFeatures {
    pub object_self_shadows: bool,
    pub lights: usize,
    pub lights_below: usize,
}

impl LargeScaleFeatures {
    /// The properties of a scene.
    pub fn of(scene: &Scene) -> Self {
        Self {
            object_self_shadows: !matches!(scene.object.kind.as_str(), "sphere" | "cylinder"),
            lights: scene.light.count + scene.light.directional.len(),
            lights_below: scene.light.directional.iter().filter(|light| light.direction.y < 0.0).count(),
        }
    }
}

/// Properties of a scene's colour maps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColorMapFeatures {
    pub layers: usize,
    /// Samples of all textures and noises, whose moments are computed.
    pub samples: usize,
    /// Every driver varies by less than a step of the prefiltered table.
    pub naive_is_enough: bool,
}

/// Prices on the machine [ns].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Costs {
    pub lobe_ns: f64,
    pub lookup_ns: f64,
    /// Visibility of a facet along both directions of a pair: from a horizon map or maps, and from occlusion intervals.
    pub facet_fill_ns: f64,
    pub slice_fill_ns: f64,
    pub march_ns: f64,
    pub scan_ns: f64,
    pub factor_query_ns: f64,
    pub table_query_ns: f64,
    pub slice_ns: f64,
    pub triangle_ns: f64,
    pub texel_ns: f64,
    pub threads: f64,
}

/// The threads of the machine. Asking for them reads files on Linux, which takes longer than the rest of a plan.
static THREADS: LazyLock<f64> =
    LazyLock::new(|| std::thread::available_parallelism().map_or(1.0, |threads| threads.get() as f64));

impl Default for Costs {
    fn default() -> Self {
        Self {
            lobe_ns: 1.5,
            lookup_ns: 15.0,
            facet_fill_ns: 0.3,
            slice_fill_ns: 3.1,
            march_ns: 390.0,
            scan_ns: 180.0,
            factor_query_ns: 1_500.0,
            table_query_ns: 100.0,
            slice_ns: 42.0,
            triangle_ns: 60.0,
            texel_ns: 1.2,
            threads: *THREADS,
        }
    }
}
