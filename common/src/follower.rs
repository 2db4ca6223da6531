//! Consumer that waits for a robot, follows it from run to run, and reports its absence.

use std::{
    os::fd::BorrowedFd,
    time::{Duration, Instant},
};

use crate::{
    bus::{Bus, BusError},
    bus_instance::BusInstance,
    domain::Domain,
    roster,
    topics::{self, AnyTopic, Rate},
    waiter::Waiter,
};

const LOOK_EVERY: Duration = Duration::from_millis(100);
/// Time after which an unusable bus is an error; one that is being removed is gone by then.
const REFUSED_FOR: Duration = Duration::from_secs(2);

/// Follower of one robot. `open` opens the readers, `Topics`, on each bus; they are dropped with
/// it.
pub struct Follower<Topics, Open> {
    domain: Domain,
    name: String,
    wake_on: Vec<&'static dyn AnyTopic>,
    open: Open,
    /// The robot is gone, and its last samples come first.
    ending: bool,
    /// Time of the last check for the robot's absence.
    looked: Instant,
    joined: Option<Joined<Topics>>,
    refused: Option<(BusInstance, Instant)>,
}

/// Fields are dropped in this order: the bus last.
struct Joined<Topics> {
    topics: Topics,
    waiter: Waiter,
    bus: Bus,
}

#[derive(Debug, PartialEq, Eq)]
pub enum Event<'a, Topics> {
    Connected,
    /// Samples may be available: take all.
    Samples(&'a mut Topics),
    Nothing,
    /// The run has ended, or its bus was replaced: the follower waits for the robot again.
    Disconnected,
}

/// Returns the topic whose wakeup announces `topic`. The link's state ends the tick, so consumers
/// woken by it take no processor from stages in the tick.
fn wakes_for(topic: &'static dyn AnyTopic) -> &'static dyn AnyTopic {
    match topic.spec().rate {
        Rate::EachTick | Rate::EachFrame => &topics::LINK,
        Rate::OnChange { .. } | Rate::WhenItHappens => topic,
    }
}

impl<Topics, Open: FnMut(&Bus) -> Result<Topics, BusError>> Follower<Topics, Open> {
    /// Follows the robot of `domain` under a name that `iox2 node list` shows. Wakes for samples on
    /// `wake_on`, for those of each tick at its end.
    pub fn new(domain: Domain, name: &str, wake_on: &'static dyn AnyTopic, open: Open) -> Self {
        Self {
            domain,
            name: name.to_owned(),
            wake_on: vec![wake_on],
            open,
            ending: false,
            looked: Instant::now(),
            joined: None,
            refused: None,
        }
    }

    pub fn also_on(mut self, topics: impl IntoIterator<Item = &'static dyn AnyTopic>) -> Self {
        self.wake_on.extend(topics);
        self
    }

    /// Waits for an event, up to `timeout`.
    ///
    /// # Errors
    /// If an existing bus is unusable; waiting again fails until it is repaired.
    pub fn wait(&mut self, timeout: Duration) -> Result<Event<'_, Topics>, BusError> {
        self.wait_also_for(&[], timeout)
    }

    /// Waits like [`Follower::wait`], and returns [`Event::Samples`] when one of `others` is
    /// readable while the robot is present.
    pub fn wait_also_for(
        &mut self,
        others: &[BorrowedFd<'_>],
        timeout: Duration,
    ) -> Result<Event<'_, Topics>, BusError> {
        let began = Instant::now();
        while self.joined.is_none() {
            if self.look()? {
                return Ok(Event::Connected);
            }
            let left = timeout.saturating_sub(began.elapsed());
            if left.is_zero() {
                return Ok(Event::Nothing);
            }
            std::thread::park_timeout(left.min(LOOK_EVERY));
        }
        let came = loop {
            let left = timeout.saturating_sub(began.elapsed());
            if let Some(joined) = &self.joined
                && joined.waiter.wait_also_for(others, left.min(LOOK_EVERY)).unwrap_or(false)
            {
                break true;
            }
            if self.ending {
                self.joined = None;
                self.ending = false;
                return Ok(Event::Disconnected);
            }
            if self.on_disconnected() {
                self.ending = true;
                break true;
            }
            if left.is_zero() {
                break false;
            }
        };
        Ok(match &mut self.joined {
            Some(joined) if came => Event::Samples(&mut joined.topics),
            _ => Event::Nothing,
        })
    }

    pub fn topics(&mut self) -> Option<&mut Topics> {
        self.joined.as_mut().map(|joined| &mut joined.topics)
    }

    /// Reopens the readers, which then get whole maps. Returns the earlier ones; `None` while the
    /// robot is away.
    pub fn reopen(&mut self) -> Result<Option<Topics>, BusError> {
        let Some(joined) = &mut self.joined else {
            return Ok(None);
        };
        Ok(Some(std::mem::replace(&mut joined.topics, (self.open)(&joined.bus)?)))
    }

    fn look(&mut self) -> Result<bool, BusError> {
        assert!(self.joined.is_none() && !self.ending);
        let Ok(instance) = BusInstance::current(&self.domain) else {
            return Ok(false);
        };
        if !self.domain.is_supervised() {
            return Ok(false);
        }
        match self.join() {
            // Its supervisor was killed, and another has begun.
            Ok(joined) if joined.bus.is_replaced() => Ok(false),
            Ok(joined) => {
                self.joined = Some(joined);
                self.refused = None;
                Ok(true)
            }
            Err(error) => {
                const { assert!(LOOK_EVERY.as_millis() < REFUSED_FOR.as_millis()) };
                let since = match self.refused.take() {
                    Some((refused, since)) if refused == instance => since,
                    _ => Instant::now(),
                };
                self.refused = Some((instance, since));
                if since.elapsed() >= REFUSED_FOR {
                    return Err(error);
                }
                Ok(false)
            }
        }
    }

    fn join(&mut self) -> Result<Joined<Topics>, BusError> {
        let bus = roster::join(&self.domain, &self.name)?;
        let mut waiter = Waiter::default();
        let mut known = Vec::new();
        for topic in self.wake_on.iter().map(|&topic| wakes_for(topic)) {
            let name = topic.spec().name;
            if !known.contains(&name) {
                known.push(name);
                waiter.on(bus.wakeup(topic)?);
            }
        }
        Ok(Joined { topics: (self.open)(&bus)?, waiter, bus })
    }

    /// Checks at most once per interval: a check opens the supervisor's lock file.
    fn on_disconnected(&mut self) -> bool {
        if self.looked.elapsed() < LOOK_EVERY {
            return false;
        }
        self.looked = Instant::now();
        let replaced = |joined: &Joined<Topics>| joined.bus.is_replaced();
        // A killed supervisor leaves its bus behind.
        self.joined.as_ref().is_some_and(replaced) || !self.domain.is_supervised()
    }
}
