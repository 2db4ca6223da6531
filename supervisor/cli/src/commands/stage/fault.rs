use std::time::Instant;

use clap::Args;
use common::{
    bus::Bus,
    clock::MissionTime,
    domain::RobotName,
    faults,
    roster::{self, Roster},
    samples::{FaultAnswer, FaultSample, name, name_str},
    topics,
    waiter::Waiter,
};

use mission_control::operator::{PATIENCE, find, new_id, refuse_mirror};

use console::{
    failure::{Refused, Result, refuse},
    operator::known,
};

/// Inject a fault into a running stage.
#[derive(Debug, Args)]
#[command(after_help = table())]
pub struct Arguments {
    /// Stage (`firsthand stage list`).
    stage: String,
    /// Fault; see below.
    fault: String,
    /// Name of the robot.
    #[arg(long, default_value_t)]
    robot: RobotName,
    /// Allow the fault on a real robot, which may then drive anywhere.
    ///
    /// Clear its surroundings first.
    #[arg(long)]
    break_a_real_robot: bool,
}

fn real_robot(robot: &RobotName) -> Refused {
    Refused::new(
        "real-robot",
        format!(
            "robot {robot} is real, and a fault may drive it into obstacles; to inject it anyway, clear its surroundings and add --break-a-real-robot"
        ),
    )
}

pub fn main(arguments: &Arguments) -> Result {
    let stage = known(&arguments.stage)?;
    let Some(fault) = faults::find(stage, &arguments.fault) else {
        let known: Vec<_> = faults::of(stage).map(|fault| fault.name).collect();
        let (fault, known) = (&arguments.fault, known.join(", "));
        return refuse(
            "unknown-fault",
            format!("{stage} has no fault called {fault:?}; it has {known}"),
        );
    };
    let robot = &arguments.robot;
    let domain = robot.domain();
    refuse_mirror(&domain)?;
    let bus = roster::join(&domain, "operator")?;
    let simulated = find(&mut Roster::open(&bus)?, robot, |header, _| Some(header.simulated == 1))?;
    if !simulated && !arguments.break_a_real_robot {
        return Err(real_robot(robot).into());
    }
    let request = FaultSample {
        id: new_id(),
        stage: name(stage),
        kind: fault.kind.into(),
        although_real: arguments.break_a_real_robot.into(),
        ..FaultSample::default()
    };
    let refused = match request_fault(&bus, stage, request)? {
        Some(FaultAnswer::Taken) => return Ok(()),
        Some(FaultAnswer::Refused) => real_robot(robot),
        Some(FaultAnswer::Impossible) => Refused::new(
            "not-yet",
            format!(
                "{stage} has nothing to break yet; retry when the robot drives (`firsthand status`)"
            ),
        ),
        Some(FaultAnswer::None) | None => Refused::new(
            "no-answer",
            format!("{stage} does not answer; is it running? (`firsthand status`)"),
        ),
    };
    Err(refused.into())
}

fn request_fault(bus: &Bus, stage: &str, request: FaultSample) -> Result<Option<FaultAnswer>> {
    let mut health = bus.reader(&topics::HEALTH)?;
    let mut waiter = Waiter::default();
    waiter.on(bus.wakeup(&topics::HEALTH)?);
    // The writer must outlive the answer: its end discards an unread request.
    let mut requests = bus.writer(&topics::FAULTS, 1)?;
    requests.publish(0, MissionTime::default(), request)?;
    let began = Instant::now();
    loop {
        while let Some(beat) = health.next_sample()? {
            if name_str(&beat.stage) == stage && beat.last_fault == request.id {
                return Ok(Some(beat.fault_answer()));
            }
        }
        let left = PATIENCE.saturating_sub(began.elapsed());
        if left.is_zero() {
            return Ok(None);
        }
        waiter.wait(left)?;
    }
}

fn table() -> String {
    let mut text = String::from("Faults:\n");
    for fault in &faults::TABLE {
        let stage = fault.stage.unwrap_or("any");
        text +=
            &format!("  {stage:<8} {:<14} {}; until: {}\n", fault.name, fault.meaning, fault.ends);
    }
    text
}
