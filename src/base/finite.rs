//! The check that a result is finite. It runs before a result is written.

use glam::{DVec3, Vec3};

use super::{Error, Result};

/// Numbers of a result.
pub trait Numbers {
    fn are_finite(&self) -> bool;
}

/// Checks that all numbers of a result are finite.
///
/// # Errors
/// A number is infinite or NaN. The input is then legal, but its products exceed the range of f32.
pub fn require_finite(numbers: &(impl Numbers + ?Sized)) -> Result<()> {
    if numbers.are_finite() {
        return Ok(());
    }
    Err(Error::failed(
        "the result has values that are not finite: lower the colours of the materials or of the colour image, or the \
         intensity of the lights",
    ))
}

impl Numbers for f32 {
    fn are_finite(&self) -> bool {
        self.is_finite()
    }
}

impl Numbers for f64 {
    fn are_finite(&self) -> bool {
        self.is_finite()
    }
}

impl Numbers for Vec3 {
    fn are_finite(&self) -> bool {
        self.is_finite()
    }
}

impl Numbers for DVec3 {
    fn are_finite(&self) -> bool {
        self.is_finite()
    }
}

impl<T: Numbers> Numbers for [T] {
    fn are_finite(&self) -> bool {
        self.iter().all(T::are_finite)
    }
}

impl<T: Numbers> Numbers for Vec<T> {
    fn are_finite(&self) -> bool {
        self.as_slice().are_finite()
    }
}

impl<T: Numbers> Numbers for Option<T> {
    fn are_finite(&self) -> bool {
        self.as_ref().is_none_or(T::are_finite)
    }
}

impl<A: Numbers, B: Numbers> Numbers for (A, B) {
    fn are_finite(&self) -> bool {
        self.0.are_finite() && self.1.are_finite()
    }
}

impl<T: Numbers, E> Numbers for std::result::Result<T, E> {
    fn are_finite(&self) -> bool {
        self.as_ref().map_or(true, T::are_finite)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_number_that_is_not_finite_is_found_and_exits_with_1() {
        assert!(require_finite(&vec![(Vec3::MAX, Some(1.0_f64)), (Vec3::ZERO, None)]).is_ok());
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let error = require_finite(&vec![(0.0_f32, vec![Vec3::ONE, Vec3::new(0.0, bad, 0.0)])]).unwrap_err();
            assert_eq!(error.exit_code(), 1);
            assert!(error.to_string().contains("not finite"), "{error}");
        }
    }
}
