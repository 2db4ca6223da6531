//! The attacker's readers on the bus.

use std::time::Duration;

use common::{
    bus::{Bus, Reader, SliceReader},
    domain::Domain,
    roster::Roster,
    samples::{
        CommandSample, DeathSample, GridHeader, GuidanceSample, HealthSample, PoseSample,
        RosterEntry, RosterHeader, WheelSample,
    },
    topics,
};

use crate::chaos::{error::ChaosError, options::Options};

/// Wait for the bus between checks of the processes.
pub(crate) const POLL: Duration = Duration::from_millis(50);

/// The attacker's readers on the bus of one generation of the supervisor.
pub(crate) struct Subscriptions {
    pub(crate) roster: Roster,
    pub(crate) deaths: Reader<DeathSample>,
    pub(crate) health: Reader<HealthSample>,
    pub(crate) wheels: Reader<WheelSample>,
    pub(crate) pose: Reader<PoseSample>,
    pub(crate) grid: SliceReader<GridHeader, u8>,
    pub(crate) guidance: Reader<GuidanceSample>,
    pub(crate) command: Reader<CommandSample>,
}

impl Subscriptions {
    /// Join the bus. None if the bus is not of `supervisor`: a killed supervisor leaves its bus, and its successor removes it.
    pub(crate) fn join(options: &Options, supervisor: u32) -> Result<Option<Self>, ChaosError> {
        let bus = Bus::join(&Domain::of(options.robot.clone()), "chaos")?;
        let mut roster = Roster::open(&bus)?;
        roster.waiter.on(bus.wakeup(&topics::DEATHS)?);
        roster.waiter.on(bus.wakeup(&topics::HEALTH)?);
        roster.waiter.on(bus.wakeup(&topics::COMMAND)?);
        let mut subscriptions = Self {
            roster,
            deaths: bus.reader(&topics::DEATHS)?,
            health: bus.reader(&topics::HEALTH)?,
            wheels: bus.reader(&topics::WHEELS)?,
            pose: bus.reader(&topics::POSE)?,
            grid: bus.slice_reader(&topics::GRID)?,
            guidance: bus.reader(&topics::GUIDANCE)?,
            command: bus.reader(&topics::COMMAND)?,
        };
        let of_supervisor = |header: &RosterHeader, _: &[RosterEntry]| {
            (header.supervisor_pid == supervisor).then_some(())
        };
        let found = subscriptions.roster.find(2 * topics::RESTATE, of_supervisor)?;
        Ok(found.map(|()| subscriptions))
    }
}
