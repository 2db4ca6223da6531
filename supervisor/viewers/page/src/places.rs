//! Bounded places for clients. A new client replaces the oldest when all are taken, so clients
//! cannot lock others out.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, PoisonError, Weak},
};

use tokio::sync::Semaphore;

/// Place of a client until dropped. It closes when another client takes it.
pub type Place = Arc<Semaphore>;

pub struct Places {
    most: usize,
    /// Oldest first.
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

pub async fn lost(place: &Place) {
    let _ = place.acquire().await;
}
