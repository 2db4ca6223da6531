use std::{net::SocketAddr, path::PathBuf};

use clap::{Args, ValueEnum};
use common::{
    clock::Pace,
    domain::{Domain, RobotName},
    signals::{SIGINT, SIGTERM, Signals},
    start::become_child,
};
use x80_sim::{SimError, SimOptions};

use console::{
    failure::{Failure, Refused, Result},
    missions,
};

/// Simulate an X80 in a mission's world.
///
/// `run` and other software for the X80 can drive it.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Shipped mission or mission file.
    mission: String,
    /// Address to listen on; port 0 takes a free port.
    #[arg(long, default_value = "127.0.0.1:0")]
    listen: SocketAddr,
    /// Transport: datagrams, one connection, or a pseudo-terminal as serial port.
    #[arg(long, value_enum, default_value_t)]
    transport: Transport,
    /// Speed of mission time: `max`, or R times wall-clock time.
    ///
    /// With `max`, each tick waits for a command of the controlling program.
    #[arg(long, default_value = "1")]
    pace: Pace,
    /// Seed of the simulation, instead of the mission's.
    #[arg(long)]
    seed: Option<u64>,
    /// Set a key of the mission; may be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Checkpoint file, from which the simulated robot continues if present.
    #[arg(long, value_name = "FILE")]
    keep: Option<PathBuf>,
    /// Write the ground truth to standard output as JSON lines.
    #[arg(long)]
    ground_truth: bool,
    /// Name by which other robots in the same world find this robot.
    #[arg(long, default_value_t)]
    robot: RobotName,
    /// End when this parent process ends.
    #[arg(long, hide = true)]
    supervisor: Option<u32>,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Transport {
    #[default]
    Udp,
    Tcp,
    Pty,
}

impl From<Transport> for x80_sim::Transport {
    fn from(transport: Transport) -> Self {
        match transport {
            Transport::Udp => Self::Udp,
            Transport::Tcp => Self::Tcp,
            Transport::Pty => Self::Pty,
        }
    }
}

pub fn main(arguments: &Arguments) -> Result {
    let mut mission = missions::load(&arguments.mission, &arguments.set)?;
    if let Some(seed) = arguments.seed {
        mission.seed = seed;
    }
    let signals = Signals::catch(&[SIGINT, SIGTERM])?;
    if let Some(supervisor) = arguments.supervisor {
        become_child("x80-sim", supervisor)?;
    }
    let other = mission.simulation.other.as_deref().map(str::parse::<RobotName>).transpose()?;
    let own = &arguments.robot;
    let meeting = other.map(|other| [own.clone(), other].map(|it| Domain::of(it).place_socket()));
    let options = SimOptions {
        meeting,
        mission,
        pace: arguments.pace,
        listen: arguments.listen,
        transport: arguments.transport.into(),
        // The robot of a run obeys the link of that run.
        own_user_only: arguments.supervisor.is_some(),
        keep: arguments.keep.clone(),
        ground_truth: arguments.ground_truth.then(|| Box::new(std::io::stdout()) as Box<_>),
    };
    x80_sim::run(options, &signals).map_err(|error| match error {
        SimError::Bind { .. } => Failure::from(Refused::new("address-in-use", error.to_string())),
        error => error.into(),
    })
}
