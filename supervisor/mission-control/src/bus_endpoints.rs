//! Readers and writers of the supervisor on one bus.

use std::{rc::Rc, time::Duration};

use common::{
    bus::{Bus, BusError, Reader, Writer},
    clock::{Instant, MissionTime},
    mission::{MOST_CORNERS, MOST_ZONES},
    samples::{
        BeaconSample, ComplaintSample, DeathSample, DirectiveSample, FollowingSample, PlaceSample,
        RequestAnswer, RequestSample, RosterEntry, RosterHeader, StallSample, TargetSample,
        TickLimitSample, ZoneCorner, ZonesHeader,
    },
    topics,
    waiter::Waiter,
};
use processes::stages;

use crate::{
    error::Result,
    observer::{Observer, Record},
    surroundings::Surroundings,
};

pub(crate) struct BusEndpoints {
    pub observer: Observer,
    pub waiter: Waiter,
    pub target: Writer<TargetSample>,
    pub place: Writer<PlaceSample>,
    pub following: Writer<FollowingSample>,
    pub zones: Writer<ZonesHeader, ZoneCorner>,
    directive: Writer<DirectiveSample>,
    pub tick_limit: Writer<TickLimitSample>,
    roster: Writer<RosterHeader, RosterEntry>,
    pub complaints: Writer<ComplaintSample>,
    deaths: Writer<DeathSample>,
    stalls: Writer<StallSample>,
    orders: Writer<RequestSample>,
    pub requests: Reader<RequestSample>,
    pub beacon: Reader<BeaconSample>,
    /// Id and answer of the newest request; id 0 before the first.
    pub last_request: (u64, RequestAnswer),
    published: Option<Instant>,
    /// A consumer is new since the last publication.
    pub misses_trouble: bool,
    // The bus is dropped last.
    pub bus: Rc<Bus>,
}

impl BusEndpoints {
    pub(crate) fn open(bus: Rc<Bus>) -> Result<Self> {
        Self::continued(bus, Record::default(), (0, RequestAnswer::Taken))
    }

    fn continued(bus: Rc<Bus>, record: Record, last_request: (u64, RequestAnswer)) -> Result<Self> {
        let mut waiter = Waiter::default();
        let observer = Observer::new(&bus, &mut waiter, record)?;
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
            last_request,
            published: None,
            misses_trouble: false,
            bus,
        })
    }

    /// Replaces the bus. After an error, these endpoints belong to the abandoned bus.
    pub(crate) fn recreate(&mut self, surroundings: &mut dyn Surroundings) -> Result {
        surroundings.recreate_bus()?;
        let mut record = std::mem::take(&mut self.observer.record);
        // The next link connects to the robot anew.
        record.link = None;
        *self = Self::continued(surroundings.bus()?, record, self.last_request)?;
        Ok(())
    }

    /// Returns whether the last publication is a `period` old, or a new consumer waits for a
    /// roster or the newest trouble.
    pub(crate) fn is_due(&mut self, period: Duration) -> bool {
        // A consumer opens the roster last.
        self.misses_trouble |= self.roster.has_new_reader();
        self.misses_trouble || self.published.is_none_or(|last| last.elapsed() >= period)
    }

    pub(crate) fn publish_state(
        &mut self,
        tick: u64,
        time: MissionTime,
        directive: DirectiveSample,
        header: RosterHeader,
        entries: &[RosterEntry],
    ) -> Result<(), BusError> {
        (self.published, self.misses_trouble) = (Some(Instant::now()), false);
        assert_eq!(entries.len(), stages::TABLE.len());
        self.directive.publish(tick, time, directive)?;
        let (last_request, answer) = self.last_request;
        let header = RosterHeader { last_request, answer: answer.into(), ..header };
        self.roster.publish_slice(tick, time, header, entries)
    }

    /// Logs a failure.
    pub(crate) fn publish_death(&mut self, death: DeathSample) {
        let stamp = self.observer.record.pose.unwrap_or_default().stamp;
        warn_if_failed(self.deaths.publish(stamp.tick, stamp.time(), death));
    }

    pub(crate) fn publish_order(
        &mut self,
        time: MissionTime,
        request: RequestSample,
        answer: RequestAnswer,
    ) {
        let tick = self.observer.record.newest_tick().unwrap_or_default();
        let order = RequestSample { answer: answer.into(), ..request };
        warn_if_failed(self.orders.publish(tick, time, order));
    }

    pub(crate) fn publish_stall(&mut self, stall: StallSample) {
        warn_if_failed(self.stalls.publish(stall.stamp.tick, stall.stamp.time(), stall));
    }
}

fn warn_if_failed(published: Result<(), BusError>) {
    if let Err(error) = published {
        tracing::warn!(%error, "cannot publish a record");
    }
}
