//! Decision whether the mission is over, and its outcome. Pure.

use std::time::Duration;

use common::{
    address::Address,
    clock::MissionTime,
    domain::RobotName,
    samples::{Action, HoldReason, LinkSample},
};
use glam::DVec2;
use link::failsafe;
use processes::{policy::Now, records};

use crate::outcome::{Ending, Outcome};

/// Time without a tick, or the start of an external stage, after which an unheld pipeline is stuck.
/// In lockstep mission time then stands still, so the mission's timeout cannot end the run.
const NO_PROGRESS: Duration = Duration::from_secs(15);

/// Time for the robot to come to rest. The link tries each stop method twice in it.
pub(crate) const RESTS_WITHIN: Duration = Duration::from_secs(5);

pub(crate) struct Snapshot<'a> {
    pub arrival: Option<Arrival>,
    pub link: Option<&'a LinkSample>,
    /// Whether the robot may be out of reach: a real robot outside a procedure.
    pub may_be_away: bool,
    pub simulator_ended: bool,
    /// Contact of a simulated robot, metres.
    pub collision_m: Option<[f64; 2]>,
    pub time: MissionTime,
    pub deadline: Deadline,
    pub in_ticks: bool,
    /// Time of the newest tick, start of an external stage, or change of order.
    pub progress: Now,
    pub has_ticked: bool,
    /// Input that a stage cannot use, with the remedy.
    pub complaint: Option<String>,
    pub reason: HoldReason,
    pub held: Vec<&'static str>,
    /// Stages left to another program to start.
    pub not_started: Vec<&'static str>,
    /// Own stages that have yet to become ready.
    pub not_ready: Vec<&'static str>,
    pub robot: &'a RobotName,
    pub address: &'a Address,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Arrival {
    pub distance_m: f64,
    /// See [`crate::observer::Record::beside`].
    pub beside: Option<DVec2>,
    pub since: Now,
}

/// Returns the ending of an arrival. Beside a hazard, outside the tolerance, the target is
/// unreachable.
pub(crate) fn arrived(distance_m: f64, beside: Option<DVec2>) -> Ending {
    let reason = format!("{distance_m:.2} m from the target");
    let Some(place) = beside else {
        return Ending::asked_for(Outcome::Reached, reason);
    };
    Ending::failed(
        Outcome::Unreachable,
        format!(
            "{reason}, at {place:.2}: the nearest point that a hazard allows, outside arrival_tolerance_m"
        ),
    )
}

pub(crate) fn touched([x, y]: [f64; 2]) -> Ending {
    Ending::failed(Outcome::Collision, format!("touched something near ({x:.2}, {y:.2})"))
}

/// Operators' stops do not count.
#[derive(Clone, Copy)]
pub(crate) struct Deadline {
    pub began_s: f64,
    pub timeout_s: f64,
    pub stopped_s: f64,
}

impl Deadline {
    pub(crate) const fn at_s(self) -> f64 {
        self.began_s + self.timeout_s + self.stopped_s
    }

    pub(crate) fn timed_out(self) -> Ending {
        let Self { timeout_s, stopped_s, .. } = self;
        let mut reason = format!("target not reached within {timeout_s} s");
        if stopped_s > 0.0 {
            reason += &format!(", {stopped_s:.0} s of operator stops excluded");
        }
        Ending::failed(Outcome::Timeout, reason)
    }
}

