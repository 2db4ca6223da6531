//! A CSV file with a row for each mission: appended as missions end, sorted when all have ended.

use std::{
    fs::File,
    path::{Path, PathBuf},
};

use common::file::{FileError, replace};
use serde::{Serialize, de::DeserializeOwned};

/// World, noise seed and setting, which identify a mission.
pub type Key = (String, u64, String);

pub trait Record: Serialize + DeserializeOwned {
    fn key(&self) -> Key;
}

#[derive(Debug)]
pub struct Table<R> {
    file: PathBuf,
    rows: Vec<R>,
}

impl<R: Record> Table<R> {
    /// The table in `file`: with its rows, or empty.
    pub fn open(file: &Path) -> Result<Self, FileError> {
        let mut table = Self { file: file.to_path_buf(), rows: Vec::new() };
        if file.exists() {
            let mut reader = csv::Reader::from_path(file).map_err(FileError::of("read", file))?;
            let whole = reader.deserialize().map_while(Result::ok);
            // A mission whose row was cut off is run again.
            table.rows = whole.collect();
        }
        table.save()?;
        Ok(table)
    }

    pub fn rows(&self) -> &[R] {
        &self.rows
    }

    pub fn add(&mut self, row: R) -> Result<(), FileError> {
        let opened = File::options().append(true).open(&self.file);
        let opened = opened.map_err(FileError::of("append to", &self.file))?;
        let mut writer =
            csv::WriterBuilder::new().has_headers(self.rows.is_empty()).from_writer(opened);
        let written = writer.serialize(&row).and_then(|()| Ok(writer.flush()?));
        written.map_err(FileError::of("append to", &self.file))?;
        self.rows.push(row);
        Ok(())
    }

    /// Sort the rows by world, seed and setting, and rewrite the file. If a mission has two rows, the later one stays.
    pub fn sort(&mut self) -> Result<(), FileError> {
        self.rows.reverse();
        self.rows.sort_by_key(R::key);
        self.rows.dedup_by_key(|row| row.key());
        self.save()
    }

    fn save(&self) -> Result<(), FileError> {
        let write = || -> Result<(), csv::Error> {
            let mut writer = csv::Writer::from_writer(Vec::new());
            self.rows.iter().try_for_each(|row| writer.serialize(row))?;
            let rows = writer.into_inner().map_err(csv::IntoInnerError::into_error)?;
            Ok(replace(&self.file, rows)?)
        };
        write().map_err(FileError::of("write", &self.file))
    }
}
