//! The state that the missions of one chaos share.

use std::fs::File;

use crate::chaos::{
    options::Options,
    report::Report,
    schedule::Schedule,
    signals::{self, Row},
};
use crate::error::Result;

pub struct Series<'a> {
    pub options: &'a Options,
    pub schedule: Schedule,
    pub report: Report,
    /// The table of signals; none if no results are written.
    pub signals: Option<csv::Writer<File>>,
}

impl<'a> Series<'a> {
    pub fn new(options: &'a Options) -> Result<Self> {
        let out = options.asked.out.as_deref();
        Ok(Self {
            options,
            schedule: Schedule::new(options.asked.seed),
            report: Report::default(),
            signals: out.map(signals::create).transpose()?,
        })
    }

    /// Keep a signal whose measurement is complete.
    pub fn keep(&mut self, row: &Row) -> Result {
        self.report.add_recovery(row);
        self.signals.as_mut().map_or(Ok(()), |file| signals::add(row, file))
    }

    pub fn is_over(&self) -> bool {
        self.report.signals() >= self.options.asked.kills
    }
}
