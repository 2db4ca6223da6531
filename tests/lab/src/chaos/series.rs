//! The state that the missions of one chaos share.

use crate::chaos::{
    options::Options,
    report::Report,
    schedule::Schedule,
    signals::{Row, SignalsFile},
};
use crate::error::Result;

pub struct Series<'a> {
    pub options: &'a Options,
    pub schedule: Schedule,
    pub report: Report,
    /// The table of signals; none if no results are written.
    pub signals: Option<SignalsFile>,
}

impl<'a> Series<'a> {
    pub fn new(options: &'a Options) -> Result<Self> {
        let out = options.asked.out.as_deref();
        Ok(Self {
            options,
            schedule: Schedule::new(options.asked.seed),
            report: Report::default(),
            signals: out.map(SignalsFile::create).transpose()?,
        })
    }

    /// Keep a signal whose measurement is complete.
    pub fn keep(&mut self, row: &Row) -> Result {
        self.report.add_recovery(row);
        self.signals.as_mut().map_or(Ok(()), |file| file.add(row))
    }

    pub fn is_over(&self) -> bool {
        self.report.signals() >= self.options.asked.kills
    }
}
