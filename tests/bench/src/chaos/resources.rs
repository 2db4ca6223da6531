//! What a process holds.

use std::fs;

use common::process_status;
use serde::Serialize;

/// What a process holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Resources {
    /// Open descriptors.
    pub descriptors: i64,
    /// Memory that is its own, KiB.
    pub memory_kib: i64,
}

impl Resources {
    /// Of process `pid`; none when it has ended.
    pub(crate) fn of(pid: u32) -> Option<Self> {
        let descriptors = fs::read_dir(format!("/proc/{pid}/fd")).ok()?.count() as i64;
        // Not the pages of shared memory: these are the bus's, and are mapped as samples are read.
        let memory = process_status::field(&pid.to_string(), "RssAnon")?;
        let memory_kib = memory.trim_end_matches(" kB").parse().ok()?;
        Some(Self {
            descriptors,
            memory_kib,
        })
    }
}
