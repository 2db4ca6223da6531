//! Calls of Nav2's two actions: goals in, results out. Pure.

use ros2::{
    cdr::{Cdr, Malformed},
    msg::{
        ComputePathThroughPosesGetResultResponse, ComputePathThroughPosesResult,
        ComputePathThroughPosesSendGoalRequest, ComputePathToPoseGetResultResponse,
        ComputePathToPoseResult, ComputePathToPoseSendGoalRequest, Header, PoseStamped, Release,
    },
    parts::Pose,
};

use super::planning::Failure;
use crate::{goals::Uuid, messages::path};

pub struct Asked {
    pub id: Uuid,
    pub goals: Vec<PoseStamped>,
    /// Start, or `None` for the robot's own pose.
    pub start: Option<PoseStamped>,
    /// Releases whose clients send this layout.
    pub releases: Vec<Release>,
}

/// Reads the goal of `ComputePathToPose` or `ComputePathThroughPoses`, in the layout that consumes
/// all bytes.
///
/// # Errors
/// No layout fits, or several do.
pub fn read(payload: &[u8], has_one: bool) -> Result<Asked, Malformed> {
    let (releases, goal_id, goals, start, uses_start) = if has_one {
        let (releases, asked) = ComputePathToPoseSendGoalRequest::decode_whole(payload)?;
        let ComputePathToPoseSendGoalRequest { goal_id, goal: it } = asked;
        let goals = it.viapoints.into_iter().chain([it.goal]).collect();
        (releases, goal_id, goals, it.start, it.use_start)
    } else {
        let (releases, asked) = ComputePathThroughPosesSendGoalRequest::decode_whole(payload)?;
        let ComputePathThroughPosesSendGoalRequest { goal_id, goal: it } = asked;
        (releases, goal_id, it.goals.goals, it.start, it.use_start)
    };
    Ok(Asked { id: goal_id.uuid, goals, start: uses_start.then_some(start), releases })
}

#[derive(Clone, Debug, Default)]
pub struct Outcome {
    pub frame: String,
    pub at_ns: u64,
    pub took_ns: u64,
    pub path: Vec<Pose>,
    pub failure: Option<Failure>,
}

/// Encodes a goal's result. `codes` is the action's first Nav2 error code.
pub fn result(status: i8, outcome: &Outcome, codes: u16, release: Release) -> Vec<u8> {
    let path = path(Header::at(outcome.at_ns, &outcome.frame), &outcome.path);
    let planning_time = outcome.took_ns.into();
    let (error_code, error_msg) = outcome
        .failure
        .as_ref()
        .map(|(reason, text)| (codes + *reason as u16, text.clone()))
        .unwrap_or_default();
    if codes < ComputePathThroughPosesResult::UNKNOWN {
        let result = ComputePathToPoseResult { path, planning_time, error_code, error_msg };
        ComputePathToPoseGetResultResponse { status, result }.encode_for(release)
    } else {
        let last_reached_index = ComputePathThroughPosesResult::ALL_GOALS;
        let result = ComputePathThroughPosesResult {
            path,
            last_reached_index,
            planning_time,
            error_code,
            error_msg,
        };
        ComputePathThroughPosesGetResultResponse { status, result }.encode_for(release)
    }
}
