//! The requests of nodes by topics: messages in, their meaning out. Each message is taken, or refused as a whole with a
//! reason.

use common::{mission::Mission, samples::TargetPoint};
use glam::DVec2;
use ros2::cdr::Reader;

use crate::{
    action::{Refusal, code},
    shown::MAP,
};

/// The least deviations of a place, metres and radians, whatever its covariance says.
const LEAST_SIGMA: f64 = 0.05;

/// The target of a `geometry_msgs/PoseStamped`.
pub fn goal(payload: &[u8]) -> Result<TargetPoint, String> {
    goal_of(&mut Reader::new(payload)?).map_err(|why| why.text)
}

/// The target of a `geometry_msgs/PoseStamped` that is a part of a message, in the mission's frame.
pub fn goal_of(reader: &mut Reader<'_>) -> Result<TargetPoint, Refusal> {
    let (_stamp_ns, frame) = reader.header()?;
    if !(frame.is_empty() || frame.trim_start_matches('/') == MAP) {
        let text = format!("a pose in the frame {frame:?}; give it in {MAP:?}");
        return Err(Refusal { code: code::TF_ERROR, text });
    }
    let ([x_m, y_m], heading) = reader.pose()?;
    let heading_rad = heading.ok_or("an orientation that is no rotation; fill orientation.w")?;
    if !(x_m.is_finite() && y_m.is_finite()) {
        return Err("a position that is no number; give metres".into());
    }
    Ok(TargetPoint { x_m, y_m, heading_rad, has_heading: 1 })
}

/// The place of a `geometry_msgs/PoseWithCovarianceStamped`, and its deviations, metres and radians.
pub fn place(payload: &[u8]) -> Result<(TargetPoint, [f64; 2]), String> {
    let mut reader = Reader::new(payload)?;
    let place = goal_of(&mut reader).map_err(|why| why.text)?;
    let all: [f64; 36] = reader.f64s()?;
    let variances = [f64::midpoint(all[0], all[7]), all[35]];
    Ok((place, variances.map(|variance| variance.sqrt().max(LEAST_SIGMA))))
}

/// Where a hand pushes by a `geometry_msgs/Twist`: ahead and to the left, in shares of the mission's speeds.
pub fn stick(payload: &[u8], mission: &Mission) -> Result<DVec2, String> {
    let [ahead, _, _, _, _, left]: [f64; 6] = Reader::new(payload)?.f64s()?;
    let stick = DVec2::new(ahead / mission.speed_m_s(), left / mission.turn_rad_s());
    match stick.is_finite() {
        true => Ok(stick.clamp(DVec2::NEG_ONE, DVec2::ONE)),
        false => Err("a speed that is no number; give m/s and rad/s".to_owned()),
    }
}

pub fn flag(payload: &[u8]) -> Result<bool, String> {
    Ok(Reader::new(payload)?.u8()? != 0)
}
