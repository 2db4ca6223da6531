//! The supervisor's roster, as another process reads it.

use std::time::{Duration, Instant};

use crate::{
    bus::{Bus, BusError, SliceReader},
    samples::{RosterEntry, RosterHeader},
    topics,
    waiter::Waiter,
};

/// Reads the topic `roster`.
#[derive(Debug)]
pub struct Roster {
    /// The rosters, as they are published.
    pub samples: SliceReader<RosterHeader, RosterEntry>,
    /// Wakes for them.
    pub waiter: Waiter,
}

impl Roster {
    /// Read the roster on `bus`.
    pub fn open(bus: &Bus) -> Result<Self, BusError> {
        let mut waiter = Waiter::default();
        waiter.on(bus.wakeup(&topics::ROSTER)?);
        Ok(Self { samples: bus.slice_reader(&topics::ROSTER)?, waiter })
    }

    /// The first result of `find` in a roster; none if there is no result for `patience`.
    pub fn find<T>(
        &mut self,
        patience: Duration,
        mut find: impl FnMut(&RosterHeader, &[RosterEntry]) -> Option<T>,
    ) -> Result<Option<T>, BusError> {
        let began = Instant::now();
        loop {
            while let Some(entries) = self.samples.take()? {
                let found = find(entries.header(), &entries);
                if found.is_some() {
                    return Ok(found);
                }
            }
            let left = patience.saturating_sub(began.elapsed());
            if left.is_zero() {
                return Ok(None);
            }
            self.waiter.wait(left)?;
        }
    }
}
