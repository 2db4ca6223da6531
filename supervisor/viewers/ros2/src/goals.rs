//! Goals of an action server: states, and messages common to all actions. Pure. A newer goal
//! replaces the current one, as in Nav2.

use std::collections::VecDeque;

use ros2::{
    cdr::{Cdr as _, Malformed},
    msg::{
        CancelGoalRequest, CancelGoalResponse, GoalInfo, GoalStatus, GoalStatusArray,
        NavigateToPoseGetResultRequest, NavigateToPoseSendGoalResponse, UUID,
    },
    participant::Request,
};
use serde::{Deserialize, Serialize};

pub type Uuid = [u8; 16];

/// Limit of remembered goals. The oldest are forgotten.
const MOST_GOALS: usize = 16;
const MOST_RESULTS: usize = 32;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Status {
    Executing = 2,
    Canceling = 3,
    Succeeded = 4,
    Canceled = 5,
    Aborted = 6,
}

impl Status {
    pub const fn is_final(self) -> bool {
        matches!(self, Self::Succeeded | Self::Canceled | Self::Aborted)
    }
}

#[derive(Serialize, Deserialize)]
pub struct Goal<T> {
    pub id: Uuid,
    /// Nanoseconds since 1970.
    pub at_ns: u64,
    pub status: Status,
    pub known: T,
}

impl<T> Goal<T> {
    fn info(&self) -> GoalInfo {
        GoalInfo { goal_id: UUID { uuid: self.id }, stamp: self.at_ns.into() }
    }
}

/// In nanoseconds since 1970.
pub fn reply_to_goal(accepted: bool, now_ns: u64) -> Vec<u8> {
    NavigateToPoseSendGoalResponse { accepted, stamp: now_ns.into() }.encode()
}

#[derive(Default, Serialize, Deserialize)]
pub struct Goals<T> {
    goals: VecDeque<Goal<T>>,
    is_changed: bool,
    waiting: Vec<(Request, Uuid)>,
}

impl<T> Goals<T> {
    pub fn accept(&mut self, id: Uuid, known: T, now_ns: u64) {
        self.end(Status::Aborted);
        self.add(id, Status::Executing, known, now_ns);
    }

    pub fn add(&mut self, id: Uuid, status: Status, known: T, now_ns: u64) {
        if self.goals.len() == MOST_GOALS {
            self.goals.pop_front();
        }
        self.goals.push_back(Goal { id, at_ns: now_ns, status, known });
        self.is_changed = true;
    }

    pub fn are_any(&self) -> bool {
        !self.goals.is_empty()
    }

    pub fn end(&mut self, status: Status) {
        for goal in self.goals.iter_mut().filter(|goal| !goal.status.is_final()) {
            goal.status = status;
            self.is_changed = true;
        }
    }

    pub fn current(&mut self) -> Option<&mut Goal<T>> {
        self.goals.iter_mut().rev().find(|goal| !goal.status.is_final())
    }

    /// Returns the reply, and whether a goal is canceled.
    pub fn cancel(&mut self, payload: &[u8]) -> Result<(Vec<u8>, bool), Malformed> {
        let GoalInfo { goal_id: UUID { uuid: id }, stamp } =
            CancelGoalRequest::decode(payload)?.goal_info;
        let is_any = id == Uuid::default();
        let until_ns = u64::try_from(stamp.ns()).unwrap_or_default();
        let is_asked = |goal: &Goal<T>| {
            goal.id == id || (is_any && until_ns == 0) || (until_ns > 0 && goal.at_ns <= until_ns)
        };
        let mut goals_canceling = Vec::new();
        for goal in self.goals.iter_mut().filter(|goal| is_asked(goal)) {
            if goal.status == Status::Executing {
                goal.status = Status::Canceling;
                self.is_changed = true;
                goals_canceling.push(goal.info());
            }
        }
        let is_taken = !goals_canceling.is_empty();
        let return_code = match self.goals.iter().any(|goal| goal.id == id) {
            _ if is_any || is_taken => CancelGoalResponse::ERROR_NONE,
            true => CancelGoalResponse::ERROR_GOAL_TERMINATED,
            false => CancelGoalResponse::ERROR_UNKNOWN_GOAL_ID,
        };
        Ok((CancelGoalResponse { return_code, goals_canceling }.encode(), is_taken))
    }

    pub fn wait(&mut self, request: &Request, payload: &[u8]) -> Result<(), Malformed> {
        let id = NavigateToPoseGetResultRequest::decode(payload)?.goal_id.uuid;
        if self.waiting.len() == MOST_RESULTS {
            self.waiting.remove(0);
        }
        self.waiting.push((request.clone(), id));
        Ok(())
    }

    /// An unknown goal has state 0.
    pub fn over(&self, id: Uuid) -> Option<(i8, Option<&T>)> {
        match self.goals.iter().find(|goal| goal.id == id) {
            Some(goal) if !goal.status.is_final() => None,
            Some(goal) => Some((goal.status as i8, Some(&goal.known))),
            None => Some((0, None)),
        }
    }

    pub fn aborted(&mut self) -> impl Iterator<Item = &mut Goal<T>> {
        self.goals.iter_mut().filter(|goal| goal.status == Status::Aborted)
    }

    /// Returns the waiting requests for ended goals whose results `are_known`.
    pub fn answerable(
        &mut self,
        are_known: impl Fn(i8, Option<&T>) -> bool,
    ) -> Vec<(Request, Uuid)> {
        let waiting = std::mem::take(&mut self.waiting);
        let is_over = |id| self.over(id).is_some_and(|(status, known)| are_known(status, known));
        let (over, waiting) = waiting.into_iter().partition(|(_, id)| is_over(*id));
        self.waiting = waiting;
        over
    }

    pub fn take_status(&mut self) -> Option<Vec<u8>> {
        let status =
            |goal: &Goal<T>| GoalStatus { goal_info: goal.info(), status: goal.status as i8 };
        std::mem::take(&mut self.is_changed).then(|| {
            GoalStatusArray { status_list: self.goals.iter().map(status).collect() }.encode()
        })
    }
}
