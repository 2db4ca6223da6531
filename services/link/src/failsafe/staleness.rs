//! Staleness monitor: ages of the newest command, its pose and its guidance.

use std::time::Duration;

use common::{
    clock::{MissionTime, Pace},
    mission::Mission,
    samples::{Cause, CommandSample},
};

use super::monitor::{Condition, Moment, Monitor, Observation};

#[derive(Clone, Debug)]
pub struct Staleness {
    limit: Duration,
    lockstep: bool,
    newest: Option<CommandSample>,
}

impl Monitor for Staleness {
    fn new(mission: &Mission) -> Self {
        Self {
            limit: Duration::from_secs_f64(mission.robot.command_limit_s),
            lockstep: true,
            newest: None,
        }
    }

    fn observe(&mut self, what: &Observation<'_>, _: Moment) {
        match *what {
            Observation::Pace(pace) => self.lockstep = pace == Pace::Max,
            Observation::Command(command) => self.newest = Some(*command),
            _ => {}
        }
    }

    fn condition(&self, cause: Cause, now: Moment) -> Condition {
        let Some(newest) = self.newest else {
            return (cause == Cause::CommandStale).into();
        };
        // In lockstep mission time waits for the command.
        let began = newest.stamp.time();
        let now = if self.lockstep { began } else { now.time };
        let then = match cause {
            Cause::PoseStale => MissionTime(newest.pose_ns),
            Cause::GuidanceStale => MissionTime(newest.guidance_ns),
            _ => began,
        };
        // Stamps from the future would never expire, so they count as too old.
        (then > now || now.since(then) > self.limit).into()
    }

    fn judges_frames(&self) -> bool {
        false
    }
}
