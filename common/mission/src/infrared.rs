//! THE mounting of the X80's ring of infrared rangers: which ranger looks where, for link, simulator and mapper alike.

use glam::DVec2;

use crate::kinematics::Pose2;

/// Rangers of the ring.
pub const RANGERS: usize = 7;

/// The bearing of each ranger from the robot's axis, degrees counter-clockwise, and its distance from the robot's centre as a share
/// of the body's radius. The order is that of the frames, on which two independent drivers agree: from left to right in front, then
/// right, rear, left. The rangers at the sides of an X80 are 121 mm from the centre, the others at the rim.
const RING: [(f64, f64); RANGERS] = [
    (33.75, 1.0),
    (11.25, 1.0),
    (-11.25, 1.0),
    (-33.75, 1.0),
    (-90.0, 0.121 / 0.19),
    (180.0, 1.0),
    (90.0, 0.121 / 0.19),
];

/// The poses of the rangers of a robot at `pose` with a body of `radius` metres. The heading is the direction of the ray.
#[must_use]
pub fn rangers(pose: Pose2, radius: f64) -> [Pose2; RANGERS] {
    RING.map(|(bearing_deg, share)| {
        let heading = pose.heading + bearing_deg.to_radians();
        Pose2 { position: pose.position + share * radius * DVec2::from_angle(heading), heading }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ring_turns_with_the_robot_and_ranger_5_looks_to_its_right() {
        let pose = Pose2 { position: DVec2::new(1.0, 2.0), heading: std::f64::consts::FRAC_PI_2 };
        let right = rangers(pose, 0.19)[4];
        assert!(right.position.distance(DVec2::new(1.121, 2.0)) < 1e-9);
        assert!(right.axis().distance(DVec2::X) < 1e-9);
    }
}
