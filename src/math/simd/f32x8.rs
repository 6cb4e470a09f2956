//! Arithmetic on eight values at once, for code with too many branches for the compiler to vectorise.

use std::ops::{Add, Div, Mul, Sub};

use glam::{BVec4A, Vec4};

/// Arithmetic on eight values.
pub(crate) trait SimdF32x8:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// One Boolean per value.
    type Mask: Copy;

    fn of(values: &F32x8Array) -> Self;
    fn splat(value: f32) -> Self;
    fn to_array(self) -> [f32; 8];
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn less(self, other: Self) -> Self::Mask;
    /// Whether `self <= other`.
    fn up_to(self, other: Self) -> Self::Mask;
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    fn either(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Mask as an integer: bit `l` belongs to value `l`.
    fn bits(mask: Self::Mask) -> u32;
}

/// A group of eight values in memory, with arithmetic that every machine supports.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(32))]
pub(crate) struct F32x8Array(pub [Vec4; 2]);

impl From<[f32; 8]> for F32x8Array {
    #[inline(always)]
    fn from([a, b, c, d, e, f, g, h]: [f32; 8]) -> Self {
        Self([Vec4::new(a, b, c, d), Vec4::new(e, f, g, h)])
    }
}

impl F32x8Array {
    pub fn splat(value: f32) -> Self {
        Self([Vec4::splat(value); 2])
    }

    pub fn set(&mut self, lane: usize, value: f32) {
        self.0[lane / 4][lane % 4] = value;
    }
}

/// Implements operators of a type, each by one function of two values.
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
    fn up_to(self, other: Self) -> Self::Mask {
        halves(self.0, other.0, Vec4::cmple)
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

/// A computation with eight values at once, generic over the type that holds them.
pub(crate) trait SimdTask {
    type Output;

    /// Runs the computation. An implementation must be `#[inline(always)]`; only then is it compiled for the
    /// instructions that `E` needs.
    fn with<E: SimdF32x8>(self) -> Self::Output;
}

/// Runs a task in the widest registers that this machine supports.
pub(crate) fn with_simd_f32x8<W: SimdTask>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        #[target_feature(enable = "avx2,fma")]
        fn avx2<W: SimdTask>(work: W) -> W::Output {
            work.with::<avx::Wide>()
        }
        // SAFETY: the condition checks all features that the function is compiled for.
        return unsafe { avx2(work) };
    }
    work.with::<F32x8Array>()
}

#[cfg(target_arch = "x86_64")]
mod avx {
    use std::arch::x86_64::*;

    use super::{Add, Div, F32x8Array, Mul, SimdF32x8, Sub};

    /// A group of eight values in one register. Every `unsafe` block here requires AVX: only
    /// [`with_simd_f32x8`](super::with_simd_f32x8) creates a value of this type, after it has checked for AVX.
    #[derive(Clone, Copy)]
    pub(super) struct Wide(__m256);

    operators! {
        Wide,
        // SAFETY: AVX is available, as the type's documentation says; this holds for all blocks below without a
        // comment.
        Add add |a: Wide, b: Wide| Wide(unsafe { _mm256_add_ps(a.0, b.0) }),
        Sub sub |a: Wide, b: Wide| Wide(unsafe { _mm256_sub_ps(a.0, b.0) }),
        Mul mul |a: Wide, b: Wide| Wide(unsafe { _mm256_mul_ps(a.0, b.0) }),
        Div div |a: Wide, b: Wide| Wide(unsafe { _mm256_div_ps(a.0, b.0) })
    }

    impl SimdF32x8 for Wide {
        type Mask = __m256;

        #[inline(always)]
        fn of(values: &F32x8Array) -> Self {
            // SAFETY: `repr(C, align(32))` makes `values` eight contiguous f32 that are aligned to 32 bytes.
            Self(unsafe { _mm256_load_ps(std::ptr::from_ref(values).cast()) })
        }
        #[inline(always)]
        fn splat(value: f32) -> Self {
            Self(unsafe { _mm256_set1_ps(value) })
        }
        #[inline(always)]
        fn to_array(self) -> [f32; 8] {
            let mut values = [0.0; 8];
            // SAFETY: the array has room for eight values.
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
        fn up_to(self, other: Self) -> Self::Mask {
            unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0) }
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
