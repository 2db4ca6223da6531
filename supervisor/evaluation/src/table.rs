//! Rows in a CSV file, one for each mission: appended as missions end, sorted when all have.

use std::{
    collections::BTreeSet,
    fs::{self, File},
    io,
    path::{Path, PathBuf},
};

use serde::{Serialize, de::DeserializeOwned};
use thiserror::Error;

/// World, noise seed and setting: what makes a mission the one it is.
pub type Key = (String, u64, String);

/// A row of a table.
pub trait Record: Serialize + DeserializeOwned {
    /// Of which mission it is.
    fn key(&self) -> Key;
}

/// A table that cannot be read or written.
#[derive(Debug, Error)]
#[error("cannot {action} {}: {problem}", file.display())]
pub struct TableError {
    action: &'static str,
    file: PathBuf,
    problem: String,
}

/// The file, and what is in it.
#[derive(Debug)]
pub struct Table<R> {
    file: PathBuf,
    rows: Vec<R>,
}

impl<R: Record> Table<R> {
    /// A table in `file`: with the rows that are there already, or empty.
    ///
    /// # Errors
    /// When it is there and no table.
    pub fn open(file: &Path) -> Result<Self, TableError> {
        let mut table = Self {
            file: file.to_path_buf(),
            rows: Vec::new(),
        };
        if file.exists() {
            let mut reader = csv::Reader::from_path(file).map_err(table.failed("read"))?;
            let whole = reader.deserialize().map_while(Result::ok);
            // A row that was cut off is run again.
            table.rows = whole.collect();
        }
        table.save()?;
        Ok(table)
    }

    /// What is in it.
    #[must_use]
    pub fn rows(&self) -> &[R] {
        &self.rows
    }

    /// The missions whose rows are there.
    #[must_use]
    pub fn keys(&self) -> BTreeSet<Key> {
        self.rows.iter().map(R::key).collect()
    }

    /// Append a row to the file.
    ///
    /// # Errors
    /// When the disk is full, say.
    pub fn add(&mut self, row: R) -> Result<(), TableError> {
        let opened = File::options().append(true).open(&self.file);
        let opened = opened.map_err(|error| self.failed("append to")(error.into()))?;
        let mut writer = csv::WriterBuilder::new()
            .has_headers(self.rows.is_empty())
            .from_writer(opened);
        let written = writer.serialize(&row).and_then(|()| Ok(writer.flush()?));
        written.map_err(self.failed("append to"))?;
        self.rows.push(row);
        Ok(())
    }

    /// Sort the rows, by world, seed and setting, and write them anew; of two of one mission the later one.
    ///
    /// # Errors
    /// When the disk is full, say.
    pub fn sort(&mut self) -> Result<(), TableError> {
        self.rows.reverse();
        self.rows.sort_by_key(R::key);
        self.rows.dedup_by_key(|row| row.key());
        self.save()
    }

    /// Write all rows to a new file and put it in the place of the old one.
    fn save(&self) -> Result<(), TableError> {
        let unfinished = self.file.with_extension("csv.new");
        let write = || -> Result<(), csv::Error> {
            let mut writer = csv::Writer::from_path(&unfinished)?;
            self.rows.iter().try_for_each(|row| writer.serialize(row))?;
            writer.flush()?;
            fs::rename(&unfinished, &self.file)?;
            Ok(())
        };
        write().map_err(self.failed("write"))
    }

    fn failed(&self, action: &'static str) -> impl Fn(csv::Error) -> TableError {
        let file = self.file.clone();
        move |error| TableError {
            action,
            file: file.clone(),
            problem: match error.kind() {
                csv::ErrorKind::Io(source) if source.kind() == io::ErrorKind::NotFound => {
                    "its directory is missing".to_owned()
                }
                _ => error.to_string(),
            },
        }
    }
}
