//! The filtered colour map of a scene: the mean colours of what pixels see, beside `f̄` from the core.

use std::sync::{Arc, OnceLock};

use glam::{DVec2, DVec3, Vec3};

use super::inputs::Processor;
use super::{Outcome, Pipeline, StageTimes};
use crate::base::{Cancel, InputError, Result};
use crate::brdf::{LUMINANCE, Material, Term};
use crate::color_map::filter::{HeightsSeen, SlopesSeen, SurfaceSeen, VisibleValues, naive_color};
use crate::color_map::heights::{Largest, lit_part, pair_exponent, paper_moments};
use crate::color_map::layers::{DrivenMap, Layer, LayeredMap, ProductTerm, ResolvedDriver, Source, SurfacePoint};
use crate::color_map::slopes::{Focus, SlopeDriver, Slopes, direction};
use crate::color_map::statistics::{Footprint, PlaceMap};
use crate::color_map::{Normal, PrefilteredTable, Stop, StopMap};
use crate::diagnostics;
use crate::geometry::relief::surface_point;
use crate::geometry::{ColorField, Facets};
use crate::math::directions::half_vector;
use crate::plan::Refinement;
use crate::scene::{ColorMap, Combine, HeightDistribution, LoadedScene, StopEvaluation, StopUnit};
use crate::visibility::Visibility;

/// The colour map of a scene with everything that its means depend on.
#[derive(Debug)]
pub struct ColorFilter {
    /// `f̄` with the colours of the map on the facets, without interreflection.
    pub outcome: Outcome,
    pub map: Arc<LayeredMap>,
    spec: ColorMap,
    facets: Arc<Facets>,
    visibility: Arc<Visibility>,
    /// Place, height and slope of each facet, by which the map colours it.
    points: Vec<SurfacePoint>,
    materials: Vec<Material>,
    material_of_slot: Vec<usize>,
    /// Part of the surface with each material.
    shares: Vec<f64>,
    tables: Vec<OnceLock<PrefilteredTable>>,
    places: Vec<OnceLock<Option<PlaceMap>>>,
}

/// Statistics of the surface that is visible and lit at one pair of directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairColor {
    pub lambda_i: f64,
    pub lambda_o: f64,
    /// Lit part of what is seen, of facets that face the light.
    pub lit: f64,
    /// Mean colour of what is seen and lit, weighted with the BRDF.
    pub color: DVec3,
}

impl Pipeline {
    /// The filtered colour map of a scene and its effective BRDF, both without interreflection.
    ///
    /// # Errors
    /// The errors of [`Pipeline::effective`]; the scene has no colour map; or it asks for Smith's distribution of a tile
    /// that overhangs.
    pub fn color_filter(&self, loaded: &LoadedScene) -> Result<ColorFilter> {
        let Some(spec) = &loaded.scene.color_map else {
            return Err(InputError::new("color_map", "nothing", "a table `[color_map]` with layers").into());
        };
        let loaded = &loaded.without_interreflection();
        let outcome = self.effective(loaded)?;
        let mut times = StageTimes::new();
        let inputs = self.tile_inputs(loaded, Processor::Cpu(Refinement::NONE), &mut times)?;
        let visibility = self.visibility(&inputs, &mut times)?;
        let tile = &inputs.tile;
        let ColorField::Mapped { map, .. } = &tile.mesh.color else {
            return Err(InputError::new("color_map", "nothing", "a table `[color_map]` with layers").into());
        };
        let overhangs = !tile.height_field && spec.surface.is_none();
        if overhangs && map.is_of_surface() && spec.distribution != HeightDistribution::Measured {
            let found = format!("`{}` on a tile with overhangs", spec.distribution.name());
            let expected = "`measured`, or an analytic surface in `[color_map.surface]`";
            return Err(InputError::new("color_map.distribution", found, expected).into());
        }
        let facets = &inputs.facets.value;
        let points = facets.positions.iter().zip(facets.coloring_normals(&tile.mesh));
        let points = points.map(|(position, normal)| surface_point(tile.mesh.size, *position, *normal)).collect();
        let materials = inputs.materials.materials.clone();
        let mut shares = vec![0.0; materials.len()];
        for (slot, area) in inputs.facets.slots.iter().zip(&inputs.facets.areas) {
            shares[inputs.material_of_slot[usize::from(*slot)]] += f64::from(*area);
        }
        Ok(ColorFilter {
            outcome,
            map: map.clone(),
            spec: spec.clone(),
            facets: inputs.facets.value.clone(),
            visibility: visibility.value.clone(),
            points,
            materials,
            material_of_slot: inputs.material_of_slot,
            shares,
            tables: map.layers.iter().map(|_| OnceLock::new()).collect(),
            places: map.layers.iter().map(|_| OnceLock::new()).collect(),
        })
    }
}

