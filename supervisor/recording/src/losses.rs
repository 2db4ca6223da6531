//! Which samples did not come: the numbers of a writer's samples follow each other.

use std::collections::{BTreeMap, HashMap};

use common::{
    bus::Stamp,
    samples::Name,
    topics::{EVERY_STAGE, OPERATOR, Spec},
};

/// Bytes of the stamp in a message, behind the encoding's header.
const STAMP: std::ops::Range<usize> = 4..28;

/// Counts what did not come, on one bus.
#[derive(Debug, Default)]
pub(crate) struct Losses {
    /// The sample that is next, by topic, stage where every stage writes, and generation.
    next: HashMap<(&'static str, Name, u32), u32>,
    counts: BTreeMap<&'static str, u64>,
    changed: bool,
}

impl Losses {
    /// A sample came.
    pub(crate) fn came(&mut self, spec: &Spec, stamp: &Stamp, message: &[u8]) {
        // Each request is a process of its own.
        if spec.writer == OPERATOR {
            return;
        }
        let stage = message.get(STAMP.end..).and_then(|rest| rest.first_chunk());
        let stage = stage.filter(|_| spec.writer == EVERY_STAGE);
        let key = (
            spec.name,
            stage.copied().unwrap_or_default(),
            stamp.generation,
        );
        let next = self.next.insert(key, stamp.sequence.wrapping_add(1));
        // Whoever attaches late has lost nothing.
        if let Some(missing) = next.and_then(|next| stamp.sequence.checked_sub(next))
            && missing > 0
        {
            *self.counts.entry(spec.name).or_default() += u64::from(missing);
            self.changed = true;
        }
    }

    /// The bus was replaced: all writers begin again.
    pub(crate) fn begin_again(&mut self) {
        self.next.clear();
    }

    /// How many of each topic, if that grew since this was last asked.
    pub(crate) fn grown(&mut self) -> Option<&BTreeMap<&'static str, u64>> {
        std::mem::take(&mut self.changed).then_some(&self.counts)
    }

    /// How many in all.
    pub(crate) fn total(&self) -> u64 {
        self.counts.values().sum()
    }
}
