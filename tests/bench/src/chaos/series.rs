//! What the missions of one chaos have in common.

use crate::chaos::{
    error::ChaosError,
    options::Options,
    report::Report,
    schedule::Schedule,
    signals::{Row, SignalsFile},
};

/// What the missions of one chaos have in common.
pub(crate) struct Series<'a> {
    pub(crate) options: &'a Options,
    pub(crate) schedule: Schedule,
    pub(crate) report: Report,
    /// Where results are kept.
    pub(crate) signals: Option<SignalsFile>,
}

impl<'a> Series<'a> {
    pub(crate) fn new(options: &'a Options) -> Result<Self, ChaosError> {
        let out = options.out.as_deref();
        Ok(Self {
            options,
            schedule: Schedule::new(options.seed),
            report: Report::new(),
            signals: out.map(SignalsFile::create).transpose()?,
        })
    }

    /// Keep all that is known of a signal.
    pub(crate) fn keep(&mut self, row: &Row) -> Result<(), ChaosError> {
        match &mut self.signals {
            Some(file) => Ok(file.add(row)?),
            None => Ok(()),
        }
    }

    /// Whether enough signals were sent.
    pub(crate) fn is_over(&self) -> bool {
        self.report.signals() >= self.options.kills
    }
}
