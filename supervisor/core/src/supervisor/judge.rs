//! Whether the mission has come to its end, and which.

use std::time::{Duration, Instant};

use common::{
    clock::{MissionClock, MissionTime, monotonic_ns},
    samples::{Action, HoldReason, LinkSample, Order},
};
use x80_link::failsafe;

use super::{Supervisor, SupervisorError, error::system};
use crate::{
    death,
    outcome::{Ending, Outcome},
    stage_processes::Starter,
    stall::{
        Recovery,
        record::{self, StallRecord},
    },
};

/// On a clock of ticks nothing waits for wall-clock: a pipeline that makes no tick for so long is stuck.
const NO_PROGRESS: Duration = Duration::from_secs(15);

impl Supervisor<'_> {
    pub(super) fn judge(&mut self) -> Result<Option<Ending>, SupervisorError> {
        let record = &self.observer.record;
        if let Some(arrival) = record.arrival {
            return Ok(Some(Ending {
                outcome: Outcome::Reached,
                reason: format!("{:.2} m from the target", arrival.distance_m),
                asked_for: true,
            }));
        }
        if let Some(ending) = record.link.as_ref().and_then(ended_by_the_link) {
            return Ok(Some(ending));
        }
        let truth = self
            .simulator
            .as_ref()
            .and_then(|simulator| simulator.truth().last());
        if let Some(truth) = truth
            && truth.contacts > 0
        {
            return Ok(Some(Ending {
                outcome: Outcome::Collision,
                reason: format!("touched something near ({:.2}, {:.2})", truth.x, truth.y),
                asked_for: false,
            }));
        }
        let time = match self.clock {
            MissionClock::Ticks { .. } => record
                .pose
                .map_or(MissionTime::default(), |pose| pose.stamp.time()),
            // A robot that is away, a pose that does not come: time passes all the same.
            MissionClock::Wall { .. } => self.clock.at(0, monotonic_ns()),
        };
        if time.seconds() >= self.options.mission.timeout_s {
            return Ok(Some(Ending {
                outcome: Outcome::Timeout,
                reason: format!("not there after {} s", self.options.mission.timeout_s),
                asked_for: false,
            }));
        }
        if self.makes_no_progress() {
            let held: Vec<_> = self.stages.held().collect();
            let missing = self.stages.missing();
            let reason = if self.options.starter == Starter::Another && !missing.is_empty() {
                let (robot, missing) = (&self.options.robot, missing.join(", "));
                format!(
                    "not running: {missing}; start each with `firsthand stage NAME --robot {robot}`"
                )
            } else if !held.is_empty() {
                let (held, file) = (held.join(", "), death::FILE_NAME);
                format!("{held} died again and again and is held; see {file} in the run directory")
            } else if !self.ready && !self.robot_answers() {
                let address = &self.address;
                format!("no robot answers at {address}; is it on, is robot.address right?")
            } else {
                "the pipeline makes no progress; see the stages' logs".to_owned()
            };
            return Ok(Some(fault(&reason)));
        }
        self.watch_for_stalls()
    }

    pub(super) const fn in_ticks(&self) -> bool {
        matches!(self.clock, MissionClock::Ticks { .. })
    }

    /// On a clock of ticks, whether no tick was made for too long.
    pub(super) fn makes_no_progress(&mut self) -> bool {
        let tick = self.observer.record.newest_tick();
        if tick != self.progressed.0 {
            self.progressed = (tick, Instant::now());
        }
        // A real robot may be away for as long as it likes, and an operator may think.
        let waits = self.simulator.is_none() && self.order == Order::Drive
            || self.reason == HoldReason::Operator
            || self.reason == HoldReason::StageHeld && !self.in_ticks();
        !waits && self.progressed.1.elapsed() >= NO_PROGRESS
    }

    pub(super) fn watch_for_stalls(&mut self) -> Result<Option<Ending>, SupervisorError> {
        let record = &self.observer.record;
        let (Some(pose), Some(guidance)) = (record.pose, record.newest_guidance()) else {
            return Ok(None);
        };
        if self.order != Order::Drive || self.judged_tick == Some(pose.stamp.tick) {
            return Ok(None);
        }
        self.judged_tick = Some(pose.stamp.tick);
        let stopped = record.link.is_none_or(|link| link.stopped());
        let held = stopped || !self.stages.all_running();
        let guidance = *guidance;
        let Some(stall) = self.stall.step(&pose, &guidance, held) else {
            return Ok(None);
        };
        let record = StallRecord::new(stall, &pose, &self.stall);
        record.log();
        self.ends
            .stalls
            .publish(pose.stamp.tick, pose.stamp.time(), record.sample())?;
        let directory = &self.options.directory;
        record.append_to(directory).map_err(system(format!(
            "write {}",
            directory.join(record::FILE_NAME).display()
        )))?;
        match stall.recovery {
            Recovery::Replan => {
                self.stages.replace("planner", self.first_tick())?;
            }
            Recovery::Forget { .. } => self.restate()?,
            Recovery::GiveUp => {
                return Ok(Some(Ending {
                    outcome: Outcome::Unreachable,
                    reason: format!("target unreachable: {}", record.words()),
                    asked_for: false,
                }));
            }
        }
        Ok(None)
    }
}

/// The ending that the link's failsafe asks for, if it does.
fn ended_by_the_link(link: &LinkSample) -> Option<Ending> {
    let rule = failsafe::rule(link.cause())?;
    let words = format!("{}: {}", rule.name, rule.when);
    (link.action() == Action::End).then(|| fault(&words))
}

pub(super) fn fault(reason: &str) -> Ending {
    Ending {
        outcome: Outcome::Aborted,
        reason: reason.to_owned(),
        asked_for: false,
    }
}
