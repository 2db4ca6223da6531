//! Resources of a process and its descendants, from `/proc`.

use std::{
    collections::BTreeSet,
    fs,
    time::{Duration, Instant},
};

use common::process_status;
use serde::Serialize;

use crate::{missions::statistics::rounded, robot::processes};

#[derive(Debug, PartialEq, Serialize)]
pub struct Used {
    /// Voluntary context switches of all threads: each wait ends with a wakeup.
    pub wakeups_per_s: f64,
    pub cpu_share: f64,
    /// Proportional memory: each shared page is divided among the processes that map it.
    pub pss_mib: f64,
}

pub struct ProcessSet {
    root: u32,
    first: Option<Counts>,
    last: Option<Counts>,
    pss_kib: u64,
}

struct Counts {
    at: Instant,
    processes: BTreeSet<u32>,
    waits: u64,
    cpu: Duration,
}

impl ProcessSet {
    pub const fn of(root: u32) -> Self {
        Self { root, first: None, last: None, pss_kib: 0 }
    }

    /// A started process restarts the count, and the first ended one stops it.
    pub fn look(&mut self) {
        let now = Counts::of(self.root);
        match &self.first {
            Some(first) if now.processes == first.processes => self.last = Some(now),
            Some(first) if now.processes.is_subset(&first.processes) => {}
            _ => {
                // Reading memory delays the process, so it happens once.
                self.pss_kib = now.processes.iter().filter_map(pss_kib).sum();
                self.first = Some(now);
                self.last = None;
            }
        }
    }

    /// Returns the resources between the first and last look; none without two looks.
    pub fn used(&self) -> Option<Used> {
        let (first, last) = (self.first.as_ref()?, self.last.as_ref()?);
        let over = (last.at - first.at).as_secs_f64();
        Some(Used {
            wakeups_per_s: rounded(last.waits.saturating_sub(first.waits) as f64 / over),
            cpu_share: rounded(last.cpu.saturating_sub(first.cpu).as_secs_f64() / over),
            pss_mib: rounded(self.pss_kib as f64 / 1024.0),
        })
    }
}

impl Counts {
    fn of(root: u32) -> Self {
        let mut counts =
            Self { at: Instant::now(), processes: BTreeSet::new(), waits: 0, cpu: Duration::ZERO };
        for process in processes().filter(|&process| descends_from(process, root)) {
            if let (Some(waits), Some(cpu)) =
                (waits(process), process_status::processor_time(process))
            {
                counts.processes.insert(process);
                counts.waits += waits;
                counts.cpu += cpu;
            }
        }
        counts
    }
}

fn waits(process: u32) -> Option<u64> {
    let threads = fs::read_dir(format!("/proc/{process}/task")).ok()?.flatten();
    let waits = |thread: fs::DirEntry| {
        let status = format!("{process}/task/{}/status", thread.file_name().display());
        process_status::field(&status, "voluntary_ctxt_switches")?.parse::<u64>().ok()
    };
    threads.map(waits).sum()
}

fn descends_from(process: u32, root: u32) -> bool {
    let parent =
        |process: &u32| process_status::field(&format!("{process}/status"), "PPid")?.parse().ok();
    std::iter::successors(Some(process), parent).any(|it| it == root)
}

fn pss_kib(process: &u32) -> Option<u64> {
    process_status::kibibytes(&format!("{process}/smaps_rollup"), "Pss")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{
        io::Read as _,
        process::{Command, Stdio},
    };

    #[test]
    fn a_process_and_its_child_are_counted_until_one_ends() {
        let mut shell = Command::new("sh")
            .args(["-c", "exec 3<&0; cat <&3 & echo started; wait"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut started = [0; 8];
        let said = shell.stdout.as_mut().unwrap();
        said.read_exact(&mut started).unwrap();
        let mut set = ProcessSet::of(shell.id());
        set.look();
        assert_eq!(set.used(), None, "nothing to compare with");
        assert_eq!(Counts::of(shell.id()).processes.len(), 2);
        set.look();
        let used = set.used().unwrap();
        assert!(used.pss_mib > 0.1, "{used:?}");
        drop(shell.stdin.take());
        shell.wait().unwrap();
        set.look();
        assert_eq!(set.used(), Some(used), "use after the end counts");
    }
}
