//! The mission that is attacked, and the kinds of attack.

use std::path::PathBuf;

use crate::chaos::consumer::Consumer;
use common::{clock::Pace, domain::RobotName, mission::Mission};

/// The mission that is attacked, and the kinds of attack.
pub struct Options {
    /// The mission, by name or file, as given to `firsthand run`.
    pub mission: String,
    /// The loaded mission, with its overrides.
    pub loaded: Mission,
    /// The overrides, `KEY=VALUE`.
    pub set: Vec<String>,
    pub robot: RobotName,
    /// The missions' pace, on the wall clock.
    pub pace: Pace,
    /// Total number of signals.
    pub kills: u32,
    /// Seed of the schedule; the missions' seeds count up from it.
    pub seed: u64,
    /// Whether some signals hit a successor in its first milliseconds.
    pub startup: bool,
    /// Whether the supervisor is hit too; its run is resumed then. The robot is then a process of its own, like a real one.
    pub supervisor: bool,
    /// Whether some hits freeze supervisor and stages together, as if the machine stood still for a moment.
    pub freeze_all: bool,
    /// Whether missions are recorded, and every generation of every stage replayed.
    pub replay: bool,
    /// Consumers that are hit too.
    pub consumers: Vec<Consumer>,
    /// Whether nothing else is hit.
    pub only_consumers: bool,
    /// Directory of the table of signals.
    pub out: Option<PathBuf>,
    /// Parent of the run directories. It is emptied after each mission.
    pub directory: PathBuf,
}

impl Options {
    pub(crate) fn records(&self) -> bool {
        self.replay || self.consumers.contains(&Consumer::RunRecorder)
    }
}
