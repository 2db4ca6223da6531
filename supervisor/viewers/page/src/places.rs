//! Places for clients, a bounded number of them. When all are taken, the next client gets the place of the one that has been there
//! longest, so nobody keeps others out by staying.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, PoisonError},
};

use tokio::sync::Semaphore;

#[derive(Debug)]
pub(crate) struct Places {
    most: usize,
    /// One for each place, the oldest first. It is closed when the place goes to another client.
    taken: Mutex<VecDeque<Arc<Semaphore>>>,
}

/// A place of a client, which is free when this is dropped.
pub(crate) struct Place {
    places: Arc<Places>,
    mark: Arc<Semaphore>,
}

impl Places {
    pub(crate) fn new(most: usize) -> Arc<Self> {
        Arc::new(Self { most, taken: Mutex::default() })
    }

    pub(crate) fn take(self: &Arc<Self>) -> Place {
        let mark = Arc::new(Semaphore::new(0));
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        if taken.len() >= self.most
            && let Some(oldest) = taken.pop_front()
        {
            oldest.close();
        }
        taken.push_back(mark.clone());
        Place { places: self.clone(), mark }
    }
}

impl Place {
    /// Wait until another client gets this place.
    pub(crate) async fn lost(&self) {
        let _ = self.mark.acquire().await;
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut taken = self.places.taken.lock().unwrap_or_else(PoisonError::into_inner);
        taken.retain(|mark| !Arc::ptr_eq(mark, &self.mark));
    }
}
