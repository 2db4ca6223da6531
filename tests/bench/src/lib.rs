//! Benches of a whole robot, through its real processes. Only `firsthand bench` uses them; no robot contains them.
//!
//! | module | holds |
//! |---|---|
//! | [`chaos`] | signals to random processes at random times; faults of the robot |
//! | [`sources`] | simulated sources of fixes and turns |
//! | [`tick`] | the latency of a tick, compared with five bare hops on the bus |
//! | [`BenchError`] | why a bench ended early |

pub mod chaos;
mod error;
pub mod sources;
pub mod tick;

pub use error::BenchError;

use std::fs;

/// The ids of all processes of this machine.
pub(crate) fn processes() -> impl Iterator<Item = u32> {
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok())
}

/// The command line of `process`, a zero byte after each word; empty if it has ended.
pub(crate) fn command_line(process: u32) -> Vec<u8> {
    fs::read(format!("/proc/{process}/cmdline")).unwrap_or_default()
}

/// The value that `share` of all values do not exceed; none without values.
pub(crate) fn quantile(values: impl IntoIterator<Item = f64>, share: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    values.get((last as f64 * share).round() as usize).copied()
}
