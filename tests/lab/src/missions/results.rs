//! The tables of an evaluation in its directory.

use std::path::Path;

use common::file::FileError;

use crate::missions::{latency::Latency, row::Row, table::Table};

const ROWS_FILE: &str = "rows.csv";
/// Name of the file of latencies. The rows are the same in every run, latencies are not.
const LATENCIES_FILE: &str = "latencies.csv";

#[derive(Debug)]
pub struct Results {
    pub rows: Table<Row>,
    pub latencies: Table<Latency>,
}

impl Results {
    /// The tables in `directory`, or empty ones.
    pub fn open(directory: &Path) -> Result<Self, FileError> {
        Ok(Self {
            rows: Table::open(&directory.join(ROWS_FILE))?,
            latencies: Table::open(&directory.join(LATENCIES_FILE))?,
        })
    }

    pub fn sort(&mut self) -> Result<(), FileError> {
        self.rows.sort()?;
        self.latencies.sort()
    }
}
