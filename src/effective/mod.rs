//! From facets, visibility and BRDFs to the effective BRDF.

pub mod direct;
mod effective_brdf;
mod gpu_tile;
pub mod low_rank;
pub mod shading_table;
mod tint;
pub mod wu2011;

use glam::Vec3;

use crate::math::simd::cubic_weights;

pub use direct::Direct;
pub(crate) use direct::facet_groups::Group;
pub use direct::facet_sum::{FacetSum, Material, analytic_lobe};
pub use direct::forced::mean_colors;
pub use effective_brdf::{EffectiveBrdf, Representation};
pub use gpu_tile::{GpuTileInput, GpuVisibilityInput, Heights, Maps, Sliced};
pub use low_rank::bvndf::VisibilityRows;
pub use low_rank::rotated_basis::{BasisGrid, RotatedBasis, RotatedLobe};
pub use low_rank::{Channel, Factors, LowRank, LowRankSettings};

pub use shading_table::content::TableContent;
pub(crate) use shading_table::sampled_facets::share_of;
pub use shading_table::{Nodes, ShadingTable};
pub use tint::Tint;
pub use wu2011::{MaterialFactors, MaterialReport, VisibleFacets, Wu2011, Wu2011Report, Wu2011Settings};

/// What the large scale asks of a material: all it knows of the small scale.
pub trait Reflectance: Sync {
    /// `out[k] = f̄(lights[k], o)` [1/sr], the light's cosine included; 0 where either is under the horizon.
    /// Unit vectors in the tangent frame (x, y along the tile, z the surface normal).
    fn eval_lights(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]);
}

/// Reflects nothing: where a device shades, which holds a material of its own.
#[derive(Debug, Clone, Copy)]
pub struct Black;

impl Reflectance for Black {
    fn eval_lights(&self, lights: &[Vec3], _: Vec3, out: &mut [Vec3]) {
        out[..lights.len()].fill(Vec3::ZERO);
    }
}

/// How samples that stand evenly are read between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Interpolation {
    /// Catmull and Rom (1974).
    #[default]
    Cubic,
    /// Half the reading, and kinks.
    Linear,
}

impl Interpolation {
    /// Weights of four samples about a place `t` of the way from the second to the third.
    fn weights(self, t: f32) -> [f32; 4] {
        match self {
            Self::Cubic => cubic_weights(t),
            Self::Linear => [0.0, 1.0 - t, t, 0.0],
        }
    }
}
