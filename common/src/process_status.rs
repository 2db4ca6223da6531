//! The state of a process in `/proc/PID/status`.

use std::fs;

/// The value of `field` of process `process`, a number or `self`; none if the process has ended.
pub fn field(process: &str, field: &str) -> Option<String> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let mut lines = status.lines().filter_map(|line| line.split_once(':'));
    let (_, value) = lines.find(|(name, _)| *name == field)?;
    Some(value.trim().to_owned())
}
