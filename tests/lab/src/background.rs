//! Threads beside a measurement: programs of simulated robots, and consumers.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    thread::{self, JoinHandle},
};

pub struct Turns {
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Turns {
    /// Starts a thread that runs the turns created by `begin`.
    ///
    /// Each turn returns soon and may fail: a datagram sent before the other end listens is lost,
    /// as on a radio.
    pub fn start<E, Turn: FnMut() -> Result<(), E>>(
        begin: impl FnOnce() -> Turn + Send + 'static,
    ) -> Self {
        let ends = Arc::new(AtomicBool::new(false));
        let is_over = ends.clone();
        let thread = thread::spawn(move || {
            let mut turn = begin();
            while !is_over.load(Relaxed) {
                let _ = turn();
            }
        });
        Self { ends, thread: Some(thread) }
    }
}

impl Drop for Turns {
    fn drop(&mut self) {
        self.ends.store(true, Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
