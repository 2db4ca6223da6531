//! A flag by which one thread tells another that its solve is no longer wanted.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use crate::SolveError;

/// Cancels the solves it is handed to. Clones share one flag.
#[derive(Clone, Debug, Default)]
pub struct Cancellation(Arc<AtomicBool>);

impl Cancellation {
    /// A token nobody has cancelled yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Asks every solve that holds this token, or a clone of it, to stop soon with
    /// [`SolveError::Cancelled`].
    pub fn cancel(&self) {
        // Relaxed: the flag carries no other data, and a solve that sees it a little later is only a little late.
        self.0.store(true, Ordering::Relaxed);
    }

    pub(crate) fn check(&self) -> Result<(), SolveError> {
        if self.0.load(Ordering::Relaxed) { Err(SolveError::Cancelled) } else { Ok(()) }
    }
}
