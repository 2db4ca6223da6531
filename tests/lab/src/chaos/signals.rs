//! `signals.csv`: a row for each signal, written when its last measurement is known. A chaos that is killed leaves the rows that are
//! known by then.

use std::{fs, path::Path, time::Instant};

use serde::{Deserialize, Serialize};

use super::schedule::Kind;
use crate::{
    error::{OrCannot as _, Result},
    missions::results::Table,
};

const FILE_NAME: &str = "signals.csv";

/// A signal. A value that was not measured is an empty cell.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    pub mission: u64,
    /// Mission time of the newest wheel sample that was read before the signal, seconds.
    pub time_s: Option<f64>,
    /// The stage, `supervisor`, `everything`, or the consumer's name.
    pub stage: String,
    pub kind: Kind,
    /// The generation; for a consumer the number of its starts in that mission. None for the supervisor, for everything and for the
    /// run's own recorder.
    pub generation: Option<u32>,
    /// Whether the process was to be hit in its first milliseconds.
    pub start_up: bool,
    /// The time from the signal until the supervisor's record of the death was read, milliseconds. Only for stages.
    pub noticed_ms: Option<f64>,
    /// The time from the signal until the successor's first sign of work was read, milliseconds. For stages and the supervisor.
    pub ready_ms: Option<f64>,
    /// The time from the signal until the successor's first sample of a tick was read, milliseconds. For stages and the supervisor.
    pub first_output_ms: Option<f64>,
}

/// Milliseconds since `at`, to the microsecond.
pub fn ms_since(at: Instant) -> f64 {
    (at.elapsed().as_secs_f64() * 1e6).round() / 1e3
}

/// The file in `directory`, without rows.
pub fn create(directory: &Path) -> Result<Table<Row>> {
    let path = directory.join(FILE_NAME);
    fs::create_dir_all(directory).or_cannot_file("make the directory of", &path)?;
    if path.exists() {
        return Err(format!("{} exists; give another directory", path.display()).into());
    }
    Table::open(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(path: &Path) -> Vec<Row> {
        let mut reader = csv::Reader::from_path(path).unwrap();
        reader.deserialize().map(csv::Result::unwrap).collect()
    }

    #[test]
    fn rows_are_in_the_file_as_soon_as_they_are_added_and_are_read_as_they_were() {
        let folder = tempfile::tempdir().unwrap();
        let directory = folder.path().join("results");
        let mut file = create(&directory).unwrap();
        assert_eq!(read(&directory.join(FILE_NAME)), []);
        let plain = Row {
            mission: 3,
            time_s: Some(1.25),
            stage: "mapper".to_owned(),
            kind: Kind::KillAtStart,
            generation: Some(4),
            start_up: true,
            ..Row::default()
        };
        let odd = Row {
            noticed_ms: Some(0.125),
            stage: "sh -c 'a, \"b\"\n'".to_owned(),
            ..Row::default()
        };
        for row in [&plain, &odd] {
            file.add(row.clone()).unwrap();
        }
        // Another process reads the file like this while it is written.
        assert_eq!(read(&directory.join(FILE_NAME)), [plain, odd]);
        let text = fs::read_to_string(directory.join(FILE_NAME)).unwrap();
        let columns = "mission,time_s,stage,kind,generation,start_up,noticed_ms,";
        assert!(text.starts_with(columns), "{text}");
        assert!(text.contains("\n3,1.25,mapper,kill_at_start,4,true,,,\n"), "{text}");
    }

    #[test]
    fn results_that_are_there_are_not_written_over() {
        let folder = tempfile::tempdir().unwrap();
        create(folder.path()).unwrap();
        let refused = create(folder.path()).unwrap_err().to_string();
        let named = folder.path().join(FILE_NAME);
        assert!(refused.contains(named.to_str().unwrap()), "{refused}");
    }
}
