//! The server of the action `navigate_to_pose`. Pure.
//!
//! A goal is reached when the controller reports the arrival at the target that the supervisor made of the goal.

use common::samples::{
    CommandSample, CommandState, DirectiveSample, HoldReason, PoseSample, TargetPoint, TargetSample,
};
use ros2::cdr::{Reader, Writer};

use crate::{
    asked::goal_of,
    goals::{Goals, Status, Uuid, uuid},
    messages::{Header, pose_stamped},
    shown::MAP,
};

/// The target of a goal.
#[derive(Clone, Debug, Default)]
pub(crate) struct Aim {
    point: TargetPoint,
    /// The number of the goal's target, once the supervisor has published it.
    number: Option<u64>,
    /// The robot waits although it did not arrive. Its arrival may still be read: it waits if it is told so again.
    waits: bool,
    /// The number of the newest target that is older than the goal.
    after: u64,
}

/// The server's goals.
#[derive(Debug, Default)]
pub(crate) struct Server {
    pub(crate) goals: Goals<Aim>,
    /// The number of the newest target, which the target of a goal that is sent now follows; another run counts from 1.
    pub(crate) newest_target: u64,
}

/// A goal that a client sends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sent {
    pub(crate) id: Uuid,
    pub(crate) point: TargetPoint,
}

impl Server {
    /// The goal that a client sends. The error says why the payload is none.
    pub(crate) fn read_goal(payload: &[u8]) -> Result<Sent, String> {
        let mut reader = Reader::new(payload)?;
        let id = uuid(&mut reader)?;
        Ok(Sent { id, point: goal_of(&mut reader)? })
    }

    /// Take a goal that the supervisor accepted; its target comes after the one with the number `after`.
    pub(crate) fn accept(&mut self, sent: Sent, after: u64, now_ns: u64) {
        let aim = Aim { point: sent.point, after, ..Aim::default() };
        self.goals.accept(sent.id, aim, now_ns);
    }

    pub(crate) fn target(&mut self, target: &TargetSample) {
        self.newest_target = target.number;
        let Some(goal) = self.goals.current() else {
            return;
        };
        let aim = &mut goal.known;
        match aim.number {
            None if target.number > aim.after
                && target.target.position() == aim.point.position() =>
            {
                aim.number = Some(target.number);
            }
            Some(number) if target.number > number => self.goals.end(Status::Aborted),
            _ => {}
        }
    }

    pub(crate) fn command(&mut self, command: &CommandSample) {
        let has_arrived = CommandState::from_byte(command.state) == CommandState::Arrived;
        let goal = self.goals.current();
        let goal = goal.filter(|goal| goal.known.number == Some(command.target_number));
        if has_arrived && goal.is_some_and(|goal| goal.status == Status::Executing) {
            self.goals.end(Status::Succeeded);
        }
    }

    /// A run that stays gives up a target, and then waits for the next one.
    pub(crate) fn directive(&mut self, directive: &DirectiveSample) {
        let waits = HoldReason::from_byte(directive.reason) == HoldReason::Waiting;
        if let Some(goal) = self.goals.current().filter(|goal| goal.known.number.is_some())
            && std::mem::replace(&mut goal.known.waits, waits)
            && waits
        {
            self.goals.end(Status::Aborted);
        }
    }

    /// The result of a goal; none while it is not over.
    pub(crate) fn result(&self, id: Uuid) -> Option<Vec<u8>> {
        let (status, _) = self.goals.over(id)?;
        // There is no error code, and no text of one.
        Some(Writer::default().u8(status).u16(0).text("").take())
    }

    /// The progress of the robot with its goal; none without a goal.
    pub(crate) fn feedback(
        &mut self,
        pose: &PoseSample,
        recoveries: u64,
        now_ns: u64,
    ) -> Option<Vec<u8>> {
        let goal = self.goals.current()?;
        let at = pose.pose();
        let left_m = at.position.distance(goal.known.point.position());
        let mut writer = Writer::default();
        writer.raw(&goal.id);
        pose_stamped(&mut writer, Header(now_ns, MAP), [at.position.x, at.position.y, at.heading]);
        // The time that remains is not estimated.
        writer.time(now_ns.saturating_sub(goal.at_ns)).time(0);
        writer.u16(u16::try_from(recoveries).unwrap_or(u16::MAX)).f32(left_m as f32);
        Some(writer.take())
    }
}