impl ColorFilter {
    /// The prefiltered table of a layer, over its stops' unit.
    pub fn table(&self, layer: usize) -> &PrefilteredTable {
        self.tables[layer].get_or_init(|| PrefilteredTable::new(&self.map.layers[layer].mapped.stops))
    }

    /// The mean of a layer under a Gaussian distribution in the unit of its stops.
    pub fn normal(&self, layer: usize, at: &Normal) -> DVec3 {
        match self.spec.table {
            StopEvaluation::Closed => self.map.layers[layer].mapped.stops.mean(at),
            StopEvaluation::Table => self.table(layer).mean(at),
        }
    }

    /// Moments of D_h at an exponent [height deviations], and the mean of a layer under it.
    pub fn heights(&self, layer: usize, exponent: f64) -> (Normal, DVec3) {
        let mapped = &self.map.layers[layer].mapped;
        let noise = match mapped.driver.source {
            Source::Height { noise } => noise,
            _ => 0.0,
        };
        if self.spec.distribution == HeightDistribution::Paper {
            let at = paper_moments(exponent);
            let noisy = Normal { deviation: at.deviation.hypot(noise), ..at };
            return (at, mapped.map.mean(&noisy));
        }
        let largest = Largest { exponent };
        let map = if noise > 0.0 { mapped.map.blurred(noise) } else { mapped.map.clone() };
        (largest.moments(), map.mean(&largest))
    }

    /// Slopes that a viewer sees, and the mean of a layer of slopes by what is seen.
    pub fn slopes(&self, layer: usize, o: DVec3) -> (Slopes, DVec3) {
        let relief = &self.map.relief;
        let mapped = &self.map.layers[layer].mapped;
        let weight = |s: DVec2| DVec3::splat((o.z - s.dot(o.truncate())).max(0.0));
        let facets: Vec<(SurfacePoint, DVec3)>;
        let heights = HeightsSeen::Normal(STANDARD);
        let surface = if self.is_measured() {
            facets = self.points.iter().copied().zip(self.projected(o.as_vec3()).map(DVec3::splat)).collect();
            SurfaceSeen::Facets(&facets)
        } else if self.spec.distribution == HeightDistribution::Paper {
            SurfaceSeen::Gaussian { heights, slopes: SlopesSeen::Apart(o) }
        } else {
            SurfaceSeen::Gaussian { heights, slopes: SlopesSeen::Joint { weight: &weight, focus: None } }
        };
        let seen = VisibleValues { surface, gaussianize: self.spec.gaussianize };
        let color = match &mapped.driver.source {
            Source::Slope(driver) => seen.of_term(&ProductTerm::of_slope(*driver, mapped.map.clone()), relief),
            _ => mapped.map.color(0.0),
        };
        (relief.slopes.visible(o), color)
    }

