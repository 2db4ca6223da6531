//! Replays of the missions' recordings: whether every generation of every stage is bit-equal.

use std::{
    fmt, fs,
    path::{Path, PathBuf},
};

use recording::{
    End, Recording,
    replay::{Options, replay},
};
use serde::Serialize;

/// Results of recordings whose recorders were hit, or attached during a mission.
#[derive(Debug, Default, Serialize)]
struct Partial {
    recordings: u64,
    /// Recordings that end before their recorder did.
    cut: u64,
    /// Recordings that do not name their run, because the recorder was killed before it had written that.
    not_begun: u64,
    /// Generations whose recorded outputs are equal to the bit.
    equal: u64,
    without_step: u64,
    compared: u64,
    /// Generations that were recorded in part, so that their state cannot be computed.
    not_replayed: u64,
}

#[derive(Debug, Default, Serialize)]
pub struct Replays {
    recordings: u64,
    /// Generations whose outputs are equal to the bit.
    equal: u64,
    /// Generations without input before they ended.
    without_step: u64,
    compared: u64,
    /// Generations that differ or could not be replayed, and recordings that could not be read, with reasons.
    wrong: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    partial: Option<Partial>,
}

impl Replays {
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
        if hit.is_empty() && whole.is_empty() {
            self.wrong.push(format!("seed {seed}: nothing was recorded"));
        }
        for file in whole {
            self.recordings += 1;
            if let Err(error) = self.replay(seed, file) {
                self.wrong.push(format!("seed {seed}: {error}"));
            }
        }
        for file in hit.into_iter().chain(others) {
            self.replay_partial(seed, file);
        }
        self.wrong.len() == before
    }

    /// Replay a recording that may be incomplete.
    fn replay_partial(&mut self, seed: u64, file: &Path) {
        let partial = self.partial.get_or_insert_default();
        partial.recordings += 1;
        let Ok(recording) = Recording::open(file) else {
            partial.not_begun += 1;
            return;
        };
        partial.cut += u64::from(recording.end != End::Complete);
        match replay(&recording, &Options::default()) {
            Ok(report) => {
                partial.not_replayed += report.not_replayed() as u64;
                for found in report.stages.values() {
                    partial.equal += found.equal;
                    partial.without_step += found.without_step;
                    partial.compared += found.compared;
                }
                if let Some(difference) = &report.difference {
                    self.wrong.push(format!("seed {seed}: {difference}"));
                }
            }
            Err(error) => self.wrong.push(format!("seed {seed}: {error}")),
        }
    }

    fn replay(&mut self, seed: u64, file: &Path) -> Result<(), recording::RecordingError> {
        let report = replay(&Recording::open(file)?, &Options::default())?;
        for (stage, found) in &report.stages {
            self.equal += found.equal;
            self.without_step += found.without_step;
            self.compared += found.compared;
            for (generation, why) in &found.not_replayed {
                self.wrong.push(format!("seed {seed}: {stage} generation {generation}: {why}"));
            }
        }
        if let Some(difference) = &report.difference {
            self.wrong.push(format!("seed {seed}: {difference}"));
        }
        Ok(())
    }
}

impl fmt::Display for Replays {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            to,
            "replayed {} recordings: {} generations bit-equal in {} samples, {} ended before their first step, {} not",
            self.recordings,
            self.equal,
            self.compared,
            self.without_step,
            self.wrong.len()
        )?;
        if let Some(partial) = &self.partial {
            writeln!(
                to,
                "recorders hit, or attached in mid mission: {} recordings ({} cut off, {} without their beginning): {} generations bit-equal in {} \
                 samples, {} ended before their first step, {} recorded in part and not replayed",
                partial.recordings,
                partial.cut,
                partial.not_begun,
                partial.equal,
                partial.compared,
                partial.without_step,
                partial.not_replayed
            )?;
        }
        for wrong in &self.wrong {
            writeln!(to, "  {wrong}")?;
        }
        Ok(())
    }
}
