//! Replays of the missions' recordings: whether every generation of every stage is bit-equal.

use std::{
    fs,
    path::{Path, PathBuf},
};

use recording::{
    End, Recording, RecordingError,
    replay::{Options, replay},
};
use serde::Serialize;

use crate::chaos::consumers::Consumers;

#[derive(Debug, Default, Serialize)]
struct Counts {
    recordings: u64,
    /// Generations whose outputs are equal to the bit, and those that ended before their first step.
    equal: u64,
    without_step: u64,
    /// Compared samples.
    compared: u64,
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
    whole: Counts,
    /// Generations that differ or could not be replayed, and recordings that could not be read, with reasons.
    wrong: Vec<String>,
    /// Results of recordings whose recorders were hit, or attached during a mission.
    partial: Counts,
}

impl Counts {
    /// Replay `file`, as far as it goes if it may be `partial`. Add what is wrong.
    fn add(
        &mut self,
        file: &Path,
        partial: bool,
        wrong: &mut Vec<String>,
    ) -> Result<(), RecordingError> {
        self.recordings += 1;
        let recording = match Recording::open(file) {
            Err(_) if partial => {
                self.not_begun += 1;
                return Ok(());
            }
            opened => opened?,
        };
        self.cut += u64::from(recording.end != End::Complete);
        let report = replay(&recording, &Options::default())?;
        for (stage, found) in &report.stages {
            self.equal += found.equal;
            self.without_step += found.without_step;
            self.compared += found.compared;
            self.not_replayed += found.not_replayed.len() as u64;
            let not = found.not_replayed.iter().filter(|_| !partial);
            wrong.extend(not.map(|(number, why)| format!("{stage} generation {number}: {why}")));
        }
        wrong.extend(report.difference.map(|difference| difference.to_string()));
        Ok(())
    }
}

impl Replays {
    pub fn wrong(&self) -> &[String] {
        &self.wrong
    }

    pub const fn all_equal(&self) -> bool {
        self.wrong.is_empty()
    }

    /// Replay the recordings of the mission in `directory` and of its `consumers`. Returns whether all is bit-equal.
    pub fn add(&mut self, seed: u64, directory: &Path, consumers: &Consumers) -> bool {
        let mut wrong = Vec::new();
        let own =
            recordings(directory).map(|file| (consumers.hit_recordings.contains(&file), file));
        let own: Vec<_> = own.collect();
        if own.is_empty() {
            wrong.push("nothing was recorded".to_owned());
        }
        let others = recordings(&consumers.directory).map(|file| (true, file));
        for (partial, file) in own.into_iter().chain(others) {
            let counts = if partial { &mut self.partial } else { &mut self.whole };
            if let Err(error) = counts.add(&file, partial, &mut wrong) {
                wrong.push(error.to_string());
            }
        }
        let all_equal = wrong.is_empty();
        self.wrong.extend(wrong.into_iter().map(|wrong| format!("seed {seed}: {wrong}")));
        all_equal
    }
}

fn recordings(directory: &Path) -> impl Iterator<Item = PathBuf> {
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    let files = entries.map(|entry| entry.path());
    files.filter(|file| file.extension().is_some_and(|extension| extension == "mcap"))
}
