//! A mission whose ticks are measured.

use std::{
    process::{Output, Stdio},
    sync::mpsc::{RecvTimeoutError, channel},
    thread,
    time::Duration,
};

use common::latency_budget;
use supervisor::process;

use super::{
    Options,
    budget::Budget,
    consumers,
    error::{TickError, system},
    process_set::{ProcessSet, Used},
};

/// One mission's ticks.
#[derive(Debug)]
pub(super) struct Ticks {
    pub(super) count: u64,
    pub(super) p50_us: f64,
    pub(super) p99_us: f64,
    pub(super) max_us: f64,
    /// Resources of its processes; none for a short mission.
    pub(super) used: Option<Used>,
}

/// Pause between measurements of its processes.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Run the mission. Its stages measure their items only for a `budget`, because measuring takes time.
pub(super) fn measure(
    options: &Options<'_>,
    budget: Option<&mut Budget>,
) -> Result<Ticks, TickError> {
    let directory = tempfile::Builder::new().prefix("firsthand-latency-").tempdir();
    let directory = directory.map_err(system("make a directory for the mission"))?;
    let pace = options.regime.pace(options.rate_hz).to_string();
    let mut command = process::firsthand(&["run", options.mission, "--json", "--pace", &pace]);
    command.args(["--robot", &options.robot.to_string(), "--out"]).arg(directory.path());
    if !options.record {
        command.arg("--no-record");
    }
    for setting in options.set {
        command.args(["--set", setting]);
    }
    if budget.is_some() {
        command.env(latency_budget::ASKED_FOR, "1");
    }
    // The consumers wait for the bus, and follow it. They do not belong to the mission's processes.
    let _consumers = consumers::start(options.robot, options.consumers)?;
    let run = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(system("start the mission"))?;
    let mut processes = ProcessSet::of(run.id());
    let (ended, end) = channel();
    let waiting = thread::spawn(move || ended.send(run.wait_with_output()));
    let output = loop {
        match end.recv_timeout(LOOK_EVERY) {
            Ok(output) => break output.map_err(system("wait for the mission"))?,
            Err(RecvTimeoutError::Timeout) => processes.look(),
            Err(RecvTimeoutError::Disconnected) => return Err(TickError::Nothing),
        }
    };
    // The thread has ended, because it has sent its result.
    let _ = waiting.join();
    let ticks = ticks(&output, processes.used())?;
    if let Some(budget) = budget {
        budget.add(directory.path())?;
    }
    Ok(ticks)
}

/// The tick latencies of the mission's summary.
fn ticks(output: &Output, used: Option<Used>) -> Result<Ticks, TickError> {
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).map_err(|_| {
        let errors = String::from_utf8_lossy(&output.stderr);
        TickError::NoSummary(errors.trim().to_owned())
    })?;
    let latency = |share| summary["tick_latency_us"][share].as_f64();
    let (Some(p50_us), Some(p99_us), Some(max_us)) =
        (latency("p50"), latency("p99"), latency("max"))
    else {
        return Err(TickError::Nothing);
    };
    Ok(Ticks { count: summary["ticks"].as_u64().unwrap_or_default(), p50_us, p99_us, max_us, used })
}
