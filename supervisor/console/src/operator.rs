//! Requests to a robot's supervisor, and signals to its processes.

use std::{fs::File, io, path::Path};

use common::{
    domain::RobotName,
    lock_holders,
    roster::{self, Roster},
    samples::{RosterEntry, name_str},
};
use mission_control::operator;
use processes::stages::{self, Stage};
use rustix::process::Signal;

use super::{
    failure::{Refused, Result},
    output::say,
};

pub fn stand(robot: &RobotName) -> Result {
    if let Some(why) = operator::stand(robot)? {
        say(format_args!("the robot is at rest, but its supervisor was not told: {why}"));
    }
    Ok(())
}

pub fn known(stage: &str) -> Result<&'static str> {
    Ok(known_stage(stage)?.name)
}

pub fn known_stage(stage: &str) -> Result<&'static Stage, Refused> {
    stages::find(stage).ok_or_else(|| Refused::new("unknown-stage", stages::unknown(stage)))
}

/// Signals the named process if it holds the robot's lock. Waits if the roster, published at 5 Hz,
/// still names an ended process.
pub fn send(robot: &RobotName, stage: &str, signal: Signal) -> Result {
    let domain = robot.domain();
    operator::refuse_mirror(&domain)?;
    // A frozen supervisor publishes nothing.
    if stage == "supervisor" {
        let pid = domain
            .supervisor()
            .map_err(|error| format!("cannot find the supervisor of robot {robot}: {error}"))?
            .ok_or_else(|| no_process(robot, stage))?;
        return Ok(signal_holder(pid, &domain.lock_file(), signal)
            .map_err(|error| cannot_signal(stage, pid, &error))?);
    }
    let stage = known(stage)?;
    let bus = roster::join(&domain, "operator")?;
    let mut roster = Roster::open(&bus)?;
    let named = |entries: &[RosterEntry]| {
        let entry = entries.iter().find(|entry| name_str(&entry.stage) == stage);
        entry.map(|entry| entry.pid)
    };
    let mut pid = operator::find(&mut roster, robot, |_, entries| named(entries))?;
    loop {
        if pid != 0 {
            match signal_holder(pid, &domain.stages_lock_file(), signal) {
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                done => return Ok(done.map_err(|error| cannot_signal(stage, pid, &error))?),
            }
        }
        let successor =
            |entries: &[RosterEntry]| named(entries).filter(|it| ![0, pid].contains(it));
        let next = roster.find(operator::PATIENCE, |_, entries| successor(entries))?;
        pid = next.ok_or_else(|| no_process(robot, stage))?;
    }
}

fn signal_holder(pid: u32, lock: &Path, signal: Signal) -> io::Result<()> {
    File::open(lock).and_then(|lock| lock_holders::signal(pid, &lock, signal))
}

fn cannot_signal(stage: &str, pid: u32, error: &io::Error) -> String {
    format!("cannot signal {stage} ({pid}): {error}")
}

fn no_process(robot: &RobotName, stage: &str) -> Refused {
    Refused::new(
        "no-process",
        format!("{stage} of robot {robot} has no process now; see `firsthand status`"),
    )
}
