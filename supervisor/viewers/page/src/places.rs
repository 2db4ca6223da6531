//! Places for clients, a bounded number of them. When all are taken, the next client gets the place of the one that has been there
//! longest, so nobody keeps others out by staying.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, PoisonError, Weak},
};

use tokio::sync::Semaphore;

/// A place of a client, until it is dropped. It closes when another client gets it.
pub type Place = Arc<Semaphore>;

pub struct Places {
    most: usize,
    /// The oldest is the first.
    taken: Mutex<VecDeque<Weak<Semaphore>>>,
}

impl Places {
    pub fn new(most: usize) -> Self {
        Self { most, taken: Mutex::default() }
    }

    pub fn take(&self) -> Place {
        let place = Arc::new(Semaphore::new(0));
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        taken.retain(|place| place.strong_count() > 0);
        if taken.len() >= self.most
            && let Some(oldest) = taken.pop_front().and_then(|oldest| oldest.upgrade())
        {
            oldest.close();
        }
        taken.push_back(Arc::downgrade(&place));
        place
    }
}

/// Wait until another client gets `place`.
pub async fn lost(place: &Place) {
    let _ = place.acquire().await;
}