    /// Statistics of the surface that is visible and lit at a pair of directions.
    pub fn pair(&self, i: DVec3, o: DVec3) -> PairColor {
        let slopes = &self.map.relief.slopes;
        let (lambda_i, lambda_o) = (slopes.lambda(i), slopes.lambda(o));
        let (lit, color) = self.with_seen(i, o, |seen, lit| (lit, seen.color(&self.map)));
        PairColor { lambda_i, lambda_o, lit, color }
    }

    /// The part of a driver's values that is at least each of `values` [deviations], by what is visible, lit and reflected
    /// at a pair of directions. Stops early with fewer parts if `cancel` is set.
    pub fn tails(&self, driver: &ResolvedDriver, i: DVec3, o: DVec3, values: &[f64], cancel: &Cancel) -> Vec<f64> {
        self.with_seen(i, o, |seen, _| {
            let tail = |value: &f64| {
                // The mean of a jump from 0 to 1.
                let stop = |color| Stop { value: *value, color };
                let jump = StopMap::new(vec![stop(DVec3::ZERO), stop(DVec3::ONE)]);
                let (map, stops) = (jump.clone(), jump);
                let mapped = DrivenMap { driver: driver.clone(), map, stops, stop_unit: StopUnit::Deviation };
                let layer = Layer { name: String::new(), mapped, factor: 1.0, blend: None };
                let LayeredMap { relief, taps, gaussianize, is_analytic, .. } = *self.map;
                let (combine, layers) = (Combine::Sum, vec![layer]);
                let map = LayeredMap { combine, layers, relief, taps, gaussianize, is_analytic };
                seen.color(&map).dot(LUMINANCE.as_dvec3())
            };
            values.iter().take_while(|_| !cancel.is_set()).map(tail).collect()
        })
    }

    /// Reads what is visible, lit and reflected at a pair of directions, and the lit part of what is visible.
    fn with_seen<R>(&self, i: DVec3, o: DVec3, read: impl FnOnce(&VisibleValues<'_>, f64) -> R) -> R {
        let slopes = &self.map.relief.slopes;
        let (lambda_i, lambda_o) = (slopes.lambda(i), slopes.lambda(o));
        let exponent = match self.spec.distribution {
            HeightDistribution::Paper => lambda_i + lambda_o,
            _ => pair_exponent(lambda_o, lambda_i, i.y.atan2(i.x) - o.y.atan2(o.x)),
        };
        let gaussianize = self.spec.gaussianize;
        if self.is_measured() {
            let weights = self.weights(i.as_vec3(), o.as_vec3());
            let facets: Vec<_> = self.points.iter().copied().zip(weights.reflected).collect();
            return read(&VisibleValues { surface: SurfaceSeen::Facets(&facets), gaussianize }, weights.lit);
        }
        let weight = |s: DVec2| self.reflected(s, i, o);
        let (heights, slopes) = if self.spec.distribution == HeightDistribution::Paper {
            (HeightsSeen::Normal(paper_moments(exponent)), SlopesSeen::Apart(o))
        } else {
            (HeightsSeen::Smith(Largest { exponent }), SlopesSeen::Joint { weight: &weight, focus: self.focus(i, o) })
        };
        let surface = SurfaceSeen::Gaussian { heights, slopes };
        read(&VisibleValues { surface, gaussianize }, lit_part(lambda_o, exponent))
    }

    /// The colour of the mean of every driver.
    pub fn naive(&self) -> DVec3 {
        naive_color(&self.map)
    }

    /// The map of a layer of textures or noise, ready to be filtered; `None` for other drivers.
    pub fn place_map(&self, layer: usize) -> Option<&PlaceMap> {
        let mapped = &self.map.layers[layer].mapped;
        let place_map = || match &mapped.driver.source {
            Source::Place(place) => Some(PlaceMap::new(place.clone(), &mapped.map, self.spec.gaussianize)),
            _ => None,
        };
        self.places[layer].get_or_init(place_map).as_ref()
    }

    /// Number of reads of a footprint.
    pub fn taps(&self) -> u32 {
        self.spec.taps
    }

    /// Moments of a layer of textures or noise over a footprint in the unit of its stops, and its mean colour.
    pub fn footprint(&self, layer: usize, footprint: &Footprint) -> Option<(Normal, DVec3)> {
        let mapped = &self.map.layers[layer].mapped;
        let map = self.place_map(layer)?;
        let moments = mapped.in_stop_unit(map.moments(footprint, self.spec.taps));
        Some((moments, map.mean(footprint, self.spec.taps)))
    }

    /// Warnings about the filter, each with a remedy.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = diagnostics::color_map::warnings(&self.map);
        if self.spec.distribution == HeightDistribution::Smith
            && self.spec.surface.is_none()
            && self.map.is_of_surface()
        {
            let [i, o] = SMITH_CHECK.map(|[theta, phi]| direction(theta, phi));
            let slopes = &self.map.relief.slopes;
            let apart = SMITH_CHECK[0][1] - SMITH_CHECK[1][1];
            let exponent = pair_exponent(slopes.lambda(o), slopes.lambda(i), apart);
            let difference = (self.mean_height(i.as_vec3(), o.as_vec3()) - Largest { exponent }.moments().mean).abs();
            if difference > MAX_SMITH_ERROR {
                warnings.push(format!(
                    "smith is far from this tile: visible heights differ by {difference:.2} deviations; set distribution = \"measured\""
                ));
            }
        }
        warnings
    }

