//! The effective BRDF as a sum over facets that is evaluated at the query: soft visibility, exact lobes, no tabulated
//! product.

pub(crate) mod clustered_sum;
pub(crate) mod facet_groups;
pub(crate) mod facet_sum;
pub(crate) mod forced;
pub(crate) mod strided_subset;

use std::cell::RefCell;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use self::clustered_sum::{ClusteredSum, SumView};
use super::{FacetSum, VisibilityRows};
use crate::math::simd::LightPairs;
use crate::visibility::Visibility;

/// A sum over facets, evaluated at the query. Lobes are exact; only visibility is interpolated.
#[derive(Debug, Clone)]
pub struct Direct {
    pub sum: Arc<FacetSum>,
    pub visibility: Arc<Visibility>,
    /// Horizon bounds for a clustered sum, if [`ClusteredSum::of`] supports the sum.
    clustered: Option<Arc<ClusteredSum>>,
}

#[derive(Default)]
struct Scratch {
    pairs: LightPairs,
    v_i: Vec<f32>,
    v_o: Vec<f32>,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

impl Direct {
    pub fn new(sum: Arc<FacetSum>, visibility: Arc<Visibility>) -> Self {
        let clustered = ClusteredSum::of(&sum, &visibility).map(Arc::new);
        Self { sum, visibility, clustered }
    }

    /// Returns true if queries use a clustered sum.
    pub fn has_clustered_sum(&self) -> bool {
        self.clustered.is_some()
    }

    /// Calls `function` with the visibilities of all facets along `i` and `o`.
    pub(crate) fn with_visibility<T>(&self, i: Vec3, o: Vec3, function: impl FnOnce(&[f32], &[f32]) -> T) -> T {
        SCRATCH.with_borrow_mut(|scratch| {
            let facets = self.sum.facet_count();
            scratch.v_i.resize(facets, 0.0);
            scratch.v_o.resize(facets, 0.0);
            self.visibility.fill(i, 0..facets, &mut scratch.v_i);
            self.visibility.fill(o, 0..facets, &mut scratch.v_o);
            function(&scratch.v_i, &scratch.v_o)
        })
    }

    /// Returns `a_v(o)` and writes `Σ ΔA V V f = a_v f̄` of each light to `out`.
    pub fn sums(&self, lights: &[Vec3], o: Vec3, mut out: impl FnMut(usize, DVec3)) -> f64 {
        SCRATCH.with_borrow_mut(|scratch| {
            let facets = self.sum.facet_count();
            scratch.v_i.resize(facets, 0.0);
            scratch.v_o.resize(facets, 0.0);
            self.visibility.fill(o, 0..facets, &mut scratch.v_o);
            let area = self.sum.projected_area(&scratch.v_o, o);
            if let (Visibility::HorizonMap(horizon_map), Some(clustered), true) =
                (&*self.visibility, &self.clustered, o.z > 0.0 && area > 0.0)
            {
                for (v, area) in scratch.v_o.iter_mut().zip(self.sum.areas(0..facets)) {
                    *v *= area;
                }
                let view = SumView { sum: &self.sum, horizon_map, o, areas: &scratch.v_o };
                clustered.sums(view, lights, &mut scratch.pairs, out);
                return area;
            }
            for (k, &i) in lights.iter().enumerate() {
                if i.z > 0.0 && o.z > 0.0 && area > 0.0 {
                    self.visibility.fill(i, 0..facets, &mut scratch.v_i);
                    out(k, self.sum.sum(i, o, &scratch.v_i, &scratch.v_o));
                } else {
                    out(k, DVec3::ZERO);
                }
            }
            area
        })
    }

    /// `f̄(i, o)` with exact lobes and with visibility interpolated between the nodes of `rows`, for directions above
    /// the horizon.
    pub(crate) fn eval_interpolated(&self, rows: &VisibilityRows, i: Vec3, o: Vec3) -> Vec3 {
        let (mut v_i, mut v_o) = (vec![0.0; rows.facets], vec![0.0; rows.facets]);
        rows.read(i, &mut v_i);
        rows.read(o, &mut v_o);
        let area = self.sum.projected_area(&v_o, o);
        if area > 0.0 { (self.sum.sum(i, o, &v_i, &v_o) / area).as_vec3() } else { Vec3::ZERO }
    }
}
