//! Requests of nodes by topic. A refusal has a reason.

use common::{mission::Mission, samples::TargetPoint};
use glam::DVec2;
use ros2::{
    cdr::Cdr as _,
    msg::{self, Header, NavigateToPoseResult, PoseStamped, PoseWithCovarianceStamped, Twist},
};

use crate::{action::Refusal, shown::MAP};

/// Least deviations of a place, metres and radians.
const LEAST_SIGMA: f64 = 0.05;

pub fn goal(payload: &[u8]) -> Result<TargetPoint, String> {
    let PoseStamped { header, pose } = PoseStamped::decode(payload)?;
    goal_of(&header, &pose).map_err(|why| why.text)
}

pub fn goal_of(header: &Header, pose: &msg::Pose) -> Result<TargetPoint, Refusal> {
    let frame = &header.frame_id;
    if !(frame.is_empty() || frame.trim_start_matches('/') == MAP) {
        let text = format!("the pose is in frame {frame:?}; give it in {MAP:?}");
        return Err(Refusal { code: NavigateToPoseResult::TF_ERROR, text });
    }
    let ([x_m, y_m], heading) = (pose.at(), pose.orientation.heading());
    let heading_rad = heading.ok_or("the orientation is not a rotation; set orientation.w")?;
    if !(x_m.is_finite() && y_m.is_finite()) {
        return Err("the position is not finite; give metres".into());
    }
    Ok(TargetPoint { x_m, y_m, heading_rad, has_heading: 1 })
}

/// With deviations in metres and radians.
pub fn place(payload: &[u8]) -> Result<(TargetPoint, [f64; 2]), String> {
    let PoseWithCovarianceStamped { header, pose } = PoseWithCovarianceStamped::decode(payload)?;
    let place = goal_of(&header, &pose.pose).map_err(|why| why.text)?;
    let all = pose.covariance;
    let variances = [f64::midpoint(all[0], all[7]), all[35]];
    Ok((place, variances.map(|variance| variance.sqrt().max(LEAST_SIGMA))))
}

/// Converts a `geometry_msgs/Twist` to forward and left deflections, as shares of the mission's
/// speeds.
pub fn stick(payload: &[u8], mission: &Mission) -> Result<DVec2, String> {
    let Twist { linear, angular } = Twist::decode(payload)?;
    let stick = DVec2::new(linear.x / mission.speed_m_s(), angular.z / mission.turn_rad_s());
    if stick.is_finite() {
        Ok(stick.clamp(DVec2::NEG_ONE, DVec2::ONE))
    } else {
        Err("a speed is not finite; give m/s and rad/s".to_owned())
    }
}
