//! A mission whose ticks are measured.

use std::{
    process::{Output, Stdio},
    sync::mpsc::{RecvTimeoutError, channel},
    thread,
    time::Duration,
};

use common::{clock::Pace, domain::RobotName};
use summary::Quantiles;

use super::{
    consumers,
    options::Arguments,
    process_set::{ProcessSet, Used},
};
use crate::{
    error::{self, OrCannot as _, Result},
    robot,
};

#[derive(Debug)]
pub struct Ticks {
    pub count: u64,
    pub p50_us: f64,
    pub p99_us: f64,
    pub max_us: f64,
    /// Resources of its processes; none for a short mission.
    pub used: Option<Used>,
}

const LOOK_EVERY: Duration = Duration::from_secs(1);

pub fn measure(arguments: &Arguments, robot: &RobotName, pace: Pace) -> Result<Ticks> {
    let directory = tempfile::Builder::new().prefix("firsthand-latency-").tempdir();
    let directory = directory.or_cannot("make a directory for the mission")?;
    let mut command = robot::mission("run", &arguments.mission, robot, &arguments.set);
    command.args(["--pace", &pace.to_string(), "--out"]).arg(directory.path());
    if arguments.no_record {
        command.arg("--no-record");
    }
    // The consumers wait for the bus, and follow it. They do not belong to the mission's processes.
    let _consumers = consumers::start(robot, arguments.consumers)?;
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
    ticks(&output, processes.used())
}

fn ticks(output: &Output, used: Option<Used>) -> Result<Ticks> {
    let summary = error::summary(&output.stdout, &output.stderr)?;
    let Quantiles { p50: Some(p50_us), p99: Some(p99_us), max: Some(max_us) } =
        summary.tick_latency_us
    else {
        return Err(error::NOTHING.into());
    };
    Ok(Ticks { count: summary.ticks, p50_us, p99_us, max_us, used })
}
