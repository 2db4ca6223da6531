//! Latency of five hops between idle processes: the cost of the bus alone.
//!
//! Topics, payloads, wakeups and waits are those of a tick: wheels, pose, grid, guidance, command.
//! The rest of a tick's time is the stages' work.

use std::time::{Duration, Instant};

use common::{
    bus::{Author, Bus, Payload, Stamped, Topic},
    clock::{MissionTime, monotonic_ns},
    domain::RobotName,
    latency::Histogram,
    samples::WheelSample,
    signals::{SIGTERM, Signals},
    start::become_child,
    topics,
    waiter::Waiter,
};
use processes::{
    domain::DomainLock,
    process::{Process, firsthand},
};

use crate::error::{OrCannot as _, Result};

/// Time after which a sample is lost: a trip takes microseconds, the forwarders' start some
/// milliseconds.
const LOST: Duration = Duration::from_secs(5);
const LOST_SAMPLE: &str = "no sample came back within 5 s; reduce the load of the machine";

/// Cells of the smallest map. Forwarders never read it.
const CELLS: usize = 64;
const PLACES: [&str; 4] = ["dead-reckoning", "mapper", "planner", "controller"];
/// Interval of samples to forwarders that may not have started yet.
const SEND_AGAIN: Duration = Duration::from_millis(20);
/// Trips before the measurement, which map all memory.
const WARM_UP: u64 = 200;

/// Sends a sample around the forwarders every `period`, or back to back.
pub fn measure(robot: &RobotName, trips: u64, period: Option<Duration>) -> Result<Histogram> {
    let lock = DomainLock::acquire(robot.domain(), CELLS)?;
    let bus = lock.bus().ok_or(LOST_SAMPLE)?;
    let mut start = bus.writer(&topics::WHEELS, 1)?;
    let mut end = bus.reader(&topics::COMMAND)?;
    let mut waiter = Waiter::default();
    waiter.on(bus.wakeup(&topics::COMMAND)?);
    let (own, name) = (std::process::id().to_string(), robot.to_string());
    let mut forwarders = Vec::new();
    for place in PLACES {
        let beside =
            ["bench", "tick", "--forwarder", place, "--supervisor", &own, "--robot", &name];
        let forwarder = Process::spawn(firsthand(&beside)).or_cannot("start a forwarder")?;
        if let Some(writers) = bus.writers() {
            let author = Author { process: forwarder.id(), generation: 1 };
            writers.name([(place.to_owned(), author)]);
        }
        forwarders.push(forwarder);
    }
    let mut latencies = Histogram::default();
    for trip in 0..WARM_UP + trips {
        let began = Instant::now();
        let mut sent_ns = 0;
        let mut arrived = false;
        while !arrived {
            if began.elapsed() >= LOST {
                return Err(LOST_SAMPLE.into());
            }
            // A forwarder may be missing during the warm-up, so the sample is sent again.
            if sent_ns == 0 || trip < WARM_UP {
                sent_ns = monotonic_ns();
                start.publish(trip, MissionTime::default(), WheelSample::default())?;
            }
            waiter.wait(if trip < WARM_UP { SEND_AGAIN } else { LOST })?;
            while let Some(command) = end.next_sample()? {
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

pub fn run_forwarder(robot: &RobotName, place: &str, supervisor: u32) -> Result {
    let process = (robot, place, supervisor);
    match place {
        "dead-reckoning" => forward(process, &topics::WHEELS, &topics::POSE),
        "mapper" => forward(process, &topics::POSE, &topics::GRID),
        "planner" => forward(process, &topics::GRID, &topics::GUIDANCE),
        "controller" => forward(process, &topics::GUIDANCE, &topics::COMMAND),
        _ => Err(format!("no forwarder stands for {place:?}").into()),
    }
}

fn forward<H: Stamped, E: Payload, To: Stamped + Default, ToE: Payload>(
    (robot, place, supervisor): (&RobotName, &str, u32),
    from: &Topic<H, E>,
    to: &Topic<To, ToE>,
) -> Result {
    let mut terminated = Signals::catch(&[SIGTERM]).or_cannot("catch SIGTERM")?;
    become_child(place, supervisor)?;
    let domain = robot.domain();
    let _stage_lock = domain.enter().or_cannot("enter the domain")?;
    let bus = Bus::join(&domain, place)?;
    let mut waiter = Waiter::default();
    waiter.on_readable(&terminated)?;
    waiter.on(bus.wakeup(from)?);
    let (mut from, mut to) = (bus.reader(from)?, bus.slice_writer(to, 1, CELLS)?);
    while !terminated.came() {
        while let Some(sample) = from.next_slice()? {
            let tick = sample.header().stamp().tick;
            to.publish_slice(tick, MissionTime::default(), To::default(), &[])?;
        }
        waiter.wait(LOST)?;
    }
    Ok(())
}
