use std::{collections::BTreeMap, fmt};

use serde::Serialize;

#[derive(Debug, Default, Serialize)]
pub struct Report {
    pub stages: BTreeMap<&'static str, StageReport>,
    pub difference: Option<Difference>,
    /// Time of the cut, seconds after the first message; `None` if complete.
    pub cut_after_s: Option<f64>,
}

#[derive(Debug, Default, Serialize)]
pub struct StageReport {
    /// Generations whose outputs are equal to the bit.
    pub equal: u64,
    pub different: u64,
    /// Generations that ended before their first input.
    pub without_step: u64,
    /// Generations that were not replayed, with reasons.
    pub not_replayed: BTreeMap<u32, String>,
    pub inputs: u64,
    pub compared: u64,
    /// Samples that were computed but not recorded.
    pub unrecorded: u64,
}

#[derive(Debug, PartialEq, Serialize)]
pub struct Difference {
    pub stage: &'static str,
    pub generation: u32,
    pub tick: u64,
    pub topic: String,
    /// Field name, with its index if it is part of a slice.
    pub field: String,
    pub recorded: String,
    pub computed: String,
    pub inputs: Vec<String>,
}

impl Report {
    pub fn equal(&self) -> u64 {
        self.stages.values().map(|stage| stage.equal).sum()
    }

    pub fn not_replayed(&self) -> usize {
        self.stages.values().map(|stage| stage.not_replayed.len()).sum()
    }

    /// Stores `difference` if its tick precedes the stored one's.
    pub(crate) fn differs(&mut self, difference: Difference) {
        let later = |first: &Difference| first.tick > difference.tick;
        if self.difference.as_ref().is_none_or(later) {
            self.difference = Some(difference);
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            to,
            "stage              bit-equal different without step not replayed    inputs  compared unrecorded"
        )?;
        for (stage, found) in &self.stages {
            writeln!(
                to,
                "{stage:<16} {:>11} {:>9} {:>12} {:>12} {:>9} {:>9} {:>10}",
                found.equal,
                found.different,
                found.without_step,
                found.not_replayed.len(),
                found.inputs,
                found.compared,
                found.unrecorded
            )?;
        }
        for (stage, found) in &self.stages {
            for (generation, why) in &found.not_replayed {
                writeln!(to, "{stage} generation {generation} was not replayed: {why}")?;
            }
        }
        if let Some(after) = self.cut_after_s {
            writeln!(to, "the recording is cut off after {after:.1} s")?;
        }
        match &self.difference {
            None => Ok(()),
            Some(difference) => write!(to, "{difference}"),
        }
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            to,
            "first difference: tick {}, {} of {} generation {}, field {}\n  recorded {}\n  computed {}",
            self.tick,
            self.topic,
            self.stage,
            self.generation,
            self.field,
            self.recorded,
            self.computed
        )?;
        for input in &self.inputs {
            writeln!(to, "  from     {input}")?;
        }
        Ok(())
    }
}