    /// Heights and slopes come from the facets. An analytic surface has none, so that Smith's distribution takes their
    /// place.
    fn is_measured(&self) -> bool {
        self.spec.distribution == HeightDistribution::Measured && self.spec.surface.is_none()
    }

    /// The visible projected area of each facet.
    fn projected(&self, o: Vec3) -> impl Iterator<Item = f64> {
        let mut visible = vec![0.0; self.facets.len()];
        self.visibility.fill(o, 0..self.facets.len(), &mut visible);
        let areas = self.facets.normals.iter().zip(&self.facets.areas);
        areas.zip(visible).map(move |((n, area), visible)| f64::from(visible * n.dot(o).max(0.0) * area))
    }

    /// The mean height of facets that are visible, lit and reflect [deviations].
    fn mean_height(&self, i: Vec3, o: Vec3) -> f64 {
        let height = Source::Height { noise: 0.0 };
        let (mut sum, mut total) = (0.0, 0.0);
        for (point, weight) in self.points.iter().zip(self.weights(i, o).reflected) {
            let weight = weight.dot(LUMINANCE.as_dvec3());
            sum += weight * height.value(point, &self.map.relief);
            total += weight;
        }
        if total > 0.0 { sum / total } else { 0.0 }
    }

    fn weights(&self, i: Vec3, o: Vec3) -> FacetWeights {
        let facets = &self.facets;
        let (mut v_i, mut v_o) = (vec![0.0; facets.len()], vec![0.0; facets.len()]);
        self.visibility.fill(i, 0..facets.len(), &mut v_i);
        self.visibility.fill(o, 0..facets.len(), &mut v_o);
        let (mut seen, mut lit) = (0.0, 0.0);
        let mut reflected = Vec::with_capacity(facets.len());
        for s in 0..facets.len() {
            let (n, area) = (facets.normals[s], facets.areas[s]);
            let material = &self.materials[self.material_of_slot[usize::from(facets.slots[s])]];
            if n.dot(i) > 0.0 {
                let projected = f64::from(area * n.dot(o).max(0.0) * v_o[s]);
                seen += projected;
                // The lower of two transitions hides all that the higher one hides, so that along the light no visible
                // point is dark.
                lit += f64::from(area * n.dot(o).max(0.0) * v_o[s].min(v_i[s]));
            }
            let f = material.brdf.f(n, i, o) * material.color;
            reflected.push((f * (area * v_i[s] * v_o[s])).as_dvec3());
        }
        FacetWeights { reflected, lit: if seen > 0.0 { lit / seen } else { 0.0 } }
    }

