//! Detection of missing and repeated samples by sequence number.

use std::collections::{BTreeMap, HashMap};

use common::{
    bus::Stamp,
    samples::Name,
    topics::{EVERY_STAGE, OPERATOR, Spec},
};

/// Bytes of the stamp in a message, after the encoding's header.
const STAMP: std::ops::Range<usize> = 4..28;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Last {
    sequence: u32,
    crc32: u32,
    bus: u32,
}

#[derive(Default)]
pub(crate) struct Losses {
    /// Whether the recorder preceded all writers, so that missing first samples are losses.
    whole: bool,
    /// Last sample by topic, stage (if every stage writes the topic) and generation.
    last: HashMap<(&'static str, Name, u32), Last>,
    bus: u32,
    counts: BTreeMap<&'static str, u64>,
    changed: bool,
}

impl Losses {
    pub(crate) fn new(whole: bool) -> Self {
        Self { whole, ..Self::default() }
    }

    /// Takes a sample. Returns whether it is new: a rejoined bus repeats each writer's last sample.
    pub(crate) fn came(&mut self, spec: &Spec, stamp: &Stamp, message: &[u8]) -> bool {
        // Each request has its own writer.
        if spec.writer == OPERATOR {
            return true;
        }
        const { assert!(STAMP.end - STAMP.start == size_of::<Stamp>()) };
        let stage = message
            .get(STAMP.end..)
            .and_then(|rest| rest.first_chunk())
            .filter(|_| spec.writer == EVERY_STAGE);
        let key = (spec.name, stage.copied().unwrap_or_default(), stamp.generation);
        let now = Last { sequence: stamp.sequence, crc32: crc32fast::hash(message), bus: self.bus };
        let last = self.last.insert(key, now);
        let next = match last {
            Some(last) => (last.bus == now.bus).then(|| last.sequence.wrapping_add(1)),
            None => self.whole.then_some(0),
        };
        let missing = next.and_then(|next| stamp.sequence.checked_sub(next)).unwrap_or(0);
        if missing > 0 {
            *self.counts.entry(spec.name).or_default() += u64::from(missing);
            self.changed = true;
        }
        last.is_none_or(|last| (now.sequence, now.crc32) != (last.sequence, last.crc32))
    }

    /// Records that a bus was joined, perhaps the same again. Samples of restarted writers cannot
    /// be counted.
    pub(crate) const fn joined_again(&mut self) {
        self.bus += 1;
    }

    /// Returns the losses by topic, if they grew since the last call.
    pub(crate) fn grown(&mut self) -> Option<&BTreeMap<&'static str, u64>> {
        assert!(!self.changed || self.total() > 0);
        std::mem::take(&mut self.changed).then_some(&self.counts)
    }

    pub(crate) const fn counts(&self) -> &BTreeMap<&'static str, u64> {
        &self.counts
    }

    pub(crate) fn total(&self) -> u64 {
        self.counts.values().sum()
    }
}

#[cfg(test)]
mod tests {
    use common::topics::POSE;

    use super::*;

    fn came(losses: &mut Losses, sequence: u32) -> bool {
        let stamp = Stamp { sequence, generation: 1, ..Stamp::default() };
        losses.came(POSE.spec(), &stamp, &sequence.to_le_bytes())
    }

    #[test]
    fn a_sample_that_is_given_again_is_not_new_and_those_that_did_not_come_are_counted() {
        let mut losses = Losses::default();
        let new = [3, 4, 4, 7].map(|sequence| came(&mut losses, sequence));
        assert_eq!((new, losses.total()), ([true, true, false, true], 2));
    }

    #[test]
    fn the_last_sample_is_not_new_after_the_same_bus_was_joined_again() {
        let mut losses = Losses::default();
        let new = [7, 7, 9, 0].map(|sequence| {
            let new = came(&mut losses, sequence);
            losses.joined_again();
            new
        });
        assert_eq!((new, losses.total()), ([true, false, true, true], 0));
    }

    #[test]
    fn first_samples_that_did_not_come_are_lost_to_a_recorder_that_was_there_before_the_writer() {
        let lost = |whole: bool| {
            let mut losses = Losses::new(whole);
            assert!(came(&mut losses, 5));
            losses.total()
        };
        assert_eq!([lost(true), lost(false)], [5, 0]);
    }
}
