//! The state that the missions of one chaos share.

use crate::chaos::{
    options::Options,
    report::Report,
    schedule::Schedule,
    signals::{Row, SignalsFile},
};
use crate::error::BenchError;

pub(crate) struct Series<'a> {
    pub(crate) options: &'a Options,
    pub(crate) schedule: Schedule,
    pub(crate) report: Report,
    /// The table of signals; none if no results are written.
    pub(crate) signals: Option<SignalsFile>,
}

impl<'a> Series<'a> {
    pub(crate) fn new(options: &'a Options) -> Result<Self, BenchError> {
        let out = options.asked.out.as_deref();
        Ok(Self {
            options,
            schedule: Schedule::new(options.asked.seed),
            report: Report::default(),
            signals: out.map(SignalsFile::create).transpose()?,
        })
    }

    /// Write the row of a signal.
    pub(crate) fn keep(&mut self, row: &Row) -> Result<(), BenchError> {
        match &mut self.signals {
            Some(file) => Ok(file.add(row)?),
            None => Ok(()),
        }
    }

    pub(crate) fn is_over(&self) -> bool {
        self.report.signals() >= self.options.asked.kills
    }
}
