//! Processor and memory use of a process, as the kernel counts them.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use crate::process_status::{kibibytes, processor_time};

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Usage {
    /// Share of one processor since the last look, 0 to 1.
    pub cpu: Option<f64>,
    /// Resident memory including shared memory.
    pub memory_bytes: Option<u64>,
}

#[derive(Debug, Default)]
pub struct Processes {
    seen: BTreeMap<u32, (Instant, Duration, Usage)>,
}

/// Least interval of a share, because the kernel counts hundredths of a second.
const LOOK_EVERY: Duration = Duration::from_secs(1);

impl Processes {
    pub fn look(&mut self, processes: &[u32], now: Instant) -> Vec<Usage> {
        self.seen.retain(|process, _| processes.contains(process));
        processes.iter().map(|&process| self.one(process, now)).collect()
    }

    fn one(&mut self, process: u32, now: Instant) -> Usage {
        let before = self.seen.get(&process).copied();
        if let Some((at, _, usage)) = before
            && now.saturating_duration_since(at) < LOOK_EVERY
        {
            return usage;
        }
        let Some(used) = processor_time(process) else {
            return Usage::default();
        };
        let cpu = before.map(|(at, then, _)| {
            let over = now.saturating_duration_since(at).as_secs_f64();
            used.saturating_sub(then).as_secs_f64() / over
        });
        let memory_kib = kibibytes(&format!("{process}/status"), "VmRSS");
        let usage = Usage { cpu, memory_bytes: memory_kib.map(|kib| kib.saturating_mul(1024)) };
        self.seen.insert(process, (now, used, usage));
        usage
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_that_computes_uses_a_processor_and_one_that_has_ended_nothing() {
        let own = std::process::id();
        let mut processes = Processes::default();
        let began = Instant::now();
        let first = processes.look(&[own, 0], began);
        // Nothing to compare with.
        assert_eq!(first[0].cpu, None);
        assert!(first[0].memory_bytes > Some(1 << 20));
        assert_eq!(first[1], Usage::default());
        let used = processor_time(own).unwrap();
        while processor_time(own).unwrap() < used + Duration::from_millis(200) {}
        let second = processes.look(&[own], began + LOOK_EVERY);
        assert!(second[0].cpu >= Some(0.19), "{second:?}");
        assert_eq!(processes.look(&[own], began + LOOK_EVERY), second);
    }
}
