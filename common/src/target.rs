//! The target, as a stage follows it on topic `target`.

use crate::{bus::Reader, samples::TargetSample, start::StageError};

#[derive(Debug)]
pub struct TargetReader {
    samples: Reader<TargetSample>,
    newest: Option<TargetSample>,
    taken: Taken,
}

#[derive(Debug, Default)]
struct Taken {
    number: Option<u64>,
}

impl From<Reader<TargetSample>> for TargetReader {
    fn from(samples: Reader<TargetSample>) -> Self {
        Self { samples, newest: None, taken: Taken::default() }
    }
}

impl TargetReader {
    /// The target that holds in `tick`, if it is not the one that was returned last.
    pub fn next(&mut self, tick: u64) -> Result<Option<TargetSample>, StageError> {
        self.newest = self.samples.newest()?.or(self.newest);
        Ok(self.newest.filter(|newest| self.taken.takes(newest, tick)))
    }
}

impl Taken {
    fn takes(&mut self, newest: &TargetSample, tick: u64) -> bool {
        let takes = match self.number {
            // Any target is better than none: the stage may be a new generation.
            None => newest.number != 0,
            Some(number) => newest.number > number && tick >= newest.since_tick,
        };
        if takes {
            self.number = Some(newest.number);
        }
        takes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_taken_once_and_in_its_tick_but_by_a_stage_that_has_none_at_once() {
        let sample =
            |number, since_tick| TargetSample { number, since_tick, ..TargetSample::default() };
        let mut taken = Taken::default();
        assert!(!taken.takes(&sample(0, 0), 3), "no target");
        assert!(taken.takes(&sample(2, 9), 3), "none before");
        assert!(!taken.takes(&sample(2, 9), 9), "it is taken");
        assert!(!taken.takes(&sample(1, 0), 9), "an older one");
        assert!(!taken.takes(&sample(3, 12), 11), "early");
        assert!(taken.takes(&sample(3, 12), 12));
    }
}
