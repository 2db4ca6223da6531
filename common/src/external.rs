//! External stages: processes started by systemd or a person. Each finds the run, its place in it,
//! and the supervisor.
//!
//! A watching supervisor links its run directory into the robot's domain. A stage takes its place
//! once the roster shows it free.

use std::{
    fs::{self, File},
    os::fd::OwnedFd,
    path::PathBuf,
    time::{Duration, Instant},
};

use rustix::process::{Pid, PidfdFlags, pidfd_open};

use crate::{
    bus::Bus,
    domain::{Domain, RobotName},
    mission::Mission,
    roster::Roster,
    run::{self, Run},
    samples::{Order, name_str},
    start::{Generation, Joined, Result, StageError, enter, name_process, system},
};

/// Wait for the first roster. A starved supervisor is late.
const PATIENCE: Duration = Duration::from_secs(10);
/// Wait for a place, from the first roster on. Rosters come five times a second, and the place of
/// an ended process is free in the next.
const FREED_WITHIN: Duration = Duration::from_secs(1);

pub fn mission(robot: &RobotName) -> Result<Mission> {
    let (directory, _stage_lock) = enter_run(&robot.domain())?;
    Ok(Run::load(&directory)?.mission)
}

/// Counts as a process of `domain` until the returned file is dropped; also returns the run's
/// directory.
fn enter_run(domain: &Domain) -> Result<(PathBuf, File)> {
    let robot = &domain.robot;
    if !domain.directory().exists() {
        return Err(StageError::Other(format!(
            "robot {:?} has no supervisor here; start one with `firsthand run --watch-only`",
            robot.to_string()
        )));
    }
    // This waits while the supervisor makes the bus.
    let stage_lock = enter(domain)?;
    let directory = fs::read_link(domain.run_link()).map_err(|_| {
        StageError::Other(format!(
            "the supervisor of robot {:?} starts its stages itself; to start them yourself, use `firsthand run --watch-only`",
            robot.to_string()
        ))
    })?;
    Ok((directory, stage_lock))
}

pub(crate) fn join(stage: &'static str, robot: &RobotName) -> Result<Joined> {
    name_process(stage)?;
    let domain = robot.domain();
    let (directory, stage_lock) = enter_run(&domain)?;
    let run = Run::load(&directory)?;
    let supervisor = domain.supervisor().map_err(system("find the supervisor"))?;
    let supervisor = supervisor.ok_or_else(gone)?;
    let bus = Bus::join_as_stage(&domain, stage, supervisor)?;
    let (first_tick, supervisor) = wait_for_place(&bus, stage)?;
    let number = run::next_generation(&directory, stage)?;
    let generation = Generation { stage, directory, number, first_tick };
    Ok(Joined { generation, run, bus, supervisor: Some(supervisor), stage_lock })
}

/// Returns the stage's first tick and a descriptor of its supervisor, as [`watch`] does.
fn wait_for_place(bus: &Bus, stage: &str) -> Result<(u64, OwnedFd)> {
    let mut taken: Option<(Instant, u32)> = None;
    let place = Roster::open(bus)?.find(PATIENCE, |header, entries| {
        if header.order() == Order::Stop {
            return Some(Err(StageError::Other("the robot is being stopped".to_owned())));
        }
        let entry = entries.iter().find(|entry| name_str(&entry.stage) == stage)?;
        if entry.pid == 0 {
            let first_tick = header.stamp.tick + 1;
            return Some(watch(header.supervisor_pid).map(|supervisor| (first_tick, supervisor)));
        }
        let since = taken.map_or_else(Instant::now, |(since, _)| since);
        taken = Some((since, entry.pid));
        (since.elapsed() >= FREED_WITHIN).then(|| Err(is_taken(stage, entry.pid)))
    })?;
    // On a busy machine the supervisor may be heard too late to wait.
    place.unwrap_or_else(|| Err(taken.map_or_else(is_silent, |(_, pid)| is_taken(stage, pid))))
}

fn is_taken(stage: &str, pid: u32) -> StageError {
    let taken = format!("{stage} already runs as process {pid}; end that process first");
    StageError::Other(taken)
}

fn is_silent() -> StageError {
    let silent = "no supervisor publishes on the robot's bus; check whether it is frozen";
    StageError::Other(silent.to_owned())
}

fn gone() -> StageError {
    StageError::Other("the supervisor has ended".to_owned())
}

/// Returns a descriptor that becomes readable when the supervisor ends. It just published, so its
/// number is still its own.
fn watch(pid: u32) -> Result<OwnedFd> {
    let pid = i32::try_from(pid).ok().and_then(Pid::from_raw);
    pidfd_open(pid.ok_or_else(gone)?, PidfdFlags::empty()).map_err(|_| gone())
}
