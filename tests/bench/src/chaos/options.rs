//! What is attacked, and how.

use std::path::PathBuf;

use crate::chaos::consumer::Consumer;
use common::{clock::Pace, domain::RobotName, mission::Mission};

/// What is attacked, and how.
pub struct Options {
    /// The mission, by name or file, as given to `firsthand run`.
    pub mission: String,
    /// The same mission, with its overrides.
    pub loaded: Mission,
    /// The overrides, `KEY=VALUE`.
    pub set: Vec<String>,
    /// The robot that is attacked.
    pub robot: RobotName,
    /// The missions' pace, on the wall clock.
    pub pace: Pace,
    /// Signals to send in all.
    pub kills: u32,
    /// Seed of the schedule; the missions' seeds count up from it.
    pub seed: u64,
    /// Whether some signals hit a successor in its first milliseconds.
    pub startup: bool,
    /// Whether the supervisor is hit too; its run is resumed then. The robot is a process of its own in that case,
    /// as a real one is.
    pub supervisor: bool,
    /// Whether some hits freeze supervisor and stages together, as a machine does that stands still for a moment.
    pub freeze_all: bool,
    /// Whether missions are recorded, and every generation of every stage replayed.
    pub replay: bool,
    /// The consumers that are hit, too.
    pub consumers: Vec<Consumer>,
    /// Whether nothing else is hit.
    pub only_consumers: bool,
    /// Directory of the table of signals.
    pub out: Option<PathBuf>,
    /// Where the run directories go; emptied mission by mission.
    pub directory: PathBuf,
}

impl Options {
    /// Whether the run itself records.
    pub(crate) fn records(&self) -> bool {
        self.replay || self.consumers.contains(&Consumer::RunRecorder)
    }
}
