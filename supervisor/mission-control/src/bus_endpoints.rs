//! Readers and writers of the supervisor on one bus.

use std::rc::Rc;

use common::{
    bus::{Bus, BusError, Reader, Writer},
    clock::Instant,
    mission::{MOST_CORNERS, MOST_ZONES},
    samples::{
        BeaconSample, ComplaintSample, DeathSample, DirectiveSample, FollowingSample, PlaceSample,
        RequestSample, RosterEntry, RosterHeader, StallSample, TargetSample, TickLimitSample,
        ZoneCorner, ZonesHeader,
    },
    topics,
    waiter::Waiter,
};
use processes::stages;

use crate::{error::Result, observer::Observer};

pub(crate) struct BusEndpoints {
    pub observer: Observer,
    pub waiter: Waiter,
    pub target: Writer<TargetSample>,
    pub place: Writer<PlaceSample>,
    pub following: Writer<FollowingSample>,
    pub zones: Writer<ZonesHeader, ZoneCorner>,
    pub directive: Writer<DirectiveSample>,
    pub tick_limit: Writer<TickLimitSample>,
    pub roster: Writer<RosterHeader, RosterEntry>,
    pub complaints: Writer<ComplaintSample>,
    pub deaths: Writer<DeathSample>,
    pub stalls: Writer<StallSample>,
    pub orders: Writer<RequestSample>,
    pub requests: Reader<RequestSample>,
    pub beacon: Reader<BeaconSample>,
    pub published: Option<Instant>,
    /// A consumer is new since the last publication.
    pub misses_trouble: bool,
    // The bus is dropped last.
    pub bus: Rc<Bus>,
}

impl BusEndpoints {
    pub(crate) fn open(bus: Rc<Bus>) -> Result<Self> {
        let mut waiter = Waiter::default();
        let observer = Observer::new(&bus, &mut waiter)?;
        waiter.on(bus.wakeup(&topics::REQUESTS)?);
        waiter.on(bus.wakeup(&topics::BEACON)?);
        Ok(Self {
            observer,
            waiter,
            target: bus.writer(&topics::TARGET, 1)?,
            place: bus.writer(&topics::PLACE, 1)?,
            following: bus.writer(&topics::FOLLOWING, 1)?,
            zones: bus.slice_writer(&topics::ZONES, 1, MOST_ZONES * MOST_CORNERS)?,
            directive: bus.writer(&topics::DIRECTIVE, 1)?,
            tick_limit: bus.writer(&topics::TICK_LIMIT, 1)?,
            complaints: bus.writer(&topics::COMPLAINTS, 1)?,
            roster: bus.slice_writer(&topics::ROSTER, 1, stages::TABLE.len())?,
            deaths: bus.writer(&topics::DEATHS, 1)?,
            stalls: bus.writer(&topics::STALLS, 1)?,
            orders: bus.writer(&topics::ORDERS, 1)?,
            requests: bus.reader(&topics::REQUESTS)?,
            beacon: bus.reader(&topics::BEACON)?,
            published: None,
            misses_trouble: false,
            bus,
        })
    }

    /// Returns whether the last publication is as old as [`topics::RESTATE`], or a new consumer
    /// waits for a roster or the newest trouble.
    pub(crate) fn is_due(&mut self) -> bool {
        // A consumer opens the roster last.
        self.misses_trouble |= self.roster.has_new_reader();
        self.misses_trouble || self.published.is_none_or(|last| last.elapsed() >= topics::RESTATE)
    }
}

/// Logs a failure of what only reports.
pub(crate) fn warn_if_failed(published: Result<(), BusError>) {
    if let Err(error) = published {
        tracing::warn!(%error, "cannot publish a record");
    }
}
