//! Recovery step in progress after a stall, and the tick from which checks continue. Pure.
//!
//! In wall-clock time a step is immediate. In lockstep its result must be independent of the
//! machine. So the newest [`TickLimitSample`] names the last tick that the link may begin,
//! [`AHEAD`] ticks after the last checked one. A stall at tick T stops the pipeline after tick T +
//! [`AHEAD`], where the step is carried out. The limit rises once the planner and, after a reset,
//! the controller have answered.

use std::time::Duration;

use common::{
    clock::Instant,
    samples::{RecoveryStep, StallSample, TickLimitSample},
};

use crate::{observer::Published, run::CAUGHT_UP_EVERY};

/// Ticks that the link may be ahead: a stalled robot loses little time, and the link seldom waits.
const AHEAD: u64 = 4;
/// Timeout for the answer to a recovery step: a planner's longest start, shorter than the link
/// waits for the limit.
const ANSWERED: Duration = Duration::from_secs(3);

#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Next {
    /// No step in progress; checks continue.
    Check,
    Wait,
    Begin(RecoveryStep),
}

pub(crate) struct RecoverySteps {
    /// Limit of the link; `None` in wall-clock time.
    pub limit: Option<TickLimitSample>,
    /// Stall, time of its step, and the samples published by then.
    step: Option<(StallSample, Option<(Instant, Published)>)>,
}

impl RecoverySteps {
    /// Starts with all ticks from `first_tick` on unchecked; `None` in wall-clock time.
    pub(crate) fn new(first_tick: Option<u64>) -> Self {
        const { assert!(AHEAD < CAUGHT_UP_EVERY) };
        let limit = first_tick.map(|first_tick| TickLimitSample {
            last_tick: first_tick + AHEAD,
            ..TickLimitSample::default()
        });
        Self { limit, step: None }
    }

    pub(crate) fn on_checked(&mut self, tick: u64) {
        if let Some(limit) = &mut self.limit {
            limit.last_tick = limit.last_tick.max(tick + AHEAD);
        }
    }

    /// Records a stall. Later ticks stay unchecked until the step takes effect.
    pub(crate) fn on_stall(&mut self, stall: StallSample) {
        assert!(self.step.is_none());
        self.on_checked(stall.stamp.tick);
        self.step = Some((stall, None));
    }

    /// Returns whether `epoch`, the newest stall's, must be withheld.
    pub(crate) fn withholds(&self, epoch: u64) -> bool {
        self.step.is_some_and(|(stall, begun)| {
            let forgets = stall.recovery() == RecoveryStep::Reset;
            forgets && stall.epoch == epoch && begun.is_none()
        })
    }

    pub(crate) fn next(&mut self, published: Published, now: Instant) -> Next {
        let Some((stall, begun)) = &mut self.step else {
            return Next::Check;
        };
        let stall = *stall;
        let Some(limit) = &mut self.limit else {
            self.step = None;
            return Next::Begin(stall.recovery());
        };
        let Some((since, before)) = *begun else {
            if published.tick.is_none_or(|tick| tick < stall.stamp.tick + AHEAD) {
                return Next::Wait;
            }
            *begun = Some((now, published));
            return Next::Begin(stall.recovery());
        };
        let late = now.saturating_duration_since(since) >= ANSWERED;
        if !late && !is_answered(&stall, &before, &published) {
            return Next::Wait;
        }
        limit.holds_from_tick = published.tick.map_or(0, |tick| tick + 1);
        debug_assert!(limit.epoch <= stall.epoch);
        limit.epoch = stall.epoch;
        self.step = None;
        Next::Check
    }
}

fn is_answered(stall: &StallSample, before: &Published, now: &Published) -> bool {
    let commanded = now.commands > before.commands;
    match stall.recovery() {
        // Before the next tick there is no pose, so a field is a new planner's answer.
        RecoveryStep::Replan => {
            now.planner.0 > before.planner.0 && now.planner.1 >= stall.stamp.tick + AHEAD
        }
        RecoveryStep::Reset => {
            let guided = commanded && now.epoch >= stall.epoch;
            now.grid_epoch >= stall.epoch && (guided || !now.grid_changed)
        }
        RecoveryStep::GiveUp => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::samples::Stamp;

    #[test]
    fn a_stall_is_answered_by_a_new_planner_that_has_the_map_of_the_last_tick() {
        let stamp = Stamp { tick: 10, ..Stamp::default() };
        let recovery = RecoveryStep::Replan.into();
        let stall = StallSample { stamp, recovery, ..StallSample::default() };
        let published = |planner| Published { planner, ..Published::default() };
        for (planner, answers) in [((1, 14), true), ((1, 13), false), ((0, 14), false)] {
            let now = published(planner);
            assert_eq!(is_answered(&stall, &published((0, 9)), &now), answers, "{planner:?}");
        }
    }
}
