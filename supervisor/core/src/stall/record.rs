//! The record of a stall: one form for the bus, the log and the run directory.

use std::{io, path::Path};

use common::samples::{PoseSample, RecoveryStep, StallCause, StallSample};
use serde::Serialize;

use super::{Recovery, Stall, StallWatch};
use crate::json_lines::append_line;

/// The file of a run's stalls, a JSON object a line.
pub(crate) const FILE_NAME: &str = "stalls.jsonl";

/// One stall, and what was done about it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct StallRecord {
    /// When it was seen.
    tick: u64,
    /// Likewise, mission time.
    time_s: f64,
    /// Where the robot believed it was, metres.
    x_m: f64,
    /// Likewise.
    y_m: f64,
    /// How it did not get on.
    cause: StallCause,
    /// What was done.
    recovery: RecoveryStep,
    /// The belief's epoch from then on.
    epoch: u64,
    /// Fresh planners so far, this one among them.
    replans: u32,
    /// Beliefs forgotten so far, this one among them.
    resets: u64,
}

impl StallRecord {
    /// Of a stall of the robot at `pose`, as `watch` has just seen it.
    pub(crate) fn new(stall: Stall, pose: &PoseSample, watch: &StallWatch) -> Self {
        Self {
            tick: pose.stamp.tick,
            time_s: pose.stamp.time().seconds(),
            x_m: pose.x_m,
            y_m: pose.y_m,
            cause: stall.cause,
            recovery: match stall.recovery {
                Recovery::Replan => RecoveryStep::Replan,
                Recovery::Forget { .. } => RecoveryStep::Forget,
                Recovery::GiveUp => RecoveryStep::GiveUp,
            },
            epoch: watch.epoch(),
            replans: watch.replans(),
            resets: watch.resets(),
        }
    }

    /// The cause in words, of the robot.
    pub(crate) const fn words(&self) -> &'static str {
        match self.cause {
            StallCause::Still => "the robot neither drives nor turns, whatever is planned",
            StallCause::Pinned => "the robot moves and does not get away, whatever is planned",
            StallCause::Buried => "the belief buries the robot in hazard, again and again",
            StallCause::CutOff => "the belief isolates the robot from the target, again and again",
        }
    }

    /// For the log.
    pub(crate) fn log(&self) {
        let Self {
            tick,
            x_m,
            y_m,
            cause,
            recovery,
            epoch,
            replans,
            resets,
            ..
        } = self;
        tracing::warn!(
            tick,
            x_m,
            y_m,
            ?cause,
            ?recovery,
            epoch,
            replans,
            resets,
            "the robot stalls"
        );
    }

    /// For the bus.
    pub(crate) fn sample(&self) -> StallSample {
        StallSample {
            x_m: self.x_m,
            y_m: self.y_m,
            epoch: self.epoch,
            replans: self.replans,
            resets: self.resets,
            cause: self.cause.into(),
            recovery: self.recovery.into(),
            ..StallSample::default()
        }
    }

    /// Append it to the run's list.
    pub(crate) fn append_to(&self, directory: &Path) -> io::Result<()> {
        append_line(&directory.join(FILE_NAME), self)
    }
}
