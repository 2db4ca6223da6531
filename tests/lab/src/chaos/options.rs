//! Attacked mission, and kinds of attack.

use std::path::PathBuf;

use clap::Args;
use common::domain::RobotName;
use simulation::RobotFault;

use super::consumers::Consumer;

/// Send random signals to random stages at random times, mission after mission, and report.
#[derive(Clone, Debug, Args)]
pub struct Arguments {
    /// A shipped mission or a mission file.
    #[arg(default_value = "obstacle-course")]
    pub mission: String,
    /// Number of signals; after the last one the mission continues to its end.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..))]
    pub kills: u32,
    /// Seed of the schedule; the missions' own seeds count up from it.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Also signal some restarted processes within their first 12 ms: about a fifth of all signals.
    #[arg(long)]
    pub include_startup: bool,
    /// Also signal the supervisor, one in twenty signals, and resume its run each time. The robot
    /// then has its own process, and mission time is wall-clock time.
    #[arg(long)]
    pub include_supervisor: bool,
    /// Kill and freeze consumers too, one in two signals: a recorder beside the run's own, `topic
    /// hz` and `logs -f`.
    #[arg(long, conflicts_with = "robot_faults")]
    pub include_consumers: bool,
    /// Kill and freeze your own consumer: a program and its arguments, without a shell. Repeatable.
    #[arg(long, value_name = "COMMAND", conflicts_with = "robot_faults")]
    pub consumer: Vec<Consumer>,
    /// Also freeze supervisor and stages together for 0.3 to 1.5 s, one in two signals, as if the
    /// machine stood still.
    #[arg(long)]
    pub freeze_all: bool,
    /// Record the missions, and replay every generation of every stage, which must be bit-equal.
    #[arg(long)]
    pub replay: bool,
    /// Set a mission key; repeatable.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Write a row per signal to DIR/signals.csv, or per robot fault to DIR/stop_times.csv.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Name of the robot and of its shared memory; first column of stop_times.csv.
    #[arg(long, default_value = "chaos")]
    pub robot: RobotName,
    /// Instead of signals, let the robot become faulty at a random moment, with each fault in turn
    /// or those named. Each mission runs in one process. The final stop-time table has the time from
    /// each fault to the last moving command and to wheels at rest.
    #[arg(
        long, value_name = "FAULT,...", num_args = 0.., require_equals = true, value_delimiter = ',',
        conflicts_with_all = ["kills", "include_startup", "include_supervisor"]
    )]
    pub robot_faults: Option<Vec<RobotFault>>,
    /// Number of missions per fault.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..), requires = "robot_faults")]
    pub missions: u32,
    /// Print one line of JSON.
    #[arg(long)]
    pub json: bool,
}
