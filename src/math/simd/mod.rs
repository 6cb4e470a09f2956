//! Inner loops over facets, written so that the compiler vectorises them, with the widest instructions found at run time; and
//! [`eight`] values at once for what it does not vectorise.
//!
//! Every function here has a plain twin elsewhere that the tests compare it with.

mod eight;
mod gather;
mod lobes;
mod math;
mod pairs;
mod rows;
#[cfg(test)]
mod tests;
mod visibility;

pub(crate) use eight::{F32x8Array, InSimdF32x8, SimdF32x8, eight};
pub use gather::gathered_dot;
pub use lobes::{Lobe, PairVectors, light_lobes, lobe_sums, lobe_values};
pub(crate) use math::cubic_weights;
pub use pairs::{LightPairs, azimuth_and_elevation, pair_grid_coordinates, pair_vectors};
pub use rows::{RowGrid, row_sums};
pub use visibility::{
    SWITCH, blend_bits, ground_sum, ground_visibility, interval_cover, masked_sum, projected_area, stepped_visibility,
};

/// Compiles a function for the baseline, AVX2 and AVX-512, and picks at run time.
macro_rules! multiversion {
    ($(#[$doc:meta])* pub fn $name:ident $(<const $n:ident: usize>)? ($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? $body:block) => {
        $(#[$doc])*
        pub fn $name $(<const $n: usize>)? ($($arg: $ty),*) $(-> $ret)? {
            #[inline(always)]
            fn generic $(<const $n: usize>)? ($($arg: $ty),*) $(-> $ret)? $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,fma")]
                fn avx2 $(<const $n: usize>)? ($($arg: $ty),*) $(-> $ret)? { generic($($arg),*) }

                #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma")]
                fn avx512 $(<const $n: usize>)? ($($arg: $ty),*) $(-> $ret)? { generic($($arg),*) }

                if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512dq") && is_x86_feature_detected!("avx512vl")
                {
                    // SAFETY: the features the function was compiled for were just found.
                    return unsafe { avx512($($arg),*) };
                }
                if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                    // SAFETY: as above.
                    return unsafe { avx2($($arg),*) };
                }
            }
            generic($($arg),*)
        }
    };
}
pub(crate) use multiversion;

/// The instructions that these loops run with here: others round differently.
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

/// Values worked on together: enough that the compiler keeps the loop over them and vectorises it.
pub(crate) const LANES: usize = 64;

/// Facets summed in f32 before the sum is carried over to f64: bounds the rounding error of a sum over any number.
pub(crate) const BLOCK: usize = 1024;

/// Starts of the lanes of each block of `n` values.
#[inline(always)]
pub(crate) fn blocks(n: usize) -> impl Iterator<Item = impl Iterator<Item = usize>> {
    (0..n).step_by(BLOCK).map(move |start| (start..(start + BLOCK).min(n)).step_by(LANES))
}

/// The values of one lane; zeros beyond the end.
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

/// The sum of all lanes, a multiple of eight, by halves: one after the other each would wait for the last.
#[inline(always)]
pub(crate) fn total<const N: usize>(lanes: &[f32; N]) -> f64 {
    let mut sums = [0.0_f64; 8];
    for eight in lanes.as_chunks::<8>().0 {
        for l in 0..8 {
            sums[l] += f64::from(eight[l]);
        }
    }
    for l in 0..4 {
        sums[l] += sums[l + 4];
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3])
}
