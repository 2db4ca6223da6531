//! A mission whose ticks are measured, and its consumers: each a process that reads every sample of grid and field.

use std::{
    process::Stdio,
    sync::mpsc::{RecvTimeoutError, channel},
    thread,
    time::Duration,
};

use common::{
    clock::Pace,
    domain::{Domain, RobotName},
    follower::{Event, Follower},
    signals::{SIGTERM, Signals},
    start::become_child,
    topics,
};

use super::{
    Arguments, Times,
    process_set::{ProcessSet, Used},
};
use crate::{
    error::{self, OrCannot as _, Result},
    robot,
};

pub const CONSUMER: &str = "consumer";
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// How often a consumer looks whether it is asked to stop.
const STOPS_WITHIN: Duration = Duration::from_millis(100);

/// The times of a mission's ticks, and the resources of its processes; none for a short mission.
pub fn measure(
    arguments: &Arguments,
    robot: &RobotName,
    pace: Pace,
) -> Result<(Times, Option<Used>)> {
    let directory = tempfile::Builder::new().prefix("firsthand-latency-").tempdir();
    let directory = directory.or_cannot("make a directory for the mission")?;
    let mut command = robot::mission("run", &arguments.mission, robot, &arguments.set);
    command.args(["--pace", &pace.to_string(), "--out"]).arg(directory.path());
    if arguments.no_record {
        command.arg("--no-record");
    }
    // The consumers wait for the bus, and follow it. They do not belong to the mission's processes.
    let consumers = (0..arguments.consumers).map(|_| super::start(CONSUMER, robot));
    let _consumers = consumers.collect::<Result<Vec<_>>>()?;
    let run = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .or_cannot("start the mission")?;
    let mut processes = ProcessSet::of(run.id());
    let (ended, end) = channel();
    let waiting = thread::spawn(move || ended.send(run.wait_with_output()));
    let output = loop {
        match end.recv_timeout(LOOK_EVERY) {
            Ok(output) => break output.or_cannot("wait for the mission")?,
            Err(RecvTimeoutError::Timeout) => processes.look(),
            Err(RecvTimeoutError::Disconnected) => return Err(error::NOTHING.into()),
        }
    };
    // The thread has ended, because it has sent its result.
    let _ = waiting.join();
    let summary = error::summary(&output.stdout, &output.stderr)?;
    let times = Times::new("a mission's ticks", summary.ticks, summary.tick_latency_us)?;
    Ok((times, processes.used()))
}

/// Be a consumer of `robot` until `supervisor` ends it.
pub fn consume(robot: &RobotName, supervisor: u32) -> Result {
    let mut terminated = Signals::catch(&[SIGTERM]).or_cannot("catch SIGTERM")?;
    become_child(CONSUMER, supervisor)?;
    let domain = Domain::of(robot.clone());
    let mut follower = Follower::new(domain, CONSUMER, &topics::GRID, |bus| {
        Ok((bus.reader(&topics::GRID)?, bus.reader(&topics::FIELD)?))
    });
    while !terminated.came() {
        if let Event::Samples((grids, fields)) = follower.wait(STOPS_WITHIN)? {
            while grids.next_slice()?.is_some() {}
            while fields.next_slice()?.is_some() {}
        }
    }
    Ok(())
}
