//! Whether the robot may drive, and whoever must know it told: stages, consumers, operators.

use std::time::Instant;

use common::{
    samples::{DirectiveSample, HoldReason, Order, RequestKind, RosterHeader, name_str},
    topics,
};

use super::{Supervisor, SupervisorError};

impl Supervisor<'_> {
    /// Do what operators ask. Says whether anything was asked.
    pub(super) fn take_requests(&mut self, first_tick: u64) -> Result<bool, SupervisorError> {
        let mut asked = false;
        while let Some(request) = self.ends.requests.take()? {
            asked = true;
            self.last_request = request.id;
            let stage = name_str(&request.stage);
            match RequestKind::from_byte(request.kind) {
                RequestKind::Nothing => {}
                RequestKind::Restart => {
                    tracing::warn!(stage, "an operator asks for a fresh life");
                    self.stages.replace(stage, first_tick)?;
                }
                RequestKind::Stop => {
                    tracing::warn!("an operator says stop");
                    self.hold_for_operator(true)?;
                }
                RequestKind::Resume => {
                    tracing::warn!("an operator says resume");
                    self.hold_for_operator(false)?;
                }
            }
        }
        Ok(asked)
    }

    /// SupervisorState at once: a robot that was told to stand still stands when another supervises it.
    pub(super) fn hold_for_operator(&mut self, hold: bool) -> Result<(), SupervisorError> {
        self.state_file.state.operator_stop = hold;
        Ok(self.state_file.keep()?)
    }

    /// Whether the robot may drive, and if not, why. Says whether that changed.
    pub(super) fn decide_order(&mut self) -> bool {
        if self.order == Order::Stop {
            return false;
        }
        if !self.ready && self.stages.all_running() && self.can_drive() {
            tracing::info!("all stages ready");
            self.ready = true;
            self.service.ready();
        }
        let reason = if !self.ready {
            HoldReason::Starting
        } else if self.state_file.state.operator_stop {
            HoldReason::Operator
        } else if self.stages.held().next().is_some() {
            HoldReason::StageHeld
        } else {
            HoldReason::None
        };
        if reason == self.reason {
            return false;
        }
        tracing::info!(?reason, "order");
        self.reason = reason;
        self.order = if reason == HoldReason::None {
            Order::Drive
        } else {
            Order::Hold
        };
        self.progressed = (None, Instant::now());
        true
    }

    /// Whether the robot answers, and there is a field to follow: the first tick should not wait for it.
    pub(super) fn can_drive(&self) -> bool {
        self.robot_answers() && self.observer.record.field.frame().is_some()
    }

    pub(super) fn robot_answers(&self) -> bool {
        let link = self.observer.record.link;
        link.is_some_and(|link| link.connected == 1)
    }

    /// Say again what late joiners need; a few times a second. Says whether it did.
    pub(super) fn restate_if_due(&mut self) -> Result<bool, SupervisorError> {
        let due = self
            .restated
            .is_none_or(|last| last.elapsed() >= topics::RESTATE);
        if due {
            self.restate()?;
        }
        Ok(due)
    }

    pub(super) fn restate(&mut self) -> Result<(), SupervisorError> {
        self.restated = Some(Instant::now());
        self.state_file.keep()?;
        // A stage that another starts takes its first tick from here: it must not be one that was made.
        let tick = self.first_tick().saturating_sub(1);
        let pose = self.observer.record.pose;
        let time = pose.map_or(self.beginning.1, |pose| pose.stamp.time());
        let directive = DirectiveSample {
            order: self.order.into(),
            reason: self.reason.into(),
            epoch: self.stall.epoch(),
            ..DirectiveSample::default()
        };
        self.ends.directive.publish(tick, time, directive)?;
        let header = RosterHeader {
            supervisor_pid: std::process::id(),
            order: self.order.into(),
            reason: self.reason.into(),
            simulated: self.simulator.is_some().into(),
            last_request: self.last_request,
            ..RosterHeader::default()
        };
        self.ends
            .roster
            .publish(tick, time, header, self.stages.roster().into_iter())?;
        Ok(())
    }
}
