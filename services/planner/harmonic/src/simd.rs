//! Kernels run with the widest vectors of the machine.
//!
//! Kernels are plain loops over slices, compiled once for every machine and once for wide vectors.
//! The choice is made when the program starts. It neither fuses nor reorders operations, so results
//! are the same to the bit on every machine.

#[derive(Clone, Copy, Debug)]
pub(crate) struct Simd(pulp::Arch);

impl Default for Simd {
    fn default() -> Self {
        Self(pulp::Arch::new())
    }
}

impl Simd {
    /// Runs `kernel`, which must be `#[inline(always)]` throughout: functions that are not inlined
    /// keep the narrow code.
    #[inline(always)]
    pub(crate) fn run<O>(self, kernel: impl FnMut() -> O) -> O {
        struct Run<F>(F);
        // A call through `FnOnce` goes through a shim that is not inlined, hence `FnMut`.
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
