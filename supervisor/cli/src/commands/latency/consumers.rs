//! Consumers of a mission whose ticks are measured: each a process that reads every sample of grid and field.

use common::{
    domain::{Domain, RobotName},
    follower::{Event, Follower},
    signals::{SIGTERM, Signals},
    start::become_child,
    topics,
};
use supervisor::process::{Process, firsthand};

use crate::commands::{Failure, stream::LOOK_EVERY};

/// Start so many for `robot`. They end when they are dropped.
pub(super) fn start(robot: &RobotName, number: u32) -> Result<Vec<Process>, Failure> {
    let own = std::process::id().to_string();
    let consumer = |_| {
        let mut command = firsthand(&["latency", "--consumer", "--supervisor", &own]);
        command.args(["--robot", &robot.to_string()]);
        Ok(Process::spawn(command)?)
    };
    (0..number).map(consumer).collect()
}

/// Be one, until asked to stop.
pub(super) fn run(robot: &RobotName, supervisor: u32) -> Result<(), Failure> {
    let mut terminated = Signals::catch(&[SIGTERM])?;
    become_child("consumer", supervisor)?;
    let domain = Domain::of(robot.clone());
    let mut follower = Follower::new(domain, "consumer", &topics::GRID, |bus| {
        Ok((
            bus.slice_reader(&topics::GRID)?,
            bus.slice_reader(&topics::FIELD)?,
        ))
    });
    while !terminated.came() {
        if let Event::Samples((grids, fields)) = follower.wait(LOOK_EVERY)? {
            while grids.take()?.is_some() {}
            while fields.take()?.is_some() {}
        }
    }
    Ok(())
}
