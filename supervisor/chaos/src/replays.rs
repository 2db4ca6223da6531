//! The missions' recordings, replayed: every generation of every stage, bit-equal or not.

use std::{fmt, fs, path::Path};

use recording::Recording;
use replay::Options;
use serde::Serialize;

/// What became of the recordings of all missions.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Replays {
    recordings: u64,
    /// Generations whose outputs are equal to the bit.
    equal: u64,
    /// Generations that took nothing before they ended.
    without_step: u64,
    /// Samples that were compared.
    compared: u64,
    /// Generations that differ or could not be replayed, and recordings that could not be read: which, and why.
    wrong: Vec<String>,
}

impl Replays {
    /// Whether every generation of every recording is.
    pub(crate) const fn all_equal(&self) -> bool {
        self.wrong.is_empty()
    }

    /// Replay what was recorded of the mission in `directory`. Says whether all of it is bit-equal.
    pub(crate) fn add(&mut self, seed: u64, directory: &Path) -> bool {
        let before = self.wrong.len();
        let entries = fs::read_dir(directory).into_iter().flatten().flatten();
        let files: Vec<_> = entries.map(|entry| entry.path()).collect();
        let recordings = files.iter().filter(|file| {
            file.extension()
                .is_some_and(|extension| extension == "mcap")
        });
        let count = self.recordings;
        for file in recordings {
            self.recordings += 1;
            if let Err(error) = self.replay(seed, file) {
                self.wrong.push(format!("seed {seed}: {error}"));
            }
        }
        if self.recordings == count {
            self.wrong
                .push(format!("seed {seed}: nothing was recorded"));
        }
        self.wrong.len() == before
    }

    fn replay(&mut self, seed: u64, file: &Path) -> Result<(), recording::RecordingError> {
        let report = replay::replay(&Recording::open(file)?, &Options::default())?;
        for (stage, found) in &report.stages {
            self.equal += found.equal;
            self.without_step += found.without_step;
            self.compared += found.compared;
            for (generation, why) in &found.not_replayed {
                self.wrong.push(format!(
                    "seed {seed}: {stage} generation {generation}: {why}"
                ));
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
        for wrong in &self.wrong {
            writeln!(to, "  {wrong}")?;
        }
        Ok(())
    }
}
