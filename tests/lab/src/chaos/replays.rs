//! Replays of the missions' recordings.

use std::{
    fs,
    path::{Path, PathBuf},
};

use console::robots::entries;
use recording::{
    Recording, RecordingError,
    replay::{Options, replay},
};
use serde::Serialize;

#[derive(Default, Serialize)]
struct Counts {
    recordings: u64,
    /// Generations with bit-equal outputs.
    equal: u64,
    /// Recordings without their run's name, because the recorder was killed before writing it.
    not_begun: u64,
    /// Partly recorded generations, whose state cannot be computed.
    not_replayed: usize,
}

#[derive(Default, Serialize)]
pub struct Replays {
    #[serde(flatten)]
    whole: Counts,
    /// Results of recorders that were hit, attached late, or competed with restarted ones.
    partial: Counts,
}

impl Counts {
    /// Replays `file`, a `partial` one as far as possible, and adds problems to `wrong`.
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
        let report = replay(&recording, &Options::default())?;
        self.equal += report.equal();
        self.not_replayed += report.not_replayed();
        if report.difference.is_some() || !partial && report.not_replayed() > 0 {
            wrong.push(report.to_string());
        }
        Ok(())
    }
}

impl Replays {
    /// Replays recordings of the run in `directory`, and of `others`. Adds different, failed and
    /// unreadable ones to `wrong`.
    pub fn add(
        &mut self,
        directory: &Path,
        hits_recorders: bool,
        others: &Path,
        wrong: &mut Vec<String>,
    ) {
        let partial = hits_recorders || began_late(directory);
        let own: Vec<_> = recordings(directory).map(|file| (partial, file)).collect();
        if own.is_empty() {
            wrong.push("the mission has no recording".to_owned());
        }
        let others = recordings(others).map(|file| (true, file));
        for (partial, file) in own.into_iter().chain(others) {
            let counts = if partial { &mut self.partial } else { &mut self.whole };
            if let Err(error) = counts.add(&file, partial, wrong) {
                wrong.push(error.to_string());
            }
        }
    }
}

/// Returns whether the run began before its recorder attached: on a wall clock it waits only
/// briefly.
fn began_late(directory: &Path) -> bool {
    let log = fs::read_to_string(directory.join("supervisor.log")).unwrap_or_default();
    log.contains("the recorder is not attached yet")
}

fn recordings(directory: &Path) -> impl Iterator<Item = PathBuf> {
    let files = entries(directory).map(|entry| entry.path());
    files.filter(|file| file.extension().is_some_and(|extension| extension == "mcap"))
}