impl Snapshot<'_> {
    /// Applies the rules in order; the first match decides.
    pub(crate) fn ending(&self, now: Now) -> Option<Ending> {
        self.simulator_ended()
            .or_else(|| self.arrived(now))
            .or_else(|| self.ended_by_failsafe())
            .or_else(|| self.collision_m.map(touched))
            .or_else(|| self.overran())
            .or_else(|| self.stuck(now))
    }

    fn simulator_ended(&self) -> Option<Ending> {
        self.simulator_ended
            .then(|| Ending::failed(Outcome::Aborted, "the simulated robot ended; see x80-sim.log"))
    }

    /// Accepts an arrival once the encoders report rest. In lockstep no command follows, so it
    /// counts at once.
    fn arrived(&self, now: Now) -> Option<Ending> {
        const { assert!(RESTS_WITHIN.as_millis() < NO_PROGRESS.as_millis()) };
        let Arrival { distance_m, beside, since } = self.arrival?;
        let at_rest = self.link.is_some_and(|link| link.at_rest == 1);
        if self.in_ticks || at_rest {
            return Some(arrived(distance_m, beside));
        }
        let arrived = format!("arrived {distance_m:.2} m from the target");
        (now.saturating_sub(since) >= RESTS_WITHIN).then(|| {
            Ending::failed(Outcome::Aborted, format!("{arrived}, but was not seen at rest"))
        })
    }

    fn ended_by_failsafe(&self) -> Option<Ending> {
        let link = self.link.filter(|link| link.action() == Action::End)?;
        let rule = failsafe::rule(link.cause())?;
        let name = rule.cause.name();
        Some(Ending {
            cause: Some(name),
            ..Ending::failed(Outcome::Aborted, format!("{name}: {}", rule.when))
        })
    }

    fn overran(&self) -> Option<Ending> {
        let late = self.time.seconds() >= self.deadline.at_s();
        late.then(|| {
            let mut ending = self.deadline.timed_out();
            if let Some(complaint) = &self.complaint {
                ending.reason += &format!("; {complaint}");
            }
            ending
        })
    }

    fn robot_answers(&self) -> bool {
        self.link.is_some_and(|link| link.connected == 1)
    }

    fn stuck(&self, now: Now) -> Option<Ending> {
        let may_wait = match self.reason {
            HoldReason::None => {
                self.may_be_away && !(self.robot_answers() && self.complaint.is_some())
            }
            HoldReason::Operator | HoldReason::Waiting | HoldReason::Lost => true,
            // In wall-clock time the mission's timeout ends such a mission.
            HoldReason::StageHeld => !self.in_ticks,
            HoldReason::Starting | HoldReason::Ending => false,
        };
        if may_wait || now.saturating_sub(self.progress) < NO_PROGRESS {
            return None;
        }
        let reason = if !self.not_started.is_empty() {
            let (robot, stages) = (self.robot, self.not_started.join(", "));
            format!("not running: {stages}; start each with `firsthand stage NAME --robot {robot}`")
        } else if !self.held.is_empty() {
            let (held, file) = (self.held.join(", "), records::DEATHS);
            let why = self.complaint.as_ref().map_or(String::new(), |why| format!(" ({why})"));
            format!("{held} died repeatedly{why} and is held; see {file} in the run directory")
        } else if let Some(complaint) = &self.complaint {
            complaint.clone()
        } else if !self.has_ticked && !self.robot_answers() {
            let address = self.address;
            format!("no robot answers at {address}: switch the robot on, or correct robot.address")
        } else if !self.has_ticked && !self.not_ready.is_empty() {
            let stages = self.not_ready.join(", ");
            format!("not ready: {stages}; see the log of each in the run directory")
        } else if !self.has_ticked {
            "the robot answers, but no tick begins: its wheel counts or a sensor of its mission may be missing; see link.log"
                .to_owned()
        } else {
            "the pipeline makes no progress; see the stages' logs".to_owned()
        };
        Some(Ending::failed(Outcome::Aborted, reason))
    }
}

#[derive(Default)]
pub(crate) struct StopClock {
    /// Time of the last call, if stopped then.
    stopped_at: Option<MissionTime>,
}

impl StopClock {
    /// Returns the seconds of stop since the last call; `stopped` is the state at `now`.
    pub(crate) fn passed_s(&mut self, stopped: bool, now: MissionTime) -> f64 {
        let before = std::mem::replace(&mut self.stopped_at, stopped.then_some(now));
        before.map_or(0.0, |before| now.since(before).as_secs_f64())
    }
}

pub(crate) struct TickProgress {
    /// Newest tick, and number of external stages to be started.
    seen: (Option<u64>, usize),
    since: Now,
}

impl TickProgress {
    pub(crate) const fn new(now: Now) -> Self {
        Self { seen: (None, 0), since: now }
    }

    pub(crate) fn update(&mut self, seen: (Option<u64>, usize), now: Now) -> Now {
        if seen != self.seen {
            (self.seen, self.since) = (seen, now);
        }
        self.since
    }
}

#[cfg(test)]
mod tests;
