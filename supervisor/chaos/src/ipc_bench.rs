//! The latency of five hops between processes that do no work: what the bus alone costs.
//!
//! The same topics, payloads, wakeups and waits as a tick's, each forwarded at once: wheels, pose, grid, guidance,
//! command. What a tick takes beyond that is the stages' work.

use std::time::{Duration, Instant};

use common::{
    bus::{Bus, BusError},
    clock::{MissionTime, monotonic_ns},
    domain::{Domain, RobotName},
    latency::Histogram,
    samples::{CommandSample, GridHeader, GuidanceSample, PoseSample, WheelSample},
    signals::{SIGTERM, Signals},
    start::{StageError, become_child},
    topics,
    waiter::Waiter,
};
use thiserror::Error;

use supervisor::{
    DomainError,
    domain::DomainLock,
    process::{Process, firsthand},
};

/// Cells of the smallest map, which no forwarder looks at.
const CELLS: usize = 64;
/// The forwarders, by the stage that each stands for.
pub const PLACES: [&str; 4] = ["dead-reckoning", "mapper", "planner", "controller"];
/// A trip takes microseconds, the forwarders' start some milliseconds; a sample that takes longer is lost.
const LOST: Duration = Duration::from_secs(5);
/// Between samples sent to forwarders that may not be up yet.
const SEND_AGAIN: Duration = Duration::from_millis(20);
/// Trips before those that count: all memory is mapped by then.
const WARM_UP: u64 = 200;

/// Why the hops could not be measured.
#[derive(Debug, Error)]
pub enum IpcBenchError {
    /// The domain.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// A forwarder's process.
    #[error("cannot start a forwarder: {0}")]
    Start(#[from] std::io::Error),
    /// A forwarder's process, from within.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// A sample went out and none came back.
    #[error("no sample came back within {LOST:?}; is the machine overloaded?")]
    Lost,
    /// No such forwarder.
    #[error("no forwarder stands for {0:?}")]
    Place(String),
}

/// Send `trips` samples around the forwarders, one every `period`, or one behind the other; those that warm up, always
/// one behind the other.
pub fn measure(
    robot: &RobotName,
    trips: u64,
    period: Option<Duration>,
) -> Result<Histogram, IpcBenchError> {
    let lock = DomainLock::acquire(Domain::of(robot.clone()), CELLS)?;
    let bus = lock.bus().ok_or(IpcBenchError::Lost)?;
    let mut start = bus.writer(&topics::WHEELS, 1)?;
    let mut end = bus.reader(&topics::COMMAND)?;
    let mut waiter = Waiter::default();
    waiter.on(bus.wakeup(&topics::COMMAND)?);
    let own = std::process::id().to_string();
    let mut forwarders = Vec::new();
    for place in PLACES {
        let arguments = ["latency", "--forwarder", place, "--supervisor", &own];
        let mut command = firsthand(&arguments);
        command.args(["--robot", &robot.to_string()]);
        forwarders.push(Process::spawn(command)?);
    }
    let mut latencies = Histogram::default();
    for trip in 0..WARM_UP + trips {
        let began = Instant::now();
        let mut sent_ns = 0;
        let mut arrived = false;
        while !arrived {
            if began.elapsed() >= LOST {
                return Err(IpcBenchError::Lost);
            }
            // While warming up a forwarder may be missing; then the sample is sent again.
            if sent_ns == 0 || trip < WARM_UP {
                sent_ns = monotonic_ns();
                start.publish(trip, MissionTime::default(), WheelSample::default())?;
            }
            waiter.wait(if trip < WARM_UP { SEND_AGAIN } else { LOST })?;
            while let Some(command) = end.take()? {
                arrived |= command.stamp.tick == trip;
            }
        }
        if trip >= WARM_UP {
            latencies.record(monotonic_ns() - sent_ns);
        }
        let pause = period.filter(|_| trip >= WARM_UP);
        if let Some(rest) = pause.and_then(|period| period.checked_sub(began.elapsed())) {
            waiter.wait(rest)?;
        }
    }
    for forwarder in &mut forwarders {
        forwarder.end(LOST);
    }
    Ok(latencies)
}

/// Be the forwarder that stands for the stage `place`.
pub fn run_forwarder(robot: &RobotName, place: &str, supervisor: u32) -> Result<(), IpcBenchError> {
    let mut terminated = Signals::catch(&[SIGTERM]).map_err(|source| StageError::System {
        action: "catch SIGTERM",
        source,
    })?;
    become_child(place, supervisor)?;
    let domain = Domain::of(robot.clone());
    let _stage_lock = domain.enter()?;
    let bus = Bus::join(&domain, place)?;
    let mut waiter = Waiter::default();
    waiter.on_readable(&terminated)?;
    let mut forward = forwarder(&bus, place, &mut waiter)?;
    while !terminated.came() {
        forward()?;
        waiter.wait(LOST)?;
    }
    Ok(())
}

/// Forwards all that came.
type Forward = Box<dyn FnMut() -> Result<(), BusError>>;

fn forwarder(bus: &Bus, place: &str, waiter: &mut Waiter) -> Result<Forward, IpcBenchError> {
    let now = MissionTime::default();
    Ok(match PLACES.iter().position(|name| *name == place) {
        Some(0) => {
            waiter.on(bus.wakeup(&topics::WHEELS)?);
            let (mut from, mut to) = (bus.reader(&topics::WHEELS)?, bus.writer(&topics::POSE, 1)?);
            Box::new(move || {
                while let Some(sample) = from.take()? {
                    to.publish(sample.stamp.tick, now, PoseSample::default())?;
                }
                Ok(())
            })
        }
        Some(1) => {
            waiter.on(bus.wakeup(&topics::POSE)?);
            let mut from = bus.reader(&topics::POSE)?;
            let mut to = bus.slice_writer(&topics::GRID, 1, CELLS)?;
            Box::new(move || {
                while let Some(sample) = from.take()? {
                    let nothing = std::iter::empty();
                    to.publish(sample.stamp.tick, now, GridHeader::default(), nothing)?;
                }
                Ok(())
            })
        }
        Some(2) => {
            waiter.on(bus.wakeup(&topics::GRID)?);
            let mut from = bus.slice_reader(&topics::GRID)?;
            let mut to = bus.writer(&topics::GUIDANCE, 1)?;
            Box::new(move || {
                while let Some(sample) = from.take()? {
                    let tick = sample.header().stamp.tick;
                    to.publish(tick, now, GuidanceSample::default())?;
                }
                Ok(())
            })
        }
        Some(_) => {
            waiter.on(bus.wakeup(&topics::GUIDANCE)?);
            let mut from = bus.reader(&topics::GUIDANCE)?;
            let mut to = bus.writer(&topics::COMMAND, 1)?;
            Box::new(move || {
                while let Some(sample) = from.take()? {
                    to.publish(sample.stamp.tick, now, CommandSample::default())?;
                }
                Ok(())
            })
        }
        None => return Err(IpcBenchError::Place(place.to_owned())),
    })
}
