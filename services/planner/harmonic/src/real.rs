//! Two precisions of multigrid and of the verification.

use std::ops::{Add, AddAssign, Div, Mul, Sub};

pub(crate) trait Real:
    Copy
    + Default
    + PartialOrd
    + Add<Output = Self>
    + AddAssign
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + std::fmt::Debug
    + Send
    + Sync
    + 'static
{
    const ONE: Self;
    /// Power of two for u at the target, so that both ends of the exponent range are used.
    const TOP: i32;

    /// Smallest number; smaller ones count as zero.
    const TINY: Self;

    /// Smallest u that is right once its residuals are small, for u = 2^TOP at the target.
    ///
    /// A smaller u is too low, because cells beyond it are missing from its sum.
    const KNOWN: f64;

    fn of(value: f64) -> Self;
    fn wide(self) -> f64;
    fn size(self) -> Self;

    /// Returns 1 / self if positive, else 0, so that inactive cells drop out of every sum.
    #[inline(always)]
    fn inverse(self) -> Self {
        if self > Self::default() { Self::ONE / self } else { Self::default() }
    }

    /// Flushes a number to 0 if it, or its product with a weight, would be subnormal.
    ///
    /// Subnormal numbers cost a hundred times as much as others, and the first cycles have many.
    #[inline(always)]
    fn flushed(self) -> Self {
        if self.size() > Self::TINY { self } else { Self::default() }
    }

    /// Returns 1 if positive, else 0.
    #[inline(always)]
    fn is_active(self) -> Self {
        if self > Self::default() { Self::ONE } else { Self::default() }
    }
}

macro_rules! real {
    ($($name:ident: $top:literal $tiny:literal $known:literal)*) => {$(
        impl Real for $name {
            const ONE: Self = 1.0;
            const TOP: i32 = $top;
            const TINY: Self = $tiny;
            const KNOWN: f64 = $known;

            #[inline(always)]
            fn of(value: f64) -> Self {
                value as $name
            }

            #[inline(always)]
            fn wide(self) -> f64 {
                self.into()
            }

            #[inline(always)]
            fn size(self) -> Self {
                self.abs()
            }
        }
    )*};
}

real! {
    f32: 100 1e-34 1e-28
    f64: 900 1e-300 1e-294
}
