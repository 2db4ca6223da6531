/// Non-negative number `mantissa` * 2^`exponent`; zero is (0.0, 0).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scaled {
    /// Mantissa in 1.0 .. 2.0, or 0.
    pub mantissa: f64,
    /// Exponent to base 2.
    pub exponent: i32,
}

impl Scaled {
    /// Zero.
    pub const ZERO: Self = Self { mantissa: 0.0, exponent: 0 };
    /// One.
    pub const ONE: Self = Self { mantissa: 1.0, exponent: 0 };

    /// Creates `value` * 2^`exponent`.
    ///
    /// A value that is NaN, infinite, zero or negative becomes zero.
    pub fn new(value: f64, exponent: i32) -> Self {
        if !(value > 0.0 && value.is_finite()) {
            return Self::ZERO;
        }
        // Scaling makes subnormals normal, so that the bits hold their exponent.
        let (value, exponent) = if value < f64::MIN_POSITIVE {
            (value * pow2(64), exponent.saturating_sub(64))
        } else {
            (value, exponent)
        };
        let bits = value.to_bits();
        let own = ((bits >> 52) & 0x7ff) as i32 - 1023;
        let mantissa = f64::from_bits((bits & 0x000f_ffff_ffff_ffff) | (1023 << 52));
        debug_assert!((1.0..2.0).contains(&mantissa));
        Self { mantissa, exponent: exponent.saturating_add(own) }
    }

    /// Returns whether the number is 0.
    pub fn is_zero(self) -> bool {
        self.mantissa == 0.0
    }

    /// Sums `terms` in their order.
    pub(crate) fn sum(terms: impl Iterator<Item = Self> + Clone) -> Self {
        let largest = terms.clone().filter(|it| !it.is_zero()).map(|it| it.exponent).max();
        largest.map_or(Self::ZERO, |largest| {
            Self::new(terms.map(|it| it.relative_to(largest)).sum(), largest)
        })
    }

    /// Divides the number by 2^`reference`; an underflow gives 0 and an overflow infinity.
    pub fn relative_to(self, reference: i32) -> f64 {
        // For zero, 0 * 2^huge would give NaN.
        if self.is_zero() {
            0.0
        } else {
            self.mantissa * pow2(self.exponent.saturating_sub(reference))
        }
    }

    /// Returns the base-2 logarithm; negative infinity for zero.
    pub fn log2(self) -> f64 {
        self.mantissa.log2() + f64::from(self.exponent)
    }

    /// Returns the base-10 logarithm; negative infinity for zero.
    pub fn log10(self) -> f64 {
        self.mantissa.log10() + f64::from(self.exponent) * std::f64::consts::LOG10_2
    }
}

impl PartialOrd for Scaled {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        match (self.is_zero(), other.is_zero()) {
            (false, false) if self.exponent != other.exponent => {
                self.exponent.partial_cmp(&other.exponent)
            }
            _ => self.mantissa.partial_cmp(&other.mantissa),
        }
    }
}

/// Returns 2^`n` exactly; 0 below the normal range and infinity above it.
///
/// The body is branch-free so that loops over it vectorise.
#[inline(always)]
pub(crate) fn pow2(n: i32) -> f64 {
    f64::from_bits(((n.clamp(-1023, 1024) + 1023) as u64) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::LOG10_2;

    #[test]
    fn a_scaled_number_keeps_its_value_beyond_the_range_of_f64() {
        for value in [1.0, 0.3, 1e300, 1e-300, 5e-324] {
            let tiny = Scaled::new(value, -200_000);
            assert!((1.0..2.0).contains(&tiny.mantissa));
            assert_eq!(tiny.exponent, Scaled::new(value, 0).exponent - 200_000);
            assert!((tiny.log10() + 200_000.0 * LOG10_2 - value.log10()).abs() < 1e-6);
        }
    }

    #[test]
    fn powers_of_two_are_exact_and_end_in_zero_and_infinity() {
        for n in -1022..=1023 {
            assert_eq!(pow2(n), 2.0_f64.powi(n));
        }
        assert_eq!([-1023, i32::MIN].map(pow2), [0.0; 2]);
        assert_eq!([1024, i32::MAX].map(pow2), [f64::INFINITY; 2]);
    }

    #[test]
    fn order_follows_the_exponent_before_the_mantissa_and_zero_stays_the_least() {
        assert_eq!(Scaled::ZERO.relative_to(-200_000), 0.0);
        let [low, high, higher] = [(1.9, -5000), (1.25, 7), (1.5, 7)]
            .map(|(mantissa, exponent)| Scaled { mantissa, exponent });
        assert!(Scaled::ZERO < low && low < high && high < higher);
    }
}
