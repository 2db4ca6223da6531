//! Replays of the missions' recordings: whether every generation of every stage is bit-equal.

use std::{
    fmt, fs,
    path::{Path, PathBuf},
};

use recording::{
    End, Recording, RecordingError,
    replay::{Options, Report, replay},
};
use serde::Serialize;

/// Recordings, their generations whose outputs are equal to the bit, those that ended before their first step, and compared samples.
#[derive(Debug, Default, Serialize)]
struct Counts {
    recordings: u64,
    equal: u64,
    without_step: u64,
    compared: u64,
}

/// Results of recordings whose recorders were hit, or attached during a mission.
#[derive(Debug, Default, Serialize)]
struct Partial {
    #[serde(flatten)]
    counts: Counts,
    /// Recordings that end before their recorder did.
    cut: u64,
    /// Recordings that do not name their run, because the recorder was killed before it had written that.
    not_begun: u64,
    /// Generations that were recorded in part, so that their state cannot be computed.
    not_replayed: u64,
}

#[derive(Debug, Default, Serialize)]
pub struct Replays {
    #[serde(flatten)]
    counts: Counts,
    /// Generations that differ or could not be replayed, and recordings that could not be read, with reasons.
    wrong: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    partial: Option<Partial>,
}

impl Counts {
    fn add(&mut self, report: &Report) {
        for found in report.stages.values() {
            self.equal += found.equal;
            self.without_step += found.without_step;
            self.compared += found.compared;
        }
    }
}

impl Replays {
    pub fn wrong(&self) -> &[String] {
        &self.wrong
    }

    pub const fn all_equal(&self) -> bool {
        self.wrong.is_empty()
    }

    /// Replay the recordings of the mission in `directory`. Returns whether all is bit-equal. Recordings among `hit` and
    /// `others` are replayed only as far as they go.
    pub fn add(
        &mut self,
        seed: u64,
        directory: &Path,
        hit: &[PathBuf],
        others: &[PathBuf],
    ) -> bool {
        let before = self.wrong.len();
        let entries = fs::read_dir(directory).into_iter().flatten().flatten();
        let files: Vec<_> = entries.map(|entry| entry.path()).collect();
        let (hit, whole): (Vec<_>, Vec<_>) = files
            .iter()
            .filter(|file| file.extension().is_some_and(|extension| extension == "mcap"))
            .partition(|file| hit.contains(file));
        let mut wrong = Vec::new();
        if hit.is_empty() && whole.is_empty() {
            wrong.push("nothing was recorded".to_owned());
        }
        for file in whole {
            self.counts.recordings += 1;
            if let Err(error) = self.replay(file, &mut wrong) {
                wrong.push(error.to_string());
            }
        }
        for file in hit.into_iter().chain(others) {
            if let Err(error) = self.replay_partial(file, &mut wrong) {
                wrong.push(error.to_string());
            }
        }
        self.wrong.extend(wrong.into_iter().map(|wrong| format!("seed {seed}: {wrong}")));
        self.wrong.len() == before
    }

    /// Replay a recording that may be incomplete.
    fn replay_partial(
        &mut self,
        file: &Path,
        wrong: &mut Vec<String>,
    ) -> Result<(), RecordingError> {
        let partial = self.partial.get_or_insert_default();
        partial.counts.recordings += 1;
        let Ok(recording) = Recording::open(file) else {
            partial.not_begun += 1;
            return Ok(());
        };
        partial.cut += u64::from(recording.end != End::Complete);
        let report = replay(&recording, &Options::default())?;
        partial.not_replayed += report.not_replayed() as u64;
        partial.counts.add(&report);
        wrong.extend(report.difference.map(|difference| difference.to_string()));
        Ok(())
    }

    fn replay(&mut self, file: &Path, wrong: &mut Vec<String>) -> Result<(), RecordingError> {
        let report = replay(&Recording::open(file)?, &Options::default())?;
        self.counts.add(&report);
        for (stage, found) in &report.stages {
            for (generation, why) in &found.not_replayed {
                wrong.push(format!("{stage} generation {generation}: {why}"));
            }
        }
        wrong.extend(report.difference.map(|difference| difference.to_string()));
        Ok(())
    }
}

impl fmt::Display for Replays {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            to,
            "replayed {} recordings: {} generations bit-equal in {} samples, {} ended before their first step, {} not",
            self.counts.recordings,
            self.counts.equal,
            self.counts.compared,
            self.counts.without_step,
            self.wrong.len()
        )?;
        if let Some(partial) = &self.partial {
            writeln!(
                to,
                "recorders hit, or attached in mid mission: {} recordings ({} cut off, {} without their beginning): {} generations bit-equal in {} \
                 samples, {} ended before their first step, {} recorded in part and not replayed",
                partial.counts.recordings,
                partial.cut,
                partial.not_begun,
                partial.counts.equal,
                partial.counts.compared,
                partial.counts.without_step,
                partial.not_replayed
            )?;
        }
        for wrong in &self.wrong {
            writeln!(to, "  {wrong}")?;
        }
        Ok(())
    }
}
