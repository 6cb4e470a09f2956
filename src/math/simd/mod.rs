//! Inner loops over facets that the compiler vectorises, compiled for several instruction sets and selected at run
//! time. [`SimdF32x8`] computes with eight values at once in code that the compiler does not vectorise.
//!
//! Every function here has a scalar counterpart elsewhere; the tests compare the two.

mod f32x8;
mod gather;
mod lobes;
mod math;
mod pairs;
mod paths;
mod refraction;
mod rows;
#[cfg(test)]
mod tests;
mod visibility;

pub(crate) use f32x8::{F32x8Array, SimdF32x8, SimdTask, with_simd_f32x8};
pub use gather::{gathered_dot, gathered_row};
pub use lobes::{Lobe, PairVectors, add_lobes_around, light_lobes, lobe_sums, lobe_values};
pub(crate) use math::cubic_weights;
pub use pairs::{LightPairs, azimuth_and_cosine, azimuth_and_polar_angle, pair_grid_coordinates, pair_vectors};
pub use paths::{RayLane, enter_lane, facing_lane, facing_sum, leave_lane, ln_of_sum, mask_lane};
pub(crate) use refraction::smith_lambda;
pub use refraction::{
    BECKMANN, FacetColumns, GGX, Interior, LeavingColumns, Quadratic, RayColumns, enter, leave, leaving_facets, mask,
};
pub use rows::{RowGrid, row_sums};
pub use visibility::{
    HorizonTaps, SWITCH_RATE, blend_bits, horizon_visibility, interval_cover, masked_sum, projected_area,
    stepped_visibility, visible_sum,
};

/// Compiles a function for the baseline, AVX2 and AVX-512, and selects one of the three at run time.
macro_rules! multiversion {
    (
        $(#[$doc:meta])*
        pub fn $name:ident $(<const $n:ident: usize>)? ($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? $body:block
    ) => {
        $(#[$doc])*
        pub fn $name $(<const $n: usize>)? ($($arg: $ty),*) $(-> $ret)? {
            #[inline(always)]
            fn generic $(<const $n: usize>)? ($($arg: $ty),*) $(-> $ret)? $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,fma")]
                fn avx2 $(<const $n: usize>)? ($($arg: $ty),*) $(-> $ret)? { generic $(::<$n>)? ($($arg),*) }

                #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma")]
                fn avx512 $(<const $n: usize>)? ($($arg: $ty),*) $(-> $ret)? { generic $(::<$n>)? ($($arg),*) }

                if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512dq") && is_x86_feature_detected!("avx512vl")
                {
                    // SAFETY: the condition checks all features that the function is compiled for.
                    return unsafe { avx512 $(::<$n>)? ($($arg),*) };
                }
                if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                    // SAFETY: as above.
                    return unsafe { avx2 $(::<$n>)? ($($arg),*) };
                }
            }
            generic $(::<$n>)? ($($arg),*)
        }
    };
}
pub(crate) use multiversion;

/// Name of the instruction set that these loops use on this machine; another set rounds differently.
pub fn instructions() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl")
        {
            return "avx512";
        }
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            return "avx2";
        }
    }
    "baseline"
}

/// Values per lane, the chunk that an inner loop processes at once: enough that the compiler vectorises the loop.
pub(crate) const LANES: usize = 64;

/// Facets that are summed in f32 before the sum is added to an f64. It bounds the rounding error of sums of any length.
pub(crate) const BLOCK: usize = 1024;

/// For each block of `n` values, the first indices of its lanes.
#[inline(always)]
pub(crate) fn blocks(n: usize) -> impl Iterator<Item = impl Iterator<Item = usize>> {
    (0..n).step_by(BLOCK).map(move |start| (start..(start + BLOCK).min(n)).step_by(LANES))
}

/// The values of the lane that starts at `at`; zeros beyond the end.
#[inline(always)]
pub(crate) fn lane(values: &[f32], at: usize) -> [f32; LANES] {
    match values[at..].first_chunk::<LANES>() {
        Some(lane) => *lane,
        None => {
            let mut lane = [0.0; LANES];
            let rest = &values[at..];
            lane[..rest.len()].copy_from_slice(rest);
            lane
        }
    }
}

/// The sum of `N` values, a multiple of eight, in eight independent partial sums. In one chain, each addition would
/// wait for the previous one.
#[inline(always)]
pub(crate) fn total<const N: usize>(lanes: &[f32; N]) -> f64 {
    let mut sums = [0.0_f64; 8];
    for chunk in lanes.as_chunks::<8>().0 {
        for l in 0..8 {
            sums[l] += f64::from(chunk[l]);
        }
    }
    for l in 0..4 {
        sums[l] += sums[l + 4];
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3])
}
