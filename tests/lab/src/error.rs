//! Failures of benches.

use std::{io, time::Duration};

pub use console::failure::Failure;
use summary::Summary;

/// The time after which a sample is lost: a trip takes microseconds, the forwarders' start some milliseconds.
pub const LOST: Duration = Duration::from_secs(5);
pub const LOST_SAMPLE: &str = "no sample came back within 5 s; is the machine overloaded?";
pub const NOTHING: &str = "nothing was measured; does the mission drive at all?";

/// The system refused to do `action`.
pub fn system(action: &'static str) -> impl FnOnce(io::Error) -> Failure {
    move |source| format!("cannot {action}: {source}").into()
}

/// The summary that `firsthand run --json` printed; without one `said` is the error.
pub fn summary(stdout: &[u8], said: &[u8]) -> Result<Summary, Failure> {
    let said = String::from_utf8_lossy(said);
    serde_json::from_slice(stdout)
        .map_err(|_| format!("a mission gave no summary: {}", said.trim()).into())
}
