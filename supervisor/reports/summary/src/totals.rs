//! Totals of wheel commands and looks at each of the newest ticks, because ticks after the
//! mission's end may be read before the end is known.

use std::collections::VecDeque;

use common::samples::{CommandSample, CommandState, GuidanceSample, GuidanceStatus};

/// Stored ticks, enough for the arrival's when its command is read.
const MOST: usize = 1024;

#[derive(Clone, Default)]
pub(crate) struct Totals<T> {
    newest: VecDeque<(u64, T)>,
}

impl<T: Copy + Default> Totals<T> {
    /// A repeated tick counts once.
    pub(crate) fn add(&mut self, tick: u64, add: impl FnOnce(T) -> T) {
        let (last, totals) = self.newest.back().copied().unzip();
        if last.is_some_and(|last| tick <= last) {
            return;
        }
        if self.newest.len() == MOST {
            self.newest.pop_front();
        }
        self.newest.push_back((tick, add(totals.unwrap_or_default())));
        assert!(self.newest.len() <= MOST);
    }

    pub(crate) fn at(&self, tick: u64) -> T {
        self.newest
            .iter()
            .rev()
            .find(|(of, _)| *of <= tick)
            .map_or(T::default(), |&(_, totals)| totals)
    }
}

/// Extremes of both wheels' commanded speeds, rad/s.
#[derive(Clone, Copy, Default)]
pub(crate) struct WheelTotals {
    extremes: Option<[f64; 2]>,
}

impl WheelTotals {
    /// Adds a driving command; every mission begins and ends at rest.
    pub(crate) fn with(self, command: &CommandSample) -> Self {
        if command.state() != CommandState::Driving {
            return self;
        }
        let (left, right) = (command.left_rad_s, command.right_rad_s);
        let [least, greatest] = self.extremes.unwrap_or([f64::INFINITY, f64::NEG_INFINITY]);
        Self { extremes: Some([least.min(left).min(right), greatest.max(left).max(right)]) }
    }

    pub(crate) fn range_rad_s(self) -> Option<f64> {
        self.extremes.map(|[least, greatest]| greatest - least)
    }
}

#[derive(Clone, Copy, Default)]
pub(crate) struct LookTotals {
    pub looks: u64,
    pub ticks: u64,
    looking: bool,
}

impl LookTotals {
    pub(crate) fn with(self, guidance: &GuidanceSample) -> Self {
        let looking = guidance.status() == GuidanceStatus::Look;
        Self {
            looks: self.looks + u64::from(looking && !self.looking),
            ticks: self.ticks + u64::from(looking),
            looking,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_dynamic_range_is_over_both_wheels_and_commands_that_drive_up_to_the_tick_asked_for() {
        let mut totals = Totals::<WheelTotals>::default();
        let commands = [
            (CommandState::Halt, 0.0, 0.0),
            (CommandState::Driving, 2.0, 3.0),
            (CommandState::Driving, 1.5, 2.5),
            (CommandState::Arrived, 0.0, 0.0),
        ];
        for (tick, (state, left_rad_s, right_rad_s)) in (0..).zip(commands) {
            let command = CommandSample {
                left_rad_s,
                right_rad_s,
                state: state.into(),
                ..CommandSample::default()
            };
            totals.add(tick, |before| before.with(&command));
        }
        assert_eq!(totals.at(0).range_rad_s(), None);
        assert_eq!(totals.at(1).range_rad_s(), Some(1.0));
        assert_eq!(totals.at(3).range_rad_s(), Some(1.5));
    }
}
