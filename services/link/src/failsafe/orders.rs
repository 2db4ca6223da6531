//! Monitor of the supervisor's directives and of operators' stops at the link.

use std::time::Duration;

use common::{
    mission::Mission,
    samples::{Cause, HoldReason, Order},
};

use super::monitor::{Condition, Moment, Monitor, Observation};

/// Silence of an ended supervisor: ten directive intervals, so that load does not stop the robot,
/// and a second before systemd's watchdog would kill it.
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
    /// Operator's stop at the link. A supervisor that missed it does not end it.
    pub(crate) stopped_here: bool,
}

impl Orders {
    pub fn drive(&self) -> bool {
        self.is(Order::Drive)
    }

    pub fn by_operator(&self) -> bool {
        self.stopped_here
            || self.newest.is_some_and(|directive| directive.reason == HoldReason::Operator)
    }

    /// Returns whether the robot stands while ticks go on, so that it stays localized if carried.
    pub fn stands_by(&self) -> bool {
        self.by_operator()
            || self.newest.is_some_and(|directive| {
                matches!(directive.reason, HoldReason::Waiting | HoldReason::Lost)
            })
    }

    fn is(&self, order: Order) -> bool {
        self.newest.is_some_and(|directive| directive.order == order)
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
        let age = |directive: Directive| {
            Duration::from_nanos(now.machine_ns.saturating_sub(directive.heard_ns))
        };
        let held = self.newest.filter(|newest| newest.order == Order::Hold);
        let holds = match (cause, held.map(|directive| directive.reason)) {
            (Cause::MissionOver, _) => self.is(Order::Stop),
            (Cause::OperatorStop, held) => self.stopped_here || held == Some(HoldReason::Operator),
            (Cause::StageHeld, held) => held == Some(HoldReason::StageHeld),
            (Cause::SupervisorSilent, _) => self.newest.map(age) > Some(SUPERVISOR_SILENT),
            (_, Some(HoldReason::Operator | HoldReason::StageHeld)) => false,
            (_, held) => held.is_some() || self.newest.is_none(),
        };
        holds.into()
    }

    fn judges_frames(&self) -> bool {
        false
    }
}
