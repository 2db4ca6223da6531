//! Consumers of a mission whose ticks are measured: each a process that reads every sample of grid and field.

use std::time::Duration;

use common::{
    domain::{Domain, RobotName},
    follower::{Event, Follower},
    signals::{SIGTERM, Signals},
    start::become_child,
    topics,
};
use processes::process::{Process, firsthand};

use crate::error::{OrCannot as _, Result};

/// How often a consumer looks whether it is asked to stop.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// Start `number` consumers of `robot`. They end when they are dropped.
pub fn start(robot: &RobotName, number: u32) -> Result<Vec<Process>> {
    let own = std::process::id().to_string();
    let consumer = |_| {
        let mut command = firsthand(&["bench", "tick", "--consumer", "--supervisor", &own]);
        command.args(["--robot", &robot.to_string()]);
        Process::spawn(command).or_cannot("start a consumer")
    };
    (0..number).map(consumer).collect()
}

pub fn run(robot: &RobotName, supervisor: u32) -> Result {
    let mut terminated = Signals::catch(&[SIGTERM]).or_cannot("catch SIGTERM")?;
    become_child("consumer", supervisor)?;
    let domain = Domain::of(robot.clone());
    let mut follower = Follower::new(domain, "consumer", &topics::GRID, |bus| {
        Ok((bus.reader(&topics::GRID)?, bus.reader(&topics::FIELD)?))
    });
    while !terminated.came() {
        if let Event::Samples((grids, fields)) = follower.wait(LOOK_EVERY)? {
            while grids.next_slice()?.is_some() {}
            while fields.next_slice()?.is_some() {}
        }
    }
    Ok(())
}
