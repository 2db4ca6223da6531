//! Record of a stage's death, source of the `deaths.jsonl` line, the bus sample and the log line.

use std::{fs::File, os::unix::fs::FileExt as _, path::Path, time::Duration};

use common::{
    samples::{DeathSample, NextStep, name, words},
    start,
};
use serde::Serialize;

use crate::process::ExitCause;

const LOG_TAIL_BYTES: usize = 400;

#[derive(Debug, Serialize)]
pub struct Death {
    pub stage: &'static str,
    pub pid: u32,
    pub generation: u32,
    pub cause: ExitCause,
    /// Whether the supervisor ended the process as hung or never ready.
    pub hung: bool,
    pub noticed_after_s: Option<f64>,
    /// Age of the last beat; `None` if the process never beat.
    pub beat_age_s: Option<f64>,
    pub uptime_s: f64,
    /// Deaths of this stage within the policy's window, including this one.
    pub deaths_in_window: u32,
    pub next: Next,
    pub log_tail: String,
}

#[derive(Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Next {
    StartNow,
    StartLater {
        after_s: f64,
    },
    /// The stage died too often: only an operator starts it again.
    Hold,
    Nothing,
}

impl Death {
    pub fn was_refused(&self) -> bool {
        self.cause == ExitCause::Exited(start::REFUSED.into())
    }

    pub fn log(&self) {
        let Self {
            stage,
            pid,
            generation,
            cause,
            hung,
            noticed_after_s: _,
            beat_age_s,
            uptime_s,
            deaths_in_window,
            next,
            log_tail,
        } = self;
        tracing::warn!(stage, pid, generation, %cause, hung, ?beat_age_s, uptime_s, deaths_in_window, ?next, log_tail, "stage died");
    }

    pub fn sample(&self) -> DeathSample {
        let (cause, code) = self.cause.coded();
        let (next, after) = match self.next {
            Next::StartNow => (NextStep::StartNow, 0.0),
            Next::StartLater { after_s } => (NextStep::StartLater, after_s),
            Next::Hold => (NextStep::Hold, 0.0),
            Next::Nothing => (NextStep::Nothing, 0.0),
        };
        DeathSample {
            stage: name(self.stage),
            pid: self.pid,
            generation: self.generation,
            beat_age_ns: self.beat_age_s.map_or(u64::MAX, nanoseconds),
            uptime_ns: nanoseconds(self.uptime_s),
            next_after_ns: nanoseconds(after),
            code,
            deaths_in_window: self.deaths_in_window,
            cause: cause.into(),
            next: next.into(),
            hung: self.hung.into(),
            log_tail: words(&self.log_tail),
            ..DeathSample::default()
        }
    }
}

fn nanoseconds(seconds: f64) -> u64 {
    Duration::try_from_secs_f64(seconds).map_or(u64::MAX, |time| time.as_nanos() as u64)
}

/// In whole lines; empty without a log.
pub fn log_tail(log: &Path, since: u64) -> String {
    let mut bytes = [0; LOG_TAIL_BYTES];
    let length = File::open(log)
        .and_then(|log| {
            let end = log.metadata()?.len();
            log.read_at(&mut bytes, end.saturating_sub(LOG_TAIL_BYTES as u64).max(since))
        })
        .unwrap_or_default();
    let text = String::from_utf8_lossy(&bytes[..length]);
    // The first line may be incomplete.
    let whole = match text.split_once('\n') {
        Some((_, rest)) if length == LOG_TAIL_BYTES => rest,
        _ => &text,
    };
    whole.trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_tail_is_whole_lines_of_this_generation_alone() {
        let directory = tempfile::tempdir().unwrap();
        let log = directory.path().join("stage.log");
        let lines: String = (0..100).map(|line| format!("line {line}\n")).collect();
        std::fs::write(&log, &lines).unwrap();
        let words = log_tail(&log, 0);
        assert!(words.starts_with("line ") && words.ends_with("line 99"), "{words}");
        assert!(words.len() <= LOG_TAIL_BYTES);
        assert_eq!(log_tail(&log, lines.len() as u64 - 8), "line 99");
        assert_eq!(log_tail(&directory.path().join("none"), 0), "");
    }

    #[test]
    fn a_death_reads_the_same_on_the_bus_and_in_the_file() {
        let death = Death {
            stage: "mapper",
            pid: 77,
            generation: 3,
            cause: ExitCause::Signalled { signal: 9, core: false },
            hung: false,
            noticed_after_s: None,
            beat_age_s: Some(0.02),
            uptime_s: 12.5,
            deaths_in_window: 2,
            next: Next::StartLater { after_s: 0.05 },
            log_tail: "ready".to_owned(),
        };
        let sample = death.sample();
        assert_eq!((sample.code, sample.deaths_in_window), (9, 2));
        assert_eq!(sample.uptime_ns, 12_500_000_000);
        assert_eq!(sample.next(), NextStep::StartLater);
        let read = serde_json::to_value(&death).unwrap();
        assert_eq!(read["cause"]["signalled"]["signal"], 9);
        assert_eq!(read["next"]["start_later"]["after_s"], 0.05);
    }
}
