//! SimdF32x8 values at once, for code with too many branches for the compiler to make vectors of.

use std::ops::{Add, Div, Mul, Sub};

use glam::{BVec4A, Vec4};

/// Arithmetic on eight values.
pub(crate) trait SimdF32x8:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// A yes or no for each.
    type Mask: Copy;

    fn of(values: &F32x8Array) -> Self;
    fn splat(value: f32) -> Self;
    fn to_array(self) -> [f32; 8];
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn less(self, other: Self) -> Self::Mask;
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    fn either(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Bit `l` is that of value `l`.
    fn bits(mask: Self::Mask) -> u32;
}

/// SimdF32x8 values in memory, and how every machine computes with them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(32))]
pub(crate) struct F32x8Array(pub [Vec4; 2]);

impl F32x8Array {
    pub fn splat(value: f32) -> Self {
        Self([Vec4::splat(value); 2])
    }

    pub fn set(&mut self, lane: usize, value: f32) {
        self.0[lane / 4][lane % 4] = value;
    }
}

/// Operators of a type, each from one function of its halves or of its vector.
macro_rules! operators {
    ($type:ty, $($operator:ident $method:ident $of:expr),*) => {
        $(impl $operator for $type {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                $of(self, other)
            }
        })*
    };
}

#[inline(always)]
fn halves<T: Copy, U: Copy, R>(a: [T; 2], b: [U; 2], of: impl Fn(T, U) -> R) -> [R; 2] {
    [of(a[0], b[0]), of(a[1], b[1])]
}

operators! {
    F32x8Array,
    Add add |a: F32x8Array, b: F32x8Array| F32x8Array(halves(a.0, b.0, |a, b| a + b)),
    Sub sub |a: F32x8Array, b: F32x8Array| F32x8Array(halves(a.0, b.0, |a, b| a - b)),
    Mul mul |a: F32x8Array, b: F32x8Array| F32x8Array(halves(a.0, b.0, |a, b| a * b)),
    Div div |a: F32x8Array, b: F32x8Array| F32x8Array(halves(a.0, b.0, |a, b| a / b))
}

impl SimdF32x8 for F32x8Array {
    type Mask = [BVec4A; 2];

    #[inline(always)]
    fn of(values: &F32x8Array) -> Self {
        *values
    }
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self::splat(value)
    }
    #[inline(always)]
    fn to_array(self) -> [f32; 8] {
        let [a, b] = self.0.map(|half| half.to_array());
        [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]]
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(halves(self.0, other.0, Vec4::min))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(halves(self.0, other.0, Vec4::max))
    }
    #[inline(always)]
    fn less(self, other: Self) -> Self::Mask {
        halves(self.0, other.0, Vec4::cmplt)
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Self(halves(mask, [(yes.0[0], no.0[0]), (yes.0[1], no.0[1])], |mask, (yes, no)| Vec4::select(mask, yes, no)))
    }
    #[inline(always)]
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        halves(a, b, |a, b| a & b)
    }
    #[inline(always)]
    fn either(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        halves(a, b, |a, b| a | b)
    }
    #[inline(always)]
    fn bits(mask: Self::Mask) -> u32 {
        mask[0].bitmask() | mask[1].bitmask() << 4
    }
}

/// Work that computes with eight values at once, on whatever holds them.
pub(crate) trait InSimdF32x8 {
    type Output;

    /// To be inlined always: only then is it compiled for what `E` needs.
    fn with<E: SimdF32x8>(self) -> Self::Output;
}

/// Does the work in the widest registers that were found.
pub(crate) fn eight<W: InSimdF32x8>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        #[target_feature(enable = "avx2,fma")]
        fn avx2<W: InSimdF32x8>(work: W) -> W::Output {
            work.with::<avx::Wide>()
        }
        // SAFETY: the features the function was compiled for were just found.
        return unsafe { avx2(work) };
    }
    work.with::<F32x8Array>()
}

#[cfg(target_arch = "x86_64")]
mod avx {
    use std::arch::x86_64::*;

    use super::{Add, Div, F32x8Array, Mul, SimdF32x8, Sub};

    /// SimdF32x8 values in one register. Every `unsafe` here rests on AVX being there: none is made but by
    /// [`eight`](super::eight), which looks first.
    #[derive(Clone, Copy)]
    pub(super) struct Wide(__m256);

    operators! {
        Wide,
        // SAFETY: of this and all below that is not said otherwise, as the type says.
        Add add |a: Wide, b: Wide| Wide(unsafe { _mm256_add_ps(a.0, b.0) }),
        Sub sub |a: Wide, b: Wide| Wide(unsafe { _mm256_sub_ps(a.0, b.0) }),
        Mul mul |a: Wide, b: Wide| Wide(unsafe { _mm256_mul_ps(a.0, b.0) }),
        Div div |a: Wide, b: Wide| Wide(unsafe { _mm256_div_ps(a.0, b.0) })
    }

    impl SimdF32x8 for Wide {
        type Mask = __m256;

        #[inline(always)]
        fn of(values: &F32x8Array) -> Self {
            // SAFETY: eight values in a row, as `repr(C)` lays them out, and aligned to all of them.
            Self(unsafe { _mm256_load_ps(std::ptr::from_ref(values).cast()) })
        }
        #[inline(always)]
        fn splat(value: f32) -> Self {
            Self(unsafe { _mm256_set1_ps(value) })
        }
        #[inline(always)]
        fn to_array(self) -> [f32; 8] {
            let mut values = [0.0; 8];
            // SAFETY: there is room for eight.
            unsafe { _mm256_storeu_ps(values.as_mut_ptr(), self.0) };
            values
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            Self(unsafe { _mm256_min_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            Self(unsafe { _mm256_max_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn less(self, other: Self) -> Self::Mask {
            unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0) }
        }
        #[inline(always)]
        fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
            Self(unsafe { _mm256_blendv_ps(no.0, yes.0, mask) })
        }
        #[inline(always)]
        fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask {
            unsafe { _mm256_and_ps(a, b) }
        }
        #[inline(always)]
        fn either(a: Self::Mask, b: Self::Mask) -> Self::Mask {
            unsafe { _mm256_or_ps(a, b) }
        }
        #[inline(always)]
        fn bits(mask: Self::Mask) -> u32 {
            unsafe { _mm256_movemask_ps(mask) as u32 }
        }
    }
}
