//! The attacker's place on the bus.

use std::time::Instant;

use common::{
    bus::{Bus, Reader, SliceReader},
    domain::Domain,
    samples::{
        CommandSample, GridHeader, GuidanceSample, HealthSample, PoseSample, RosterEntry,
        RosterHeader, WheelSample,
    },
    topics,
    waiter::Waiter,
};

use super::{ChaosError, Options, attack::LOOK};

/// The attacker's place on the bus, for one life of the supervisor.
pub(super) struct Subscriptions {
    pub(super) roster: SliceReader<RosterHeader, RosterEntry>,
    pub(super) health: Reader<HealthSample>,
    pub(super) wheels: Reader<WheelSample>,
    pub(super) pose: Reader<PoseSample>,
    pub(super) grid: SliceReader<GridHeader, u8>,
    pub(super) guidance: Reader<GuidanceSample>,
    pub(super) command: Reader<CommandSample>,
    pub(super) waiter: Waiter,
}

impl Subscriptions {
    /// None on the bus of another than `supervisor`: one that died leaves its bus to its successor to remove.
    pub(super) fn join(options: &Options, supervisor: u32) -> Result<Option<Self>, ChaosError> {
        let bus = Bus::join(&Domain::of(options.robot.clone()), "chaos")?;
        let mut waiter = Waiter::default();
        waiter.on(bus.wakeup(&topics::ROSTER)?);
        waiter.on(bus.wakeup(&topics::HEALTH)?);
        waiter.on(bus.wakeup(&topics::COMMAND)?);
        let mut subscriptions = Self {
            roster: bus.slice_reader(&topics::ROSTER)?,
            health: bus.reader(&topics::HEALTH)?,
            wheels: bus.reader(&topics::WHEELS)?,
            pose: bus.reader(&topics::POSE)?,
            grid: bus.slice_reader(&topics::GRID)?,
            guidance: bus.reader(&topics::GUIDANCE)?,
            command: bus.reader(&topics::COMMAND)?,
            waiter,
        };
        let began = Instant::now();
        while began.elapsed() < 2 * topics::RESTATE {
            while let Some(entries) = subscriptions.roster.take()? {
                if entries.header().supervisor_pid == supervisor {
                    return Ok(Some(subscriptions));
                }
            }
            subscriptions.waiter.wait(LOOK)?;
        }
        Ok(None)
    }
}
