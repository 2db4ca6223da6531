//! THE mounting of an ultrasonic ranger, (19): its position and direction on the robot, for simulator and mapper.
//!
//! (19) puts a hit at distance S + W/2 from the robot's centre along theta + delta. So the ranger is on that line: at
//! bearing delta from the robot's axis, W/2 from the centre, looking outward.

use glam::DVec2;

use crate::kinematics::Pose2;

/// The mounting of a ranger that looks outward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mount {
    /// Distance from the robot's centre along the bearing, metres; the paper writes W/2.
    pub forward_m: f64,
    /// delta: bearing from the robot's axis, radians counter-clockwise.
    pub bearing_rad: f64,
}

impl Mount {
    /// The pose of the ranger of a robot at `robot`. The heading is the direction of the beam.
    #[must_use]
    pub fn on(&self, robot: Pose2) -> Pose2 {
        let heading = robot.heading + self.bearing_rad;
        Pose2 { position: robot.position + self.forward_m * DVec2::from_angle(heading), heading }
    }

    /// The hit of (19), metres: what a ranger on a robot at `robot` hears `range_m` away on its axis.
    #[must_use]
    pub fn hit(&self, robot: Pose2, range_m: f64) -> DVec2 {
        let ranger = self.on(robot);
        ranger.position + ranger.axis() * range_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equation_19_by_hand_at_bearings_0_45_and_minus_90() {
        let robot = Pose2 { position: DVec2::new(1.0, 2.0), heading: 0.0 };
        // W/2 = 0.2, S = 0.8: 1 m from the centre along the bearing.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        for (bearing_deg, hit) in [
            (0.0, DVec2::new(2.0, 2.0)),
            (45.0, DVec2::new(1.0 + half, 2.0 + half)),
            (-90.0, DVec2::new(1.0, 1.0)),
        ] {
            let mount = Mount { forward_m: 0.2, bearing_rad: f64::to_radians(bearing_deg) };
            let got = mount.hit(robot, 0.8);
            assert!(got.distance(hit) < 1e-12, "{bearing_deg} degrees: {got}");
            let ranger = mount.on(robot);
            assert!((ranger.position - robot.position).length() - 0.2 < 1e-12);
        }
    }
}
