//! Runs kernels with the widest vectors the machine has.
//!
//! The kernels are plain loops over slices, compiled once for every machine and once for wide vectors; which of the two
//! runs is decided when the program starts. No operation is fused or reordered by that, so the results are the same bit
//! for bit on every machine.

#[derive(Clone, Copy, Debug)]
pub(crate) struct Simd(pulp::Arch);

impl Default for Simd {
    fn default() -> Self {
        Self(pulp::Arch::new())
    }
}

impl Simd {
    /// Runs `kernel`, which must be `#[inline(always)]` all the way down: functions that are not inlined keep the narrow
    /// code.
    #[inline(always)]
    pub(crate) fn run<O>(self, kernel: impl FnMut() -> O) -> O {
        struct Run<F>(F);
        // `FnMut` is used because a call through `FnOnce` goes by way of a shim that is not inlined.
        impl<O, F: FnMut() -> O> pulp::WithSimd for Run<F> {
            type Output = O;

            #[inline(always)]
            fn with_simd<S: pulp::Simd>(mut self, _: S) -> O {
                (self.0)()
            }
        }
        self.0.dispatch(Run(kernel))
    }
}
