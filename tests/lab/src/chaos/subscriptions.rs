//! The attacker's readers on the bus.

use std::time::Duration;

use common::{
    bus::{AnyReader, AnyTopic, Bus, BusError, Reader},
    domain::Domain,
    roster::Roster,
    samples::{DeathSample, HealthSample, PoseSample, RosterEntry, RosterHeader, WheelSample},
    topics,
};

use crate::{chaos::options::Options, error::Result};

/// Wait for the bus between checks of the processes.
pub const POLL: Duration = Duration::from_millis(50);

/// The attacker's readers on the bus of one generation of the supervisor.
pub struct Subscriptions {
    pub roster: Roster,
    pub deaths: Reader<DeathSample>,
    pub health: Reader<HealthSample>,
    pub wheels: Reader<WheelSample>,
    pub pose: Reader<PoseSample>,
    /// The other outputs of a tick, each with its writer.
    pub outputs: Vec<(&'static str, Box<dyn AnyReader>)>,
}

impl Subscriptions {
    /// Join the bus. None if the bus is not of `supervisor`: a killed supervisor leaves its bus, and its successor removes it.
    pub fn join(options: &Options, supervisor: u32) -> Result<Option<Self>> {
        let bus = Bus::join(&Domain::of(options.asked.robot.clone()), "chaos")?;
        let mut roster = Roster::open(&bus)?;
        roster.waiter.on(bus.wakeup(&topics::DEATHS)?);
        roster.waiter.on(bus.wakeup(&topics::HEALTH)?);
        roster.waiter.on(bus.wakeup(&topics::COMMAND)?);
        let outputs: [&dyn AnyTopic; 3] = [&topics::GRID, &topics::GUIDANCE, &topics::COMMAND];
        let outputs = outputs.iter().map(|it| Ok((it.spec().writer, it.any_reader(&bus)?)));
        let mut subscriptions = Self {
            roster,
            deaths: bus.reader(&topics::DEATHS)?,
            health: bus.reader(&topics::HEALTH)?,
            wheels: bus.reader(&topics::WHEELS)?,
            pose: bus.reader(&topics::POSE)?,
            outputs: outputs.collect::<Result<_, BusError>>()?,
        };
        let of_supervisor = |header: &RosterHeader, _: &[RosterEntry]| {
            (header.supervisor_pid == supervisor).then_some(())
        };
        let found = subscriptions.roster.find(2 * topics::RESTATE, of_supervisor)?;
        Ok(found.map(|()| subscriptions))
    }
}
