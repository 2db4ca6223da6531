//! The command line of `firsthand bench tick`.

use clap::Args;
use common::{clock::Pace, domain::RobotName};

use super::regime::parse_hz;

/// Measure a tick, datagram in to datagram out, and five bare hops between processes, back to back and at the robot's rate.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The mission whose ticks are measured.
    #[arg(default_value = "obstacle-course")]
    pub mission: String,
    /// Measure only at this pace of the mission, at which the bare hops follow each other too.
    #[arg(long)]
    pub pace: Option<Pace>,
    /// Measure only at so many ticks a second.
    #[arg(long, value_name = "HZ", value_parser = parse_hz, conflicts_with = "pace")]
    pub rate: Option<f64>,
    /// Number of rounds, each of which measures both, because a shared machine has good and bad moments.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub rounds: u32,
    /// Set a key of the mission, as often as needed.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Do not record the missions meanwhile; `run` does.
    #[arg(long)]
    pub no_record: bool,
    /// Number of processes that read grid and field of the missions meanwhile.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(0..=16))]
    pub consumers: u32,
    /// Number of processes of ordinary priority that compute meanwhile, without end.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=1000))]
    pub busy: u32,
    /// One line of JSON.
    #[arg(long)]
    pub json: bool,
    /// Name of the robot, which also names its shared memory.
    #[arg(long)]
    pub robot: Option<RobotName>,
    /// Be one of the processes beside a measurement: busy, a consumer, or the forwarder that stands for this stage.
    #[arg(long, hide = true, requires = "supervisor", requires = "robot")]
    pub role: Option<String>,
    /// The parent process: this one stops when it ends.
    #[arg(long, hide = true)]
    pub supervisor: Option<u32>,
}
