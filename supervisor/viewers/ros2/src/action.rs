//! The server of the action `navigate_to_pose`: goals, their states, and the messages of its services and topics. Pure.
//!
//! The server has one goal at a time: a newer one takes its place, as in Nav2. A goal is reached when the controller reports the
//! arrival at the target that the supervisor made of the goal.

use std::collections::VecDeque;

use common::samples::{
    CommandSample, CommandState, DirectiveSample, HoldReason, PoseSample, TargetPoint, TargetSample,
};
use ros2::cdr::{Reader, Writer};

use crate::{
    asked::goal_of,
    messages::{Header, pose_stamped},
    shown::MAP,
};

/// The id that a client gave its goal.
pub(crate) type Uuid = [u8; 16];

/// The most goals that are remembered; older ones are forgotten.
const MOST_GOALS: usize = 16;

/// A `action_msgs/GoalStatus`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Status {
    Executing = 2,
    Canceling = 3,
    Succeeded = 4,
    Canceled = 5,
    Aborted = 6,
}

impl Status {
    /// Whether the status is final.
    pub(crate) const fn is_final(self) -> bool {
        matches!(self, Self::Succeeded | Self::Canceled | Self::Aborted)
    }
}

/// The answer to a request to cancel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cancel {
    Taken = 0,
    Unknown = 2,
    Over = 3,
}

/// A goal that was accepted.
#[derive(Clone, Debug)]
struct Goal {
    id: Uuid,
    /// The time when the goal was accepted, nanoseconds since 1970.
    at_ns: u64,
    point: TargetPoint,
    /// The number of the goal's target, once the supervisor has published it.
    number: Option<u64>,
    /// The robot waits although it did not arrive. Its arrival may still be read: it waits if it is told so again.
    waits: bool,
    /// The number of the newest target that is older than the goal.
    after: u64,
    status: Status,
}

/// The server's goals.
#[derive(Debug, Default)]
pub(crate) struct Server {
    goals: VecDeque<Goal>,
    /// The number of the newest target, which the target of a goal that is sent now follows; another run counts from 1.
    pub(crate) newest_target: u64,
    /// Whether the states have changed since they were last published.
    is_changed: bool,
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

    /// The reply to a goal, at `now_ns` since 1970.
    pub(crate) fn goal_reply(is_accepted: bool, now_ns: u64) -> Vec<u8> {
        Writer::default().u8(is_accepted.into()).time(now_ns).take()
    }

    /// Take a goal that the supervisor accepted; its target comes after the one with the number `after`.
    pub(crate) fn accept(&mut self, sent: Sent, after: u64, now_ns: u64) {
        self.end(Status::Aborted);
        if self.goals.len() == MOST_GOALS {
            self.goals.pop_front();
        }
        let Sent { id, point } = sent;
        let status = Status::Executing;
        self.goals.push_back(Goal {
            id,
            at_ns: now_ns,
            point,
            number: None,
            waits: false,
            after,
            status,
        });
        self.is_changed = true;
    }

    /// Let the goal that is not over end with `status`.
    pub(crate) fn end(&mut self, status: Status) {
        for goal in self.goals.iter_mut().filter(|goal| !goal.status.is_final()) {
            goal.status = status;
            self.is_changed = true;
        }
    }

    pub(crate) fn target(&mut self, target: &TargetSample) {
        self.newest_target = target.number;
        let Some(goal) = self.goals.back_mut().filter(|goal| !goal.status.is_final()) else {
            return;
        };
        match goal.number {
            None if target.number > goal.after
                && target.target.position() == goal.point.position() =>
            {
                goal.number = Some(target.number);
            }
            Some(number) if target.number > number => self.end(Status::Aborted),
            _ => {}
        }
    }

    pub(crate) fn command(&mut self, command: &CommandSample) {
        let has_arrived = CommandState::from_byte(command.state) == CommandState::Arrived;
        let goal = self.goals.back().filter(|goal| goal.number == Some(command.target_number));
        if has_arrived && goal.is_some_and(|goal| goal.status == Status::Executing) {
            self.end(Status::Succeeded);
        }
    }

