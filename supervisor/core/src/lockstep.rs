//! The limit on ticks in lockstep: how far the link may be ahead of the supervisor, and the tick from which a recovery step holds.
//! Pure.
//!
//! The newest [`TickLimitSample`] names the last tick that the link may begin: [`AHEAD`] ticks after the last tick that was
//! checked for a stall. So a stall at tick T leaves the pipeline at rest after tick T + [`AHEAD`], on any machine. The recovery
//! step is carried out there, and the limit rises once the planner and, after a reset, the controller have answered it.
//! In wall-clock time nothing waits, and a recovery step is carried out at once.

use std::time::{Duration, Instant};

use common::samples::{RecoveryStep, StallSample, TickLimitSample};

/// The number of ticks that the link may be ahead. With this number the link seldom waits, and a robot that has not moved for
/// seconds loses little time.
const AHEAD: u64 = 4;
/// The longest time that a recovery step waits for its answer. It is less than the link waits for the limit, and as long as a
/// planner may take to start.
const ANSWERED: Duration = Duration::from_secs(3);

/// The newest output of the stages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Published {
    /// The tick of the newest command.
    pub tick: Option<u64>,
    pub commands: u64,
    /// The generation of the planner's newest heartbeat, and the tick of the newest grid that it has used.
    pub planner: (u32, u64),
    /// The epoch of the newest guidance.
    pub epoch: u64,
    pub grid_epoch: u64,
    /// Whether the grid changed when that epoch began. The planner does not answer a grid that did not change.
    pub grid_changed: bool,
}

/// The next action on the recovery step under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Next {
    /// No recovery step is under way, so further ticks are to be checked.
    Look,
    Wait,
    Begin(RecoveryStep),
}

/// A recovery step, from the stall until it was answered.
#[derive(Clone, Copy, Debug)]
struct Step {
    stall: StallSample,
    /// The time when the step was carried out, and the samples that were published by then.
    begun: Option<(Instant, Published)>,
}

/// The limit of the link, and the recovery step that it waits for.
#[derive(Debug)]
pub(crate) struct Lockstep {
    limit: TickLimitSample,
    step: Option<Step>,
}

impl Lockstep {
    /// The limit of a run whose ticks from `first_tick` on are not checked yet.
    pub(crate) fn new(first_tick: u64) -> Self {
        let limit = TickLimitSample { last_tick: first_tick + AHEAD, ..TickLimitSample::default() };
        Self { limit, step: None }
    }

    pub(crate) const fn limit(&self) -> TickLimitSample {
        self.limit
    }

    /// Note that all ticks up to `tick` are checked, and no recovery step is open.
    pub(crate) fn looked_at(&mut self, tick: u64) {
        self.limit.last_tick = self.limit.last_tick.max(tick + AHEAD);
    }

    /// Note that the robot stalled. Later ticks are not checked before the recovery step is in force.
    pub(crate) fn stalled(&mut self, stall: StallSample) {
        self.looked_at(stall.stamp.tick);
        self.step = Some(Step { stall, begun: None });
    }

    /// Whether `epoch`, the newest stall's, must not be published yet.
    pub(crate) fn withholds(&self, epoch: u64) -> bool {
        self.step.is_some_and(|step| {
            let forgets = step.stall.recovery() == RecoveryStep::Reset;
            forgets && step.stall.epoch == epoch && step.begun.is_none()
        })
    }

    /// The next action, given the output of the stages at `now`.
    pub(crate) fn next(&mut self, published: Published, now: Instant) -> Next {
        let Some(step) = &mut self.step else {
            return Next::Look;
        };
        let Some((since, before)) = step.begun else {
            let last = step.stall.stamp.tick + AHEAD;
            if published.tick.is_none_or(|tick| tick < last) {
                return Next::Wait;
            }
            step.begun = Some((now, published));
            return Next::Begin(step.stall.recovery());
        };
        let late = now.saturating_duration_since(since) >= ANSWERED;
        if !late && !is_answered(&step.stall, &before, &published) {
            return Next::Wait;
        }
        self.limit.holds_from_tick = published.tick.map_or(0, |tick| tick + 1);
        self.limit.epoch = step.stall.epoch;
        self.step = None;
        Next::Look
    }
}

/// Whether the stages have answered the recovery step of `stall`.
fn is_answered(stall: &StallSample, before: &Published, now: &Published) -> bool {
    let commanded = now.commands > before.commands;
    match stall.recovery() {
        // There is no pose to guide before the next tick, so a new planner has answered once it has a field.
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
    use common::samples::Stamp;

    use super::*;

    fn stall(recovery: RecoveryStep) -> StallSample {
        StallSample {
            stamp: Stamp { tick: 10, ..Stamp::default() },
            epoch: 1,
            recovery: recovery.into(),
            ..StallSample::default()
        }
    }

    #[test]
    fn a_recovery_step_begins_after_a_determined_tick_and_holds_from_the_next_once_it_was_answered()
    {
        let now = Instant::now();
        let at_rest =
            Published { tick: Some(14), commands: 15, planner: (1, 14), ..Published::default() };
        let replanned = Published { planner: (2, 14), ..at_rest };
        let reset = Published { grid_epoch: 1, grid_changed: true, ..at_rest };
        let steered = Published { commands: 16, epoch: 1, ..reset };
        let unchanged = Published { grid_changed: false, ..reset };
        use RecoveryStep::{Replan, Reset};
        #[rustfmt::skip]
        let rows = [
            (Replan, at_rest, false), (Replan, Published { planner: (2, 0), ..at_rest }, false), (Replan, replanned, true),
            (Reset, at_rest, false), (Reset, reset, false), (Reset, steered, true), (Reset, unchanged, true),
        ];
        for (recovery, published, answered) in rows {
            let mut lockstep = Lockstep::new(0);
            assert_eq!(lockstep.limit().last_tick, 4);
            lockstep.stalled(stall(recovery));
            assert_eq!(lockstep.limit().last_tick, 14);
            assert_eq!(lockstep.withholds(1), recovery == Reset);
            let early = Published { tick: Some(13), ..at_rest };
            assert_eq!(lockstep.next(early, now), Next::Wait);
            assert_eq!(lockstep.next(at_rest, now), Next::Begin(recovery));
            assert!(!lockstep.withholds(1));
            let next = if answered { Next::Look } else { Next::Wait };
            assert_eq!(lockstep.next(published, now), next, "{recovery:?} {published:?}");
            assert_eq!(lockstep.next(published, now + ANSWERED), Next::Look);
            let TickLimitSample { holds_from_tick, epoch, .. } = lockstep.limit();
            assert_eq!((holds_from_tick, epoch), (15, 1));
        }
    }
}
