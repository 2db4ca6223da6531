//! Server of the action `navigate_to_pose`. Pure.
//!
//! A goal succeeds when the controller reports the arrival at the goal's target from the
//! supervisor.

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
    number: Option<u64>,
    /// Whether the robot waits without a reported arrival. The arrival may be unread, so a second
    /// such directive decides.
    waits: bool,
    /// Number of the newest target older than the goal.
    after: u64,
    why: Refusal,
    /// Number of vain checks for the target's result.
    #[serde(skip)]
    awaited: u32,
}

/// Most such checks, about 50 ms apart, before a goal is answered.
const MOST_AWAITED: u32 = 20;

/// Reason of a failed goal: an error code of `NavigateToPose` or of its planner, and a text.
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
    /// The next goal follows it. Each run counts from 1.
    #[serde(skip)]
    pub newest_target: u64,
}

impl Server {
    pub fn read_goal(payload: &[u8]) -> Result<(Uuid, Result<TargetPoint, Refusal>), Malformed> {
        let NavigateToPoseSendGoalRequest { goal_id, goal } = Cdr::decode(payload)?;
        Ok((goal_id.uuid, goal_of(&goal.pose.header, &goal.pose.pose)))
    }

    /// Takes an accepted goal, whose target follows the one numbered `after`.
    pub fn accept(&mut self, (id, point): (Uuid, TargetPoint), after: u64, now_ns: u64) {
        self.abort("a newer goal replaced it");
        self.goals.accept(id, Aim { point, after, ..Aim::default() }, now_ns);
    }

    /// Takes a goal that failed before it began, beside the current one.
    pub fn refuse(&mut self, id: Uuid, why: &Refusal, now_ns: u64) {
        self.goals.add(id, Status::Aborted, Aim { why: why.clone(), ..Aim::default() }, now_ns);
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
        if command.state() == CommandState::Arrived
            && let Some(goal) = self.goals.current()
            && goal.known.number == Some(command.target_number)
            && goal.status == Status::Executing
        {
            self.goals.end(Status::Succeeded);
        }
    }

    /// Aborts the goal if the run gives up its target.
    pub fn directive(&mut self, directive: &DirectiveSample) {
        let waits = directive.reason() == HoldReason::Waiting;
        if let Some(goal) = self.goals.current().filter(|goal| goal.known.number.is_some())
            && std::mem::replace(&mut goal.known.waits, waits)
            && waits
        {
            self.abort("the robot gave up the goal");
        }
    }

    /// Applies a target's recorded result, which explains a failure or an unobserved end.
    pub fn recorded(&mut self, number: u64, outcome: &str) {
        let is_of = |aim: &Aim| aim.number == Some(number);
        if self.goals.current().is_some_and(|goal| is_of(&goal.known)) {
            self.abort("the robot was sent elsewhere, or the run ended");
        }
        for goal in self.goals.aborted().filter(|goal| is_of(&goal.known)) {
            let (code, text) = match outcome {
                "unreachable" => {
                    (ComputePathToPoseResult::NO_VALID_PATH, "the robot found no path to the goal")
                }
                "timed_out" => (
                    NavigateToPoseResult::TIMEOUT,
                    "the robot did not arrive within the mission's time limit",
                ),
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

    pub fn result(&self, id: Uuid) -> Option<Vec<u8>> {
        let (status, aim) = self.goals.over(id)?;
        let Refusal { code, text } = aim.map(|aim| aim.why.clone()).unwrap_or_default();
        let result = NavigateToPoseResult { error_code: code, error_msg: text };
        Some(NavigateToPoseGetResultResponse { status, result }.encode())
    }

    pub fn feedback(&mut self, pose: &PoseSample, recoveries: u64, now_ns: u64) -> Option<Vec<u8>> {
        let goal = self.goals.current()?;
        let at = pose.pose();
        let left_m = at.position.distance(goal.known.point.position());
        // Remaining time is not estimated, and tracking errors are not measured here.
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
