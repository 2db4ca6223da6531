//! Resources of a process.

use std::fs;

use common::process_status;
use serde::Serialize;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Resources {
    pub descriptors: i64,
    /// Private memory, KiB.
    pub memory_kib: i64,
}

impl Resources {
    /// The resources of process `pid`; none if it has ended.
    pub fn of(pid: u32) -> Option<Self> {
        let descriptors = fs::read_dir(format!("/proc/{pid}/fd")).ok()?.count() as i64;
        // Pages of shared memory belong to the bus and do not count.
        let memory_kib = process_status::kibibytes(&pid.to_string(), "RssAnon")? as i64;
        Some(Self { descriptors, memory_kib })
    }
}
