//! Counts of a robot's two wheels, and their differences.

use crate::{
    samples::{CountsSample, WheelSample},
    wire::{COUNT_CYCLE, counts_between},
};

/// Most counts of a freshly booted robot, which stands.
const BOOTED_WITHIN: f64 = 4.0;
/// Longest step that always counts as motion; 14 mm for an X80.
const NOT_WORTH_TELLING: f64 = 32.0;

/// Wheel counts. A board's counter wraps around; counts from angles or odometry in SI units are
/// unbounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WheelCounts {
    Cyclic([u16; 2]),
    Endless([f64; 2]),
}

impl WheelCounts {
    pub fn of(wheels: &WheelSample, endless: Option<&CountsSample>) -> Self {
        let endless = endless.map(|counts| [counts.left_counts, counts.right_counts]);
        // Any process may have written them.
        match endless.filter(|counts| counts.iter().all(|count| count.is_finite())) {
            Some(counts) => Self::Endless(counts),
            None => Self::Cyclic([wheels.left_counts, wheels.right_counts]),
        }
    }

    pub fn cyclic(self) -> [u16; 2] {
        match self {
            Self::Cyclic(counts) => counts,
            Self::Endless(counts) => {
                // A float slightly below 0 would round up to a whole cycle.
                counts.map(|count| (count.floor() as i64).rem_euclid(COUNT_CYCLE.into()) as u16)
            }
        }
    }

    /// Returns the counts of each wheel since `before`, the shorter way round if either is cyclic.
    pub fn since(self, before: Self) -> [f64; 2] {
        if let (Self::Endless(new), Self::Endless(old)) = (self, before) {
            return [0, 1].map(|wheel| new[wheel] - old[wheel]);
        }
        let new = self.cyclic();
        let old = before.cyclic();
        [0, 1].map(|wheel| counts_between(old[wheel], new[wheel]).into())
    }

    /// Returns whether the robot probably booted after `before`: these counts are near the boot
    /// value, and those were not. So are those of a robot that drove back to its start; a caller
    /// with frames in between needs further evidence.
    pub fn restarted_since(self, before: Self) -> bool {
        let start = match self {
            Self::Cyclic(_) => Self::Cyclic([0; 2]),
            Self::Endless(_) => Self::Endless([0.0; 2]),
        };
        let at_start = self.since(start).iter().all(|counts| counts.abs() <= BOOTED_WITHIN);
        at_start && self.since(before).iter().any(|counts| counts.abs() > NOT_WORTH_TELLING)
    }
}

impl From<[u16; 2]> for WheelCounts {
    fn from(counts: [u16; 2]) -> Self {
        Self::Cyclic(counts)
    }
}

/// Takes speeds in counts/s.
pub fn wheel_sample(
    [left_counts, right_counts]: [u16; 2],
    [left_counts_per_s, right_counts_per_s]: [i32; 2],
) -> WheelSample {
    WheelSample {
        left_counts,
        right_counts,
        left_counts_per_s,
        right_counts_per_s,
        ..WheelSample::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use WheelCounts::*;

    #[test]
    fn endless_counts_have_no_cycle_and_agree_with_cyclic_ones_on_a_short_way() {
        let far = [20_000.0, -70_000.0];
        let (before, after) = (Endless([-5.0; 2]), Endless(far));
        assert_eq!(after.since(before), [20_005.0, -69_995.0]);
        assert!(!Endless([32_768.0; 2]).restarted_since(after));
        assert!(Endless([3.0, -2.0]).restarted_since(after));
        let near = Cyclic([32_760, 10]);
        assert_eq!(Endless([2.0, 20.0]).since(near), [10.0, 10.0]);
        assert_eq!(Endless([-1e-20, 32_768.5]).cyclic(), [32_767, 0]);
        let hostile = CountsSample { left_counts: f64::NAN, ..CountsSample::default() };
        let counts = WheelCounts::of(&WheelSample::default(), Some(&hostile));
        assert_eq!(counts, Cyclic([0; 2]));
    }
}
