//! Current target, as a stage follows it on topic `target`, and whether the robot has reached it.

use crate::{bus::Reader, samples::TargetSample, start::Result};

#[derive(Debug)]
pub struct TargetReader {
    samples: Reader<TargetSample>,
    newest: Option<TargetSample>,
    taken: Option<u64>,
}

impl From<Reader<TargetSample>> for TargetReader {
    fn from(samples: Reader<TargetSample>) -> Self {
        Self { samples, newest: None, taken: None }
    }
}

impl TargetReader {
    /// Returns a new target that holds in `tick`.
    pub fn next(&mut self, tick: u64) -> Result<Option<TargetSample>> {
        self.newest = self.samples.newest()?.or(self.newest);
        Ok(self.newest.filter(|newest| takes(&mut self.taken, newest, tick)))
    }
}

/// Number of the target that the robot has reached; 0 for none.
///
/// A target stays reached within twice the tolerance. A robot at rest on the circle's edge stays
/// for one count, one that slips while it turns goes on, and one whose stop was lost drives back.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reached(u64);

impl Reached {
    /// Returns whether a robot at `distance` from target `number` has reached it. Beside a target
    /// in a hazard it has, at any distance.
    pub fn is(&mut self, number: u64, distance: f64, tolerance: f64, beside: bool) -> bool {
        let most = if self.0 == number { 2.0 * tolerance } else { tolerance };
        let is = number != 0 && (beside || distance <= most);
        self.0 = if is { number } else { 0 };
        is
    }
}

fn takes(taken: &mut Option<u64>, newest: &TargetSample, tick: u64) -> bool {
    // A new generation takes any target, because it has none.
    let is_due = |number| newest.number > number && tick >= newest.since_tick;
    let takes = taken.is_none_or(is_due);
    if takes {
        *taken = Some(newest.number);
    }
    takes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_taken_once_and_in_its_tick_but_by_a_stage_that_has_none_at_once() {
        let sample =
            |number, since_tick| TargetSample { number, since_tick, ..TargetSample::default() };
        // The start, where a robot waits.
        assert!(takes(&mut None, &sample(0, 0), 3));
        let mut taken = None;
        let mut takes = |sample, tick| takes(&mut taken, &sample, tick);
        // None before.
        assert!(takes(sample(2, 9), 3));
        // It is taken.
        assert!(!takes(sample(2, 9), 9));
        // An older one.
        assert!(!takes(sample(1, 0), 9));
        // Early.
        assert!(!takes(sample(3, 12), 11));
        assert!(takes(sample(3, 12), 12));
    }
}
