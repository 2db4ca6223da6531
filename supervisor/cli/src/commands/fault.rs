//! `firsthand fault STAGE FAULT`: break something in a running stage on purpose.

use std::{fmt::Write as _, process::ExitCode, time::Instant};

use clap::Args;
use common::{
    bus::Bus,
    clock::MissionTime,
    domain::{Domain, RobotName},
    faults,
    roster::Roster,
    samples::{FaultAnswer, FaultSample, name, name_str},
    topics,
    waiter::Waiter,
};
use thiserror::Error;

use super::{
    Failure,
    operate::{PATIENCE, find, known, new_id},
};

/// Break something in a running stage on purpose, to see the rest cope.
#[derive(Debug, Args)]
#[command(after_help = table())]
pub(crate) struct Arguments {
    /// The stage (`firsthand stages`).
    stage: String,
    /// What to break in it; see below.
    fault: String,
    /// Name of the robot.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Do it although the robot is a real one. It may drive where it should not: clear its surroundings first.
    #[arg(long)]
    break_a_real_robot: bool,
}

/// Why nothing was broken.
#[derive(Debug, Error)]
pub(crate) enum FaultError {
    #[error("{stage} has no fault called {fault:?}; it has {known}")]
    NoSuchFault {
        stage: &'static str,
        fault: String,
        known: String,
    },
    #[error(
        "robot {0} is a real one, and what is broken in it may drive it into things; if that is meant, clear its \
         surroundings and add --break-a-real-robot"
    )]
    RealRobot(RobotName),
    #[error("{0} has nothing to break yet; try again once the robot drives (`firsthand status`)")]
    NotYet(&'static str),
    #[error("{0} does not answer; is it running? (`firsthand status`)")]
    NoAnswer(&'static str),
}

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let stage = known(&arguments.stage)?;
    let Some(fault) = faults::find(stage, &arguments.fault) else {
        let known: Vec<_> = faults::of(stage).map(|fault| fault.name).collect();
        let error = FaultError::NoSuchFault {
            stage,
            fault: arguments.fault.clone(),
            known: known.join(", "),
        };
        return Err(error.into());
    };
    let robot = &arguments.robot;
    let bus = Bus::join(&Domain::of(robot.clone()), "operator")?;
    let simulated = find(&mut Roster::open(&bus)?, robot, |header, _| {
        Some(header.simulated == 1)
    })?;
    let refused = || FaultError::RealRobot(robot.clone());
    if !simulated && !arguments.break_a_real_robot {
        return Err(refused().into());
    }
    let request = FaultSample {
        id: new_id(),
        stage: name(stage),
        kind: fault.kind.into(),
        although_real: arguments.break_a_real_robot.into(),
        ..FaultSample::default()
    };
    match ask(&bus, stage, request)? {
        Some(FaultAnswer::Taken) => Ok(ExitCode::SUCCESS),
        Some(FaultAnswer::Refused) => Err(refused().into()),
        Some(FaultAnswer::Impossible) => Err(FaultError::NotYet(stage).into()),
        Some(FaultAnswer::None) | None => Err(FaultError::NoAnswer(stage).into()),
    }
}

/// Ask the stage itself; its heartbeat says how it answered. None if it did not.
fn ask(bus: &Bus, stage: &str, request: FaultSample) -> Result<Option<FaultAnswer>, Failure> {
    let mut health = bus.reader(&topics::HEALTH)?;
    let mut waiter = Waiter::default();
    waiter.on(bus.wakeup(&topics::HEALTH)?);
    // The writer must stay until the answer is there: samples that were not read yet go with it.
    let mut requests = bus.writer(&topics::FAULTS, 1)?;
    requests.publish(0, MissionTime::default(), request)?;
    let began = Instant::now();
    loop {
        while let Some(beat) = health.take()? {
            if name_str(&beat.stage) == stage && beat.last_fault == request.id {
                return Ok(Some(FaultAnswer::from_byte(beat.fault_answer)));
            }
        }
        let left = PATIENCE.saturating_sub(began.elapsed());
        if left.is_zero() {
            return Ok(None);
        }
        waiter.wait(left)?;
    }
}

/// The faults, for the help text.
fn table() -> String {
    let mut text = String::from("Faults:\n");
    for fault in &faults::TABLE {
        let stage = fault.stage.unwrap_or("any");
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "  {stage:<8} {:<14} {}; until: {}",
            fault.name, fault.meaning, fault.ends
        );
    }
    text
}