    /// Reflection of a facet of this slope per base area: `√(1+s²) f(n, i, o)`, the mean over all materials.
    fn reflected(&self, s: DVec2, i: DVec3, o: DVec3) -> DVec3 {
        let length = (1.0 + s.length_squared()).sqrt();
        let n = (DVec3::new(-s.x, -s.y, 1.0) / length).as_vec3();
        let (i, o) = (i.as_vec3(), o.as_vec3());
        let of = |(material, share): (&Material, &f64)| (material.brdf.f(n, i, o) * material.color).as_dvec3() * *share;
        self.materials.iter().zip(&self.shares).map(of).sum::<DVec3>() * length
    }

    /// Slopes around which the narrowest lobe makes the density of slopes narrow.
    fn focus(&self, i: DVec3, o: DVec3) -> Option<Focus> {
        let terms = self.materials.iter().flat_map(|material| &material.brdf.terms);
        let width = f64::from(terms.filter_map(Term::roughness).reduce(f32::min)?);
        let h = half_vector(i.as_vec3(), o.as_vec3()).as_dvec3();
        if h.z <= 1e-3 {
            return None;
        }
        let slope = -h.truncate() / h.z;
        Some(Focus { slope, width: width * (1.0 + slope.length_squared()).sqrt() })
    }

    /// The first layer whose driver fits, or the named one.
    ///
    /// # Errors
    /// No layer has this name, none fits, or several do and none is named.
    pub fn layer(&self, name: Option<&str>, wanted: &str, fits: impl Fn(&Source) -> bool) -> Result<usize> {
        let layers = &self.map.layers;
        let names = || layers.iter().map(|layer| layer.name.as_str()).collect::<Vec<_>>().join(", ");
        if let Some(name) = name {
            let found = layers.iter().position(|layer| layer.name == name);
            let index = found.ok_or_else(|| {
                InputError::new("--layer", format!("`{name}`"), format!("the name of a layer: {}", names()))
            })?;
            if !fits(&layers[index].mapped.driver.source) {
                let found = format!("`{name}`, a layer of `{}`", layers[index].mapped.driver.spec.kind());
                return Err(InputError::new("--layer", found, format!("a layer of {wanted}")).into());
            }
            return Ok(index);
        }
        let fitting: Vec<usize> = (0..layers.len()).filter(|k| fits(&layers[*k].mapped.driver.source)).collect();
        match fitting[..] {
            [only] => Ok(only),
            [] => Err(InputError::new("color_map.layer", "none", format!("a layer of {wanted}")).into()),
            _ => {
                let found = format!("{} layers of {wanted}", fitting.len());
                Err(InputError::new("--layer", found, format!("the name of one of them: {}", names())).into())
            }
        }
    }
}

/// Largest difference of the mean visible height from that of Smith's surface [deviations]: about 0.02 in colour.
const MAX_SMITH_ERROR: f64 = 0.15;
/// Polar angle and azimuth of light and view at which Smith's heights are compared [rad].
const SMITH_CHECK: [[f64; 2]; 2] = [[0.9, 1.6], [1.3, 0.0]];

/// Weights of facets at a pair of directions.
struct FacetWeights {
    /// Reflection of each facet from the light to the viewer.
    reflected: Vec<DVec3>,
    /// Lit part of what is seen.
    lit: f64,
}

const STANDARD: Normal = Normal { mean: 0.0, deviation: 1.0 };

/// Returns true for drivers that footprints filter.
pub fn is_place(source: &Source) -> bool {
    matches!(source, Source::Place(_))
}

/// Returns true for drivers of slopes.
pub fn is_slope(source: &Source) -> bool {
    matches!(source, Source::Slope(SlopeDriver::Along { .. } | SlopeDriver::Steepness))
}
