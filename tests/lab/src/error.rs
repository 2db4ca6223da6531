//! Failures of the laboratory: sentences that name the input and the remedy.

use std::{fmt::Display, path::Path, time::Duration};

pub use console::failure::{Failure, Refused};
use summary::Summary;

pub type Result<T = (), E = Failure> = std::result::Result<T, E>;

/// The time after which a sample is lost: a trip takes microseconds, the forwarders' start some milliseconds.
pub const LOST: Duration = Duration::from_secs(5);
pub const LOST_SAMPLE: &str = "no sample came back within 5 s; is the machine overloaded?";
pub const NOTHING: &str = "nothing was measured; does the mission drive at all?";

/// Says which action failed, and with which file.
pub trait OrCannot<T>: Sized {
    fn or_cannot(self, action: &str) -> Result<T>;

    fn or_cannot_file(self, action: &str, file: &Path) -> Result<T> {
        self.or_cannot(&format!("{action} {}", file.display()))
    }
}

impl<T, E: Display> OrCannot<T> for Result<T, E> {
    fn or_cannot(self, action: &str) -> Result<T> {
        self.map_err(|cause| format!("cannot {action}: {cause}").into())
    }
}

/// The summary that `firsthand run --json` printed; without one `said` is the error.
pub fn summary(stdout: &[u8], said: &[u8]) -> Result<Summary> {
    let said = String::from_utf8_lossy(said);
    serde_json::from_slice(stdout)
        .map_err(|_| format!("a mission gave no summary: {}", said.trim()).into())
}
