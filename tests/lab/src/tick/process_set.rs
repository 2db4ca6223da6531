//! Resources of a process and its descendants, from `/proc`.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    time::{Duration, Instant},
};

use common::process_status;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Used {
    /// Voluntary context switches of all threads in a second: each wait ends with a wakeup.
    pub wakeups_per_s: f64,
    /// Share of one core, 1 for all of it.
    pub cpu_share: f64,
    /// Proportional memory, MiB: each shared page is divided among the processes that map it.
    pub pss_mib: f64,
}

#[derive(Debug)]
pub struct ProcessSet {
    root: u32,
    first: Option<Counts>,
    last: Option<Counts>,
    pss_kib: u64,
}

#[derive(Clone, Debug)]
struct Counts {
    at: Instant,
    processes: BTreeMap<u32, Count>,
}

#[derive(Clone, Copy, Debug)]
struct Count {
    waits: u64,
    cpu: Duration,
}

impl ProcessSet {
    pub const fn of(root: u32) -> Self {
        Self { root, first: None, last: None, pss_kib: 0 }
    }

    /// Count now. Counting begins anew whenever a process has started, and stops when the first has ended.
    pub fn look(&mut self) {
        let all = descendants(self.root);
        let processes: BTreeMap<_, _> =
            all.iter().filter_map(|&process| Some((process, Count::of(process)?))).collect();
        let counts = Counts { at: Instant::now(), processes };
        let known = self.first.as_ref().map(|first| &first.processes);
        let started = known.is_none_or(|known| all.iter().any(|one| !known.contains_key(one)));
        let ended = known.is_some_and(|known| known.keys().any(|one| !all.contains(one)));
        if started {
            // Memory is read only once, because that takes a process some of its time.
            self.pss_kib = all.iter().filter_map(|&process| pss_kib(process)).sum();
            self.first = Some(counts);
            self.last = None;
        } else if !ended {
            self.last = Some(counts);
        }
    }

    /// The resources between the first look and the last; none without two looks.
    pub fn used(&self) -> Option<Used> {
        let (first, last) = (self.first.as_ref()?, self.last.as_ref()?);
        let over = (last.at - first.at).as_secs_f64();
        let (mut waits, mut cpu) = (0, Duration::ZERO);
        for (process, now) in &last.processes {
            let then = first.processes.get(process)?;
            waits += now.waits.saturating_sub(then.waits);
            cpu += now.cpu.saturating_sub(then.cpu);
        }
        Some(Used {
            wakeups_per_s: waits as f64 / over,
            cpu_share: cpu.as_secs_f64() / over,
            pss_mib: self.pss_kib as f64 / 1024.0,
        })
    }
}

impl Count {
    fn of(process: u32) -> Option<Self> {
        let mut waits = 0;
        for thread in fs::read_dir(format!("/proc/{process}/task")).ok()?.flatten() {
            let thread = format!("{process}/task/{}", thread.file_name().display());
            let switches = process_status::field(&thread, "voluntary_ctxt_switches")?;
            waits += switches.parse::<u64>().ok()?;
        }
        Some(Self { waits, cpu: process_status::processor_time(process)? })
    }
}

/// `root` and every process that descends from it.
fn descendants(root: u32) -> BTreeSet<u32> {
    let parent = |process: u32| process_status::field(&process.to_string(), "PPid")?.parse().ok();
    let parents: Vec<(u32, u32)> =
        crate::robot::processes().filter_map(|process| Some((process, parent(process)?))).collect();
    let mut found: BTreeSet<u32> =
        parents.iter().map(|(process, _)| *process).filter(|process| *process == root).collect();
    loop {
        let more: Vec<u32> = parents
            .iter()
            .filter(|(process, _)| !found.contains(process))
            .filter(|(_, parent)| found.contains(parent))
            .map(|(process, _)| *process)
            .collect();
        if more.is_empty() {
            return found;
        }
        found.extend(more);
    }
}

fn pss_kib(process: u32) -> Option<u64> {
    let text = fs::read_to_string(format!("/proc/{process}/smaps_rollup")).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("Pss:"))?;
    line.trim().strip_suffix(" kB")?.parse().ok()
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
        // A shell and its child, which ends with its input.
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
        assert_eq!(descendants(shell.id()).len(), 2);
        set.look();
        let used = set.used().unwrap();
        assert!(used.pss_mib > 0.1, "{used:?}");
        drop(shell.stdin.take());
        shell.wait().unwrap();
        set.look();
        assert_eq!(set.used(), Some(used), "what came after the end counts");
    }
}
