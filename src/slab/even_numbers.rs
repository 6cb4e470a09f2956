//! Random numbers of photons that are spread evenly together.

use std::convert::Infallible;

use rand::{Rng, TryRng};

/// Numbers of a photon that are spread evenly: its direction, and the facets of both faces that it meets first.
const EVEN: usize = 6;
/// Steps of an evenly spread sequence in six dimensions: powers of 1 / 1.1127..., the root of `x⁷ = x + 1` (Roberts 2018).
const STEPS: [f64; EVEN] = [
    0.898_653_712_628_699,
    0.807_578_495_221_345,
    0.725_733_412_969_760,
    0.652_183_025_943_971,
    0.586_086_697_577_969,
    0.526_688_986_700_736,
];

/// The numbers of one photon. The first ones are those of an evenly spread sequence, the others random.
pub(super) struct EvenNumbers<'a, R> {
    photon: f64,
    shift: &'a [f64; EVEN],
    next: usize,
    random: &'a mut R,
}

impl<'a, R: Rng> EvenNumbers<'a, R> {
    /// The numbers of the photon `photon` of a sequence that `shift` moves.
    pub fn new(photon: usize, shift: &'a [f64; EVEN], random: &'a mut R) -> Self {
        Self { photon: (photon + 1) as f64, shift, next: 0, random }
    }
}

impl<R: Rng> TryRng for EvenNumbers<'_, R> {
    type Error = Infallible;

    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        Ok((self.next_u64() >> 32) as u32)
    }

    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        let Some(step) = STEPS.get(self.next) else { return self.random.try_next_u64() };
        let number = (self.shift[self.next] + self.photon * step).fract();
        self.next += 1;
        Ok((number * 2f64.powi(64)) as u64)
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
        self.random.try_fill_bytes(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_steps_are_powers_of_the_root_of_x_to_the_seventh_equals_x_plus_one() {
        let root = 1.0 / STEPS[0];
        assert!((root.powi(7) - root - 1.0).abs() < 1e-12);
        assert!(STEPS.iter().enumerate().all(|(k, step)| (step - STEPS[0].powi(k as i32 + 1)).abs() < 1e-14));
    }

    #[test]
    fn pairs_of_even_numbers_fill_the_square_and_later_numbers_are_random() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let shift = std::array::from_fn(|_| rng.random());
        let (mut counts, mut last) = ([0; 64], Vec::new());
        for photon in 0..4096 {
            let mut numbers = EvenNumbers::new(photon, &shift, &mut rng);
            let drawn: [f64; 7] = std::array::from_fn(|_| numbers.random());
            assert!(drawn.iter().all(|number| (0.0..1.0).contains(number)));
            counts[(drawn[2] * 8.0) as usize * 8 + (drawn[5] * 8.0) as usize] += 1;
            last.push(drawn[6]);
        }
        assert!(counts.iter().all(|count| (52..=76).contains(count)), "{counts:?}");
        assert!((last.iter().sum::<f64>() / 4096.0 - 0.5).abs() < 0.02);
    }
}
