//! The result of live stages.

use std::{collections::BTreeMap, fmt};

use serde::Serialize;

use crate::replay::samples::First;

/// The comparison of live samples with recorded ones.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LiveReport {
    pub stages: BTreeMap<&'static str, LiveStageReport>,
    /// The first difference between a live sample and the recorded one.
    pub first: Option<First>,
    pub played: u64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LiveStageReport {
    /// Ticks that both the live and the recorded stage answered.
    pub answered: u64,
    /// The number of these ticks that have equal values.
    pub equal: u64,
    /// Ticks that only the recorded stage answered in time.
    pub unanswered: u64,
}

impl fmt::Display for LiveReport {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(to, "{} samples played", self.played)?;
        if self.stages.is_empty() {
            return Ok(());
        }
        writeln!(
            to,
            "{:<16} {:>9} {:>12} {:>11}",
            "live stage", "answered", "as recorded", "unanswered"
        )?;
        for (stage, found) in &self.stages {
            let LiveStageReport { answered, equal, unanswered } = found;
            writeln!(to, "{stage:<16} {answered:>9} {equal:>12} {unanswered:>11}")?;
        }
        let Some(first) = &self.first else {
            return Ok(());
        };
        let [recorded, live] = &first.values;
        writeln!(
            to,
            "first difference: tick {}, {:.3} s: {} of {}, field {}\n  recorded {recorded}\n  live     {live}",
            first.tick, first.time_s, first.topic, first.writer, first.field
        )
    }
}
