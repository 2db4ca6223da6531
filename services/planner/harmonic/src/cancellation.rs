use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use crate::SolveError;

/// Token that cancels the solves it is passed to.
///
/// Clones share one flag.
#[derive(Clone, Debug, Default)]
pub struct Cancellation(Arc<AtomicBool>);

impl Cancellation {
    /// Creates a token that is not cancelled.
    pub fn new() -> Self {
        Self::default()
    }

    /// Makes every solve that holds this token or a clone stop soon with [`SolveError::Cancelled`].
    pub fn cancel(&self) {
        // Relaxed is enough: the flag carries no other data, and a late read only delays the stop.
        self.0.store(true, Ordering::Relaxed);
    }

    pub(crate) fn check(&self) -> Result<(), SolveError> {
        if self.0.load(Ordering::Relaxed) { Err(SolveError::Cancelled) } else { Ok(()) }
    }
}
