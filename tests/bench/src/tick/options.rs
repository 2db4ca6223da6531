//! The command line of `firsthand bench tick`.

use clap::Args;
use common::{clock::Pace, domain::RobotName};

use super::regime::parse_hz;

/// Measure a tick, datagram in to datagram out, and five bare hops between processes.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The mission whose ticks are measured.
    #[arg(default_value = "open-room")]
    pub mission: String,
    /// The pace of the mission, at which the bare hops follow each other too.
    #[arg(long, default_value = "max")]
    pub pace: Pace,
    /// Ticks a second instead of the pace; a robot has 7.
    #[arg(long, value_name = "HZ", value_parser = parse_hz, conflicts_with = "pace")]
    pub rate: Option<f64>,
    /// Number of rounds, each of which measures both, because a shared machine has good and bad moments.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub rounds: u32,
    /// Measure also the parts of a tick, in microseconds by stage and item.
    #[arg(long)]
    pub budget: bool,
    /// Set a key of the mission, as often as needed.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Record the missions meanwhile, as `run` does.
    #[arg(long)]
    pub record: bool,
    /// Number of processes that read grid and field of the missions meanwhile.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=16))]
    pub consumers: u32,
    /// Be a consumer of this robot.
    #[arg(long, hide = true, requires = "supervisor", requires = "robot")]
    pub consumer: bool,
    /// One line of JSON.
    #[arg(long)]
    pub json: bool,
    /// Name of the robot, which also names its shared memory.
    #[arg(long)]
    pub robot: Option<RobotName>,
    /// Be the forwarder that stands for this stage.
    #[arg(long, hide = true, requires = "supervisor", requires = "robot")]
    pub forwarder: Option<String>,
    /// The parent process: this one stops when it ends.
    #[arg(long, hide = true)]
    pub supervisor: Option<u32>,
}
