//! Rows of a table of topics.

use std::marker::PhantomData;

use super::spec::Spec;

/// Topic whose samples are a header `H` and a slice of elements `E`; with `()` for `E`, the header
/// alone.
#[derive(Debug)]
pub struct Topic<H, E = ()> {
    pub(super) spec: &'static Spec,
    carries: PhantomData<fn() -> (H, E)>,
}

impl<H, E> Topic<H, E> {
    pub const fn new(spec: &'static Spec) -> Self {
        Self { spec, carries: PhantomData }
    }

    pub const fn spec(&self) -> &'static Spec {
        self.spec
    }
}
