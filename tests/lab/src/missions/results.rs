//! Directory of an evaluation: its command, and two CSV files, finally sorted.

use std::{
    env,
    fs::{self, File},
    path::{Path, PathBuf},
};

use common::file::replace;
use serde::{Serialize, de::DeserializeOwned};

use super::row::{Latency, Row};
use crate::error::{OrCannot as _, Result, refuse};

const PLAN_FILE: &str = "plan.txt";

/// Returns the command without options that leave the rows unchanged.
fn command() -> Result<String> {
    let mut words = vec!["firsthand".to_owned()];
    let mut given = env::args().skip(1);
    while let Some(word) = given.next() {
        match &*word {
            "--resume" | "--json" | "--processes" => {}
            "--jobs" => drop(given.next()),
            jobs if jobs.starts_with("--jobs=") => {}
            _ => words.push(word),
        }
    }
    shlex::try_join(words.iter().map(String::as_str)).or_cannot("write the command")
}

pub struct Results {
    /// Command that reproduces the results.
    pub command: String,
    pub directory: PathBuf,
    pub rows: Table<Row>,
    /// Latencies, which differ in every run, unlike rows.
    pub latencies: Table<Latency>,
}

impl Results {
    /// Resumes `directory` only if the command is the same.
    pub fn open(directory: &Path, resume: bool) -> Result<Self> {
        let command = command()?;
        let file = directory.join(PLAN_FILE);
        let named = directory.display();
        let use_it = format!("use {named} for results; give another --out");
        if let Ok(earlier) = fs::read_to_string(&file) {
            let earlier = earlier.trim();
            if !resume {
                let taken = format!(
                    "{named} contains results; continue them with --resume, or give another --out"
                );
                return refuse("results-there", taken);
            }
            if earlier != command {
                let other = format!(
                    "--resume: {named} has results of another command, `{earlier}`; give another --out"
                );
                return refuse("other-results", other);
            }
        } else {
            fs::create_dir_all(directory).or_cannot(&use_it)?;
            fs::write(&file, format!("{command}\n")).or_cannot(&use_it)?;
        }
        let directory = fs::canonicalize(directory).or_cannot(&use_it)?;
        Ok(Self {
            rows: Table::open(directory.join("rows.csv"))?,
            latencies: Table::open(directory.join("latencies.csv"))?,
            command,
            directory,
        })
    }

    pub fn sort(&mut self) -> Result {
        self.rows.sort(Row::key)?;
        self.latencies.sort(|it| (it.world.clone(), it.seed, it.setting.clone()))
    }
}

pub type Key = (String, u64, String);

#[derive(Debug)]
pub struct Table<R> {
    file: PathBuf,
    pub rows: Vec<R>,
}

impl<R: Serialize + DeserializeOwned> Table<R> {
    pub fn open(file: PathBuf) -> Result<Self> {
        let mut rows = Vec::new();
        if file.exists() {
            let mut reader = csv::Reader::from_path(&file).or_cannot_file("read", &file)?;
            // A mission with a truncated row is run again.
            rows.extend(reader.deserialize().map_while(Result::<R, _>::ok));
        }
        let table = Self { file, rows };
        table.save()?;
        Ok(table)
    }

    pub fn add(&mut self, row: R) -> Result {
        let append = |has_headers| -> csv::Result<()> {
            let file = File::options().append(true).open(&self.file)?;
            let mut writer = csv::WriterBuilder::new().has_headers(has_headers).from_writer(file);
            writer.serialize(&row)?;
            Ok(writer.flush()?)
        };
        append(self.rows.is_empty()).or_cannot_file("append to", &self.file)?;
        self.rows.push(row);
        Ok(())
    }

    fn save(&self) -> Result {
        let mut writer = csv::Writer::from_writer(Vec::new());
        self.rows.iter().try_for_each(|row| writer.serialize(row))?;
        replace(&self.file, writer.into_inner()?).or_cannot_file("write", &self.file)
    }

    /// Sorts by `key`, and rewrites the file. Of two rows with one key, the later stays.
    fn sort(&mut self, key: impl Fn(&R) -> Key) -> Result {
        self.rows.reverse();
        self.rows.sort_by_key(&key);
        self.rows.dedup_by_key(|row| key(row));
        self.save()
    }
}
