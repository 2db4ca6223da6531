//! The limit of this process's descriptors.

use std::fs;

use rustix::process::{Resource, Rlimit, setrlimit};

/// A supervisor has four for each topic open and 355 in all, and up to 14 more for each consumer that reads all topics. So this is enough
/// for a dozen of them.
pub(crate) const NEEDED: u64 = 512;

/// Raise the limit of descriptors to the hard limit. The error is the limit, if it is too low: the middleware would report
/// only that something failed.
pub(crate) fn raise_limit() -> Result<(), u64> {
    let Some([_, hard]) = limits() else {
        return Ok(());
    };
    let limit = Rlimit { current: Some(hard), maximum: Some(hard) };
    // If the limit cannot be raised, as under the service's unit, the present limit stays.
    let _ = setrlimit(Resource::Nofile, limit);
    match limits() {
        Some([soft, _]) if soft < NEEDED => Err(soft),
        _ => Ok(()),
    }
}

/// The soft and the hard limit, if the kernel says. They are read from text, because a service may not call the system for them.
fn limits() -> Option<[u64; 2]> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits.lines().find_map(|line| line.strip_prefix("Max open files"))?;
    let mut numbers = line.split_ascii_whitespace().map(str::parse);
    Some([numbers.next()?.ok()?, numbers.next()?.ok()?])
}
