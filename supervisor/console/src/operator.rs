//! Requests to a robot's supervisor, and signals to its processes.

use std::fs::File;

use common::{
    domain::{Domain, RobotName},
    lock_holders,
    roster::{self, Roster},
    samples::name_str,
};
use mission_control::operator;
use processes::stages::{self, Stage};
use rustix::process::Signal;

use super::{
    failure::{Failure, Refused},
    output::write_stderr,
};

/// Waits until the robot rests. Fails if it does not.
pub fn stand(robot: &RobotName) -> Result<(), Failure> {
    if let Some(why) = operator::stand(robot)? {
        write_stderr(&format!("firsthand: the robot rests; its supervisor was not told: {why}\n"));
    }
    Ok(())
}

/// Fails if the table has no such stage.
pub fn known(stage: &str) -> Result<&'static str, Failure> {
    Ok(known_stage(stage)?.name)
}

pub fn known_stage(stage: &str) -> Result<&'static Stage, Refused> {
    stages::find(stage).ok_or_else(|| Refused::new("unknown-stage", stages::unknown(stage)))
}

/// Only if that process holds the lock of its robot; else fails.
pub fn send(robot: &RobotName, stage: &str, signal: Signal) -> Result<(), Failure> {
    let domain = Domain::of(robot.clone());
    // A frozen supervisor publishes nothing.
    let (pid, lock) = if stage == "supervisor" {
        let holder = domain.supervisor();
        let holder = holder
            .map_err(|error| format!("cannot find the supervisor of robot {robot}: {error}"))?;
        (holder, domain.lock_file())
    } else {
        (pid_of(&domain, known(stage)?)?, domain.stages_lock_file())
    };
    let pid = pid.ok_or_else(|| {
        let message =
            format!("{stage} of robot {robot} has no process now; see `firsthand status`");
        Refused::new("no-process", message)
    })?;
    File::open(&lock)
        .and_then(|lock| lock_holders::signal(pid, &lock, signal))
        .map_err(|error| format!("cannot signal {stage} ({pid}): {error}"))?;
    Ok(())
}

fn pid_of(domain: &Domain, stage: &str) -> Result<Option<u32>, Failure> {
    let bus = roster::join(domain, "operator")?;
    Ok(operator::find(&mut Roster::open(&bus)?, &domain.robot, |_, entries| {
        let mut entries = entries.iter();
        let entry = entries.find(|entry| name_str(&entry.stage) == stage)?;
        Some((entry.pid != 0).then_some(entry.pid))
    })?)
}
