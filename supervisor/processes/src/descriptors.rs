use std::fs;

use rustix::process::{Resource, Rlimit, setrlimit};

use crate::domain_error::DomainError;

/// Descriptors of a supervisor: four per topic, 355 in all, and up to 14 per consumer of all
/// topics, for a dozen consumers.
pub(crate) const NEEDED: u64 = 512;

/// Raises the soft limit of descriptors to the hard limit.
pub(crate) fn raise_limit() -> Result<(), DomainError> {
    let Some([_, hard]) = limits() else {
        return Ok(());
    };
    let limit = Rlimit { current: Some(hard), maximum: Some(hard) };
    // Where raising fails, as under the service's unit, the soft limit stays.
    let _ = setrlimit(Resource::Nofile, limit);
    match limits() {
        Some([limit, _]) if limit < NEEDED => Err(DomainError::Descriptors { limit }),
        _ => Ok(()),
    }
}

/// Returns the soft and hard limits from /proc; a service may lack the system call.
fn limits() -> Option<[u64; 2]> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let mut numbers = limits
        .lines()
        .find_map(|line| line.strip_prefix("Max open files"))?
        .split_ascii_whitespace()
        .map(str::parse);
    Some([numbers.next()?.ok()?, numbers.next()?.ok()?])
}
