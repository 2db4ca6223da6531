//! The monitor of the supervisor's directives and of an operator's stop at the link.

use std::time::Duration;

use common::{
    mission::Mission,
    samples::{Cause, HoldReason, Order},
};

use super::monitor::{Condition, Moment, Monitor, Observation};

/// A silent supervisor has ended. Ten times the interval of directives, so that a loaded machine does not stop the robot, and a second
/// before systemd's watchdog would kill the supervisor.
pub(crate) const SUPERVISOR_SILENT: Duration = Duration::from_secs(2);

#[derive(Clone, Copy, Debug)]
struct Directive {
    order: Order,
    reason: HoldReason,
    heard_ns: u64,
}

#[derive(Clone, Debug)]
pub struct Orders {
    newest: Option<Directive>,
    stopped_here: bool,
}

impl Orders {
    pub fn drive(&self) -> bool {
        self.is(Order::Drive)
    }

    pub fn by_operator(&self) -> bool {
        self.stopped_here
            || self.newest.is_some_and(|directive| directive.reason == HoldReason::Operator)
    }

    /// The robot stands by and its ticks go on: it is known where it is, also if it is carried.
    pub fn stands_by(&self) -> bool {
        self.by_operator()
            || self.newest.is_some_and(|directive| {
                matches!(directive.reason, HoldReason::Waiting | HoldReason::Lost)
            })
    }

    pub const fn stopped_here(&self) -> bool {
        self.stopped_here
    }

    /// An operator's stop or resume came to the link itself. A supervisor that has not heard of this stop does not end it.
    pub const fn stop_here(&mut self, stop: bool) {
        self.stopped_here = stop;
    }

    fn is(&self, order: Order) -> bool {
        self.newest.is_some_and(|directive| directive.order == order)
    }

    fn held(&self) -> Option<HoldReason> {
        let directive = self.newest?;
        (directive.order == Order::Hold).then_some(directive.reason)
    }
}

impl Monitor for Orders {
    fn new(_: &Mission) -> Self {
        Self { newest: None, stopped_here: false }
    }

    fn observe(&mut self, what: &Observation<'_>, now: Moment) {
        if let Observation::Directive(order, reason) = *what {
            self.newest = Some(Directive { order, reason, heard_ns: now.machine_ns });
        }
    }

    fn condition(&self, cause: Cause, now: Moment) -> Condition {
        let age = |directive: Directive| now.machine_ns.saturating_sub(directive.heard_ns);
        let holds = match (cause, self.held()) {
            (Cause::MissionOver, _) => self.is(Order::Stop),
            (Cause::OperatorStop, held) => self.stopped_here || held == Some(HoldReason::Operator),
            (Cause::StageHeld, held) => held == Some(HoldReason::StageHeld),
            (Cause::SupervisorSilent, _) => self
                .newest
                .is_some_and(|newest| u128::from(age(newest)) > SUPERVISOR_SILENT.as_nanos()),
            (_, Some(HoldReason::Operator | HoldReason::StageHeld)) => false,
            (_, held) => held.is_some() || self.newest.is_none(),
        };
        holds.into()
    }

    fn judges_frames(&self) -> bool {
        false
    }
}
