//! Rounding to whole numbers without a function call, because the baseline of x86-64 has no instruction for it.

/// Computes `v.round() as i32`.
#[inline]
pub(crate) fn rounded(v: f32) -> i32 {
    let whole = v as i32;
    let rest = v - whole as f32;
    whole.saturating_add(i32::from(rest >= 0.5) - i32::from(rest <= -0.5))
}

/// Computes `v.floor() as i32`.
#[inline]
pub(crate) fn floored(v: f32) -> i32 {
    let whole = v as i32;
    whole.saturating_sub(i32::from(whole as f32 > v))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_equals_the_standard_library_for_all_kinds_of_floats() {
        let near =
            [0.5, 1.5, 2.5, 4096.5, 8388607.5, 8388608.0, 2147483648.0, 4e9, 1e-40, 0.0, f32::INFINITY, f32::NAN];
        let near = near.into_iter().flat_map(|v: f32| [v.next_down(), v, v.next_up()]).flat_map(|v| [v, -v]);
        // The loop tests every 10,007th float.
        for v in near.chain((0..=u32::MAX).step_by(10_007).map(f32::from_bits)) {
            assert_eq!((rounded(v), floored(v)), (v.round() as i32, v.floor() as i32), "{v:e}");
        }
    }
}
