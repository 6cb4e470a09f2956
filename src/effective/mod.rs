//! The effective BRDF of a tile, computed from facets, visibility and small-scale BRDFs, and its representations.

pub mod direct;
mod effective_brdf;
mod error_estimate;
mod pair_count;
mod gpu_tile;
pub mod low_rank;
mod quick_estimate;
pub mod shading_table;
mod tint;
mod view_paths;
pub mod wu2011;

use glam::Vec3;

use crate::math::simd::cubic_weights;

pub use direct::Direct;
pub(crate) use direct::facet_groups::FacetGroup;
pub use direct::facet_sum::FacetSum;
pub use direct::forced::mean_colors;
pub use effective_brdf::{EffectiveBrdf, Representation};
pub use error_estimate::{ErrorBound, ErrorEstimate, ErrorEstimator};
pub(crate) use error_estimate::{FACETS_POWER, SAFETY_FACTOR, SECOND_SAMPLE_DIVISOR};
pub use gpu_tile::{GpuTileInput, GpuVisibilityInput, HeightMarchInput, ShadowMapInput, SliceInput};
pub use low_rank::bvndf::VisibilityRows;
pub use low_rank::rotated_basis::{BasisGrid, RotatedBasis, RotatedLobe};
pub use low_rank::{ChannelTables, Factors, LowRank, LowRankSettings};
pub(crate) use pair_count::{FEW_PAIRS, PAIRS};
pub(crate) use quick_estimate::{PairValues, estimate_of_bounced, quick_estimate};

pub use shading_table::content::TableContent;
#[cfg(feature = "gpu")]
pub(crate) use shading_table::sampled_facets::subset_size;
pub use shading_table::{Nodes, ShadingTable};
pub use tint::Tint;
pub use view_paths::{PathEnd, PathKind, VaryingSurface, ViewLobe, ViewLobes, ViewPaths, Viewer};
pub use wu2011::{MaterialFactors, VisibleFacets, Wu2011, Wu2011Settings};

/// A reflectance that rendering can evaluate. Rendering knows nothing else of the small scale.
pub trait Reflectance: Sync {
    /// Writes `out[k] = f̄(lights[k], o)` [1/sr], the light's cosine included; 0 if a direction is below the horizon.
    /// Directions are unit vectors in the tangent frame (x, y along the tile, z the surface normal).
    fn eval_lights(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]);

    /// As [`Reflectance::eval_lights`], but may leave out the light of [`Reflectance::eval_bounced`]; returns true if it does.
    /// That light varies slowly, so that images interpolate it between points.
    fn eval_direct(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) -> bool {
        self.eval_lights(lights, o, out);
        false
    }

    /// As [`Reflectance::eval_lights`], of the light that several facets reflected, which a close-up of the tile does not
    /// compute itself.
    fn eval_bounced(&self, lights: &[Vec3], _: Vec3, out: &mut [Vec3]) {
        out[..lights.len()].fill(Vec3::ZERO);
    }
}

/// Light that passes through a surface to its other side. Rendering knows nothing else of a slab.
pub trait Transmittance: Sync {
    /// Writes `out[k] = f̄(lights[k], o)` [1/sr], the light's cosine included; 0 unless light and viewer are on opposite
    /// sides. Light that keeps its direction is left out. Directions are unit vectors in the tangent frame.
    fn eval_transmitted(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]);
}

/// A reflectance of zero, for renderings that a GPU shades with a material of its own.
#[derive(Debug, Clone, Copy)]
pub struct Black;

impl Reflectance for Black {
    fn eval_lights(&self, lights: &[Vec3], _: Vec3, out: &mut [Vec3]) {
        out[..lights.len()].fill(Vec3::ZERO);
    }
}

/// Interpolation between evenly spaced samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Interpolation {
    /// Cubic (Catmull and Rom 1974).
    #[default]
    Cubic,
    /// Linear: it reads half as many samples, and has kinks at them.
    Linear,
}

impl Interpolation {
    /// Weights of four samples at the fraction `t` between the second and the third.
    fn weights(self, t: f32) -> [f32; 4] {
        match self {
            Self::Cubic => cubic_weights(t),
            Self::Linear => [0.0, 1.0 - t, t, 0.0],
        }
    }
}