    /// A run that stays gives up a target, and then waits for the next one.
    pub(crate) fn directive(&mut self, directive: &DirectiveSample) {
        let waits = HoldReason::from_byte(directive.reason) == HoldReason::Waiting;
        if let Some(goal) = self.goals.back_mut().filter(|goal| goal.number.is_some())
            && std::mem::replace(&mut goal.waits, waits)
            && waits
        {
            self.end(Status::Aborted);
        }
    }

    /// Take a request to cancel. Returns the reply, and whether the robot is to stand because of it.
    pub(crate) fn cancel(&mut self, payload: &[u8]) -> Result<(Vec<u8>, bool), String> {
        let mut reader = Reader::new(payload)?;
        let (id, until_ns) = (uuid(&mut reader)?, reader.time()?);
        let is_any = id == Uuid::default();
        let until_ns = u64::try_from(until_ns).unwrap_or_default();
        let is_asked = |goal: &Goal| {
            goal.id == id || (is_any && until_ns == 0) || (until_ns > 0 && goal.at_ns <= until_ns)
        };
        let mut canceled = Vec::new();
        for goal in self.goals.iter_mut().filter(|goal| is_asked(goal)) {
            if goal.status == Status::Executing {
                goal.status = Status::Canceling;
                self.is_changed = true;
                canceled.push((goal.id, goal.at_ns));
            }
        }
        let answer = match self.goals.iter().any(|goal| goal.id == id) {
            _ if is_any || !canceled.is_empty() => Cancel::Taken,
            true => Cancel::Over,
            false => Cancel::Unknown,
        };
        let reply = Writer::default()
            .u8(answer as u8)
            .list(&canceled, |writer, (id, at_ns)| {
                writer.raw(id).time(*at_ns);
            })
            .take();
        Ok((reply, !canceled.is_empty()))
    }

    /// The goal of which a client asks for the result.
    pub(crate) fn read_result(payload: &[u8]) -> Result<Uuid, String> {
        uuid(&mut Reader::new(payload)?)
    }

    /// The result of a goal; none while it is not over. An unknown goal has the state 0.
    pub(crate) fn result(&self, id: Uuid) -> Option<Vec<u8>> {
        let goal = self.goals.iter().find(|goal| goal.id == id);
        if goal.is_some_and(|goal| !goal.status.is_final()) {
            return None;
        }
        let status = goal.map_or(0, |goal| goal.status as u8);
        // There is no error code, and no text of one.
        Some(Writer::default().u8(status).u16(0).text("").take())
    }

    /// The states of all goals, if they have changed.
    pub(crate) fn take_status(&mut self) -> Option<Vec<u8>> {
        let status = |writer: &mut Writer, goal: &Goal| {
            writer.raw(&goal.id).time(goal.at_ns).u8(goal.status as u8);
        };
        let is_changed = std::mem::take(&mut self.is_changed);
        is_changed.then(|| Writer::default().list(&self.goals, status).take())
    }

    /// The progress of the robot with its goal; none without a goal.
    pub(crate) fn feedback(
        &self,
        pose: &PoseSample,
        recoveries: u64,
        now_ns: u64,
    ) -> Option<Vec<u8>> {
        let goal = self.goals.back().filter(|goal| !goal.status.is_final())?;
        let at = pose.pose();
        let left_m = at.position.distance(goal.point.position());
        let mut writer = Writer::default();
        writer.raw(&goal.id);
        pose_stamped(&mut writer, Header(now_ns, MAP), [at.position.x, at.position.y, at.heading]);
        // The time that remains is not estimated.
        writer.time(now_ns.saturating_sub(goal.at_ns)).time(0);
        writer.u16(u16::try_from(recoveries).unwrap_or(u16::MAX)).f32(left_m as f32);
        Some(writer.take())
    }
}

fn uuid(reader: &mut Reader<'_>) -> Result<Uuid, String> {
    let bytes = reader.raw(16)?;
    bytes.try_into().map_err(|_| "an id of other than 16 bytes".to_owned())
}
