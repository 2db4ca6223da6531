//! The server of the action `navigate_to_pose`. Pure.
//!
//! A goal is reached when the controller reports the arrival at the target that the supervisor made of the goal.

use common::samples::{
    CommandSample, CommandState, DirectiveSample, HoldReason, PoseSample, TargetPoint, TargetSample,
};
use ros2::{
    cdr::{Cdr, Malformed},
    msg::{
        ComputePathToPoseResult, Header, NavigateToPoseFeedback, NavigateToPoseFeedbackMessage,
        NavigateToPoseGetResultResponse, NavigateToPoseResult, NavigateToPoseSendGoalRequest, UUID,
    },
    participant::Request,
};
use serde::{Deserialize, Serialize};

use crate::{
    asked::goal_of,
    goals::{Goals, Status, Uuid},
    shown::{MAP, plane},
};

#[derive(Default, Serialize, Deserialize)]
pub struct Aim {
    point: TargetPoint,
    /// The number of the goal's target, once the supervisor has published it.
    number: Option<u64>,
    /// The robot waits although it did not arrive. Its arrival may still be read: it waits if it is told so again.
    waits: bool,
    /// The number of the newest target that is older than the goal.
    after: u64,
    why: Refusal,
    /// How often the result of its target was awaited in vain.
    #[serde(skip)]
    awaited: u32,
}

/// The most times that the bridge looks for the result of a target, some 50 ms apart, before a goal is told without it.
const MOST_AWAITED: u32 = 20;

/// Why a goal is not reached: an error code of `NavigateToPose`, or of its planner, which it passes on, and its words.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Refusal {
    pub code: u16,
    pub text: String,
}

impl<T: ToString> From<T> for Refusal {
    fn from(text: T) -> Self {
        Self { code: NavigateToPoseResult::UNKNOWN, text: text.to_string() }
    }
}

#[derive(Default, Serialize, Deserialize)]
pub struct Server {
    pub goals: Goals<Aim>,
    /// The number of the newest target, which the target of a goal that is sent now follows; another run counts from 1.
    #[serde(skip)]
    pub newest_target: u64,
}

#[derive(Clone, Copy, Debug)]
pub struct Sent {
    pub id: Uuid,
    pub point: TargetPoint,
}

impl Server {
    /// The id of the goal that a client sends, and where to go or why not there. The error says why the payload is none.
    pub fn read_goal(payload: &[u8]) -> Result<(Uuid, Result<TargetPoint, Refusal>), Malformed> {
        let NavigateToPoseSendGoalRequest { goal_id, goal } = Cdr::decode(payload)?;
        Ok((goal_id.uuid, goal_of(&goal.pose.header, &goal.pose.pose)))
    }

    /// Take a goal that the supervisor accepted; its target comes after the one with the number `after`.
    pub fn accept(&mut self, sent: Sent, after: u64, now_ns: u64) {
        self.abort("a newer goal took its place");
        let aim = Aim { point: sent.point, after, ..Aim::default() };
        self.goals.accept(sent.id, aim, now_ns);
    }

    /// Take a goal that has ended before it began; another one goes on.
    pub fn refuse(&mut self, id: Uuid, why: &Refusal, now_ns: u64) {
        let aim = Aim { why: why.clone(), ..Aim::default() };
        self.goals.add(id, Status::Aborted, aim, now_ns);
    }

    pub fn abort(&mut self, why: &str) {
        if let Some(goal) = self.goals.current() {
            goal.known.why = why.into();
        }
        self.goals.end(Status::Aborted);
    }

    pub fn target(&mut self, target: &TargetSample) {
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
            Some(number) if target.number > number => self.abort("the robot was sent elsewhere"),
            _ => {}
        }
    }

    pub fn command(&mut self, command: &CommandSample) {
        let has_arrived = CommandState::from_byte(command.state) == CommandState::Arrived;
        let goal = self.goals.current();
        let goal = goal.filter(|goal| goal.known.number == Some(command.target_number));
        if has_arrived && goal.is_some_and(|goal| goal.status == Status::Executing) {
            self.goals.end(Status::Succeeded);
        }
    }

    /// A run that stays gives up a target, and then waits for the next one.
    pub fn directive(&mut self, directive: &DirectiveSample) {
        let waits = HoldReason::from_byte(directive.reason) == HoldReason::Waiting;
        if let Some(goal) = self.goals.current().filter(|goal| goal.known.number.is_some())
            && std::mem::replace(&mut goal.known.waits, waits)
            && waits
        {
            self.abort("the robot gave it up");
        }
    }

    /// Take the recorded result of a target: it says why a goal was given up, or how it ended while nobody looked.
    pub fn recorded(&mut self, number: u64, outcome: &str) {
        let is_of = |aim: &Aim| aim.number == Some(number);
        if self.goals.current().is_some_and(|goal| is_of(&goal.known)) {
            self.abort("the robot was sent elsewhere, or the run ended");
        }
        for goal in self.goals.aborted().filter(|goal| is_of(&goal.known)) {
            let (code, text) = match outcome {
                "unreachable" => {
                    (ComputePathToPoseResult::NO_VALID_PATH, "the robot found no way to it")
                }
                "timed_out" => {
                    (NavigateToPoseResult::TIMEOUT, "the robot was not there in the mission's time")
                }
                "reached" | "reached_unsure" | "wrong_place" => {
                    (goal.status, goal.known.why) = (Status::Succeeded, Refusal::default());
                    continue;
                }
                _ => (NavigateToPoseResult::UNKNOWN, goal.known.why.text.as_str()),
            };
            goal.known.why = Refusal { code, text: text.to_owned() };
            goal.known.awaited = MOST_AWAITED;
        }
    }

    /// No further results of the targets of earlier goals come.
    pub fn forget_targets(&mut self) {
        self.goals.aborted().for_each(|goal| goal.known.number = None);
    }

    pub fn answerable(&mut self) -> Vec<(Request, Uuid)> {
        self.goals.aborted().for_each(|goal| goal.known.awaited += 1);
        self.goals.answerable(|status, aim| {
            status != Status::Aborted as i8
                || aim.is_none_or(|aim| aim.number.is_none() || aim.awaited > MOST_AWAITED)
        })
    }

    /// The result of a goal; none while it is not over.
    pub fn result(&self, id: Uuid) -> Option<Vec<u8>> {
        let (status, aim) = self.goals.over(id)?;
        let Refusal { code, text } = aim.map(|aim| aim.why.clone()).unwrap_or_default();
        let result = NavigateToPoseResult { error_code: code, error_msg: text };
        Some(NavigateToPoseGetResultResponse { status, result }.encode())
    }

    /// The progress of the robot with its goal; none without a goal.
    pub fn feedback(&mut self, pose: &PoseSample, recoveries: u64, now_ns: u64) -> Option<Vec<u8>> {
        let goal = self.goals.current()?;
        let at = pose.pose();
        let left_m = at.position.distance(goal.known.point.position());
        // The time that remains is not estimated, and the errors of tracking are not measured here.
        let feedback = NavigateToPoseFeedback {
            current_pose: Header::at(now_ns, MAP).with(plane(at)),
            navigation_time: now_ns.saturating_sub(goal.at_ns).into(),
            number_of_recoveries: i16::try_from(recoveries).unwrap_or(i16::MAX),
            distance_remaining: left_m as f32,
            ..NavigateToPoseFeedback::default()
        };
        let goal_id = UUID { uuid: goal.id };
        Some(NavigateToPoseFeedbackMessage { goal_id, feedback }.encode())
    }
}
