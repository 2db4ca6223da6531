//! The requests of nodes by topics: messages in, their meaning out. Each message is taken, or refused as a whole with a
//! reason.

use common::{kinematics::Pose2, samples::TargetPoint};
use glam::DVec2;
use ros2::cdr::Reader;

use crate::shown::MAP;

/// The least deviations of a place, metres and radians, whatever its covariance says.
const LEAST_SIGMA: f64 = 0.05;

/// The target of a `geometry_msgs/PoseStamped`.
pub(crate) fn goal(payload: &[u8]) -> Result<TargetPoint, String> {
    goal_of(&mut Reader::new(payload)?)
}

/// The target of a `geometry_msgs/PoseStamped` that is a part of a message.
pub(crate) fn goal_of(reader: &mut Reader<'_>) -> Result<TargetPoint, String> {
    let Pose2 { position, heading } = pose_in_map(reader)?;
    Ok(TargetPoint { x_m: position.x, y_m: position.y, heading_rad: heading, has_heading: 1 })
}

/// The place of a `geometry_msgs/PoseWithCovarianceStamped`, and its deviations, metres and radians.
pub(crate) fn place(payload: &[u8]) -> Result<(TargetPoint, [f64; 2]), String> {
    let mut reader = Reader::new(payload)?;
    let place = goal_of(&mut reader)?;
    let all: [f64; 36] = reader.f64s()?;
    let variances = [f64::midpoint(all[0], all[7]), all[35]];
    Ok((place, variances.map(|variance| variance.sqrt().max(LEAST_SIGMA))))
}

/// The value of a `std_msgs/Bool`.
pub(crate) fn flag(payload: &[u8]) -> Result<bool, String> {
    Ok(Reader::new(payload)?.u8()? != 0)
}

/// A header and a pose in the mission's frame.
fn pose_in_map(reader: &mut Reader<'_>) -> Result<Pose2, String> {
    let (_stamp_ns, frame) = reader.header()?;
    if !(frame.is_empty() || frame.trim_start_matches('/') == MAP) {
        return Err(format!("a pose in the frame {frame:?}; give it in {MAP:?}"));
    }
    let ([x, y], heading) = reader.pose()?;
    let heading = heading.ok_or("an orientation that is no rotation; fill orientation.w")?;
    if !(x.is_finite() && y.is_finite()) {
        return Err("a position that is no number; give metres".to_owned());
    }
    Ok(Pose2 { position: DVec2::new(x, y), heading })
}
