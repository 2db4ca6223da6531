//! The tables of an evaluation in its directory.

use std::path::Path;

use crate::{
    latency::Latency,
    row::Row,
    table::{Table, TableError},
};

/// In the directory: the rows.
const ROWS_FILE: &str = "rows.csv";
/// In the directory: how long ticks and solves took; apart from the rows, which are the same in every run.
const LATENCIES_FILE: &str = "latencies.csv";

/// What missions gave.
#[derive(Debug)]
pub struct Results {
    /// Their results.
    pub rows: Table<Row>,
    /// Their latencies.
    pub latencies: Table<Latency>,
}

impl Results {
    /// Those in `directory`, or empty ones.
    ///
    /// # Errors
    /// When they cannot be read or written.
    pub fn open(directory: &Path) -> Result<Self, TableError> {
        Ok(Self {
            rows: Table::open(&directory.join(ROWS_FILE))?,
            latencies: Table::open(&directory.join(LATENCIES_FILE))?,
        })
    }

    /// Sort both by world, seed and setting.
    ///
    /// # Errors
    /// When the disk is full, say.
    pub fn sort(&mut self) -> Result<(), TableError> {
        self.rows.sort()?;
        self.latencies.sort()
    }
}
