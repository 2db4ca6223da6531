//! Supervisor's roster, as another process reads it.

use std::time::Duration;

use crate::{
    bus::{Author, Bus, BusError, Names, Reader},
    clock::Instant,
    domain::Domain,
    machine,
    samples::{RosterEntry, RosterHeader, name_str},
    topics,
    waiter::Waiter,
};

/// Wait for the roster that answers a process's first heartbeat; long enough for a loaded machine.
const PATIENCE: Duration = Duration::from_secs(1);
/// Wait for a stage to be named. Earlier samples, such as the first whole map, are lost.
#[cfg(feature = "stage")]
pub(crate) const NAMED_WITHIN: Duration = Duration::from_secs(10);

#[derive(Debug)]
pub struct Roster {
    pub samples: Reader<RosterHeader, RosterEntry>,
    pub waiter: Waiter,
}

pub fn named(entries: &[RosterEntry]) -> impl Iterator<Item = (String, Author)> {
    entries.iter().filter(|entry| entry.pid != 0).map(|entry| {
        let author = Author { process: entry.pid, generation: entry.generation };
        (name_str(&entry.stage).to_owned(), author)
    })
}

/// Joins a robot's bus as a consumer, which reads only samples of the supervisor and of processes
/// in rosters.
pub fn join(domain: &Domain, name: &str) -> Result<Bus, BusError> {
    let bus = Bus::join_as_consumer(domain, name)?;
    if let Some(writers) = bus.writers() {
        writers.read_from(names(bus.reader(&topics::ROSTER)?));
        writers.wait_for_names(PATIENCE);
    }
    Ok(bus)
}

fn names(mut rosters: Reader<RosterHeader, RosterEntry>) -> Names {
    Box::new(move || {
        let mut all: Option<Vec<_>> = None;
        while let Some(entries) = rosters.next_slice()? {
            all.get_or_insert_default().extend(named(&entries));
        }
        Ok(all)
    })
}

impl Roster {
    pub fn open(bus: &Bus) -> Result<Self, BusError> {
        let mut waiter = Waiter::default();
        waiter.on(bus.wakeup(&topics::ROSTER)?);
        Ok(Self { samples: bus.reader(&topics::ROSTER)?, waiter })
    }

    /// Waits until a roster names this process. That roster precedes all samples of this process,
    /// so readers elsewhere know it by then. Returns whether it came within `patience`.
    #[cfg(feature = "stage")]
    pub(crate) fn await_named(&mut self, bus: &Bus, patience: Duration) -> Result<bool, BusError> {
        let Some(writers) = bus.writers() else {
            return Ok(true);
        };
        let own = machine::process();
        let first = self.find(patience, |_, entries| {
            let names_own = entries.iter().any(|entry| entry.pid == own);
            names_own.then(|| named(entries).collect::<Vec<_>>())
        })?;
        Ok(first.map(|stages| writers.name(stages)).is_some())
    }

    #[cfg(feature = "stage")]
    pub(crate) fn admit(self, bus: &Bus) {
        if let Some(writers) = bus.writers() {
            writers.read_from(names(self.samples));
        }
    }

    /// Returns the first result of `find` in a roster; `None` after `patience`.
    pub fn find<T>(
        &mut self,
        patience: Duration,
        mut find: impl FnMut(&RosterHeader, &[RosterEntry]) -> Option<T>,
    ) -> Result<Option<T>, BusError> {
        let began = Instant::now();
        loop {
            while let Some(entries) = self.samples.next_slice()? {
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
