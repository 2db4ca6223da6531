//! Mounting of a ranging sensor (19), for simulator and mapper.
//!
//! (19) puts a hit at distance S + W/2 from the robot's centre along theta + delta. The ranger is
//! therefore on that line and looks outward; a laser may be turned.

use glam::DVec2;

use crate::kinematics::Pose2;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mount {
    /// Distance from the robot's centre along the bearing; W/2 in the paper.
    pub forward_m: f64,
    /// delta: counter-clockwise from the robot's axis.
    pub bearing_rad: f64,
    /// Angle from the bearing to the viewing direction, counter-clockwise; 0 is outward.
    pub turned_rad: f64,
}

impl Mount {
    /// The heading is that of its middle beam.
    pub fn on(&self, robot: Pose2) -> Pose2 {
        let outward = robot.heading + self.bearing_rad;
        let position = robot.position + self.forward_m * DVec2::from_angle(outward);
        Pose2 { position, heading: outward + self.turned_rad }
    }

    pub fn looks_rad(&self) -> f64 {
        self.bearing_rad + self.turned_rad
    }

    /// Returns the point of (19), metres, at `range_m` on the axis of a ranger on `robot`.
    pub fn hit(&self, robot: Pose2, range_m: f64) -> DVec2 {
        let ranger = self.on(robot);
        ranger.position + ranger.axis() * range_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn a_ranger_that_is_turned_stays_where_it_is_and_looks_elsewhere() {
        let robot = Pose2 { position: DVec2::new(1.0, 2.0), heading: std::f64::consts::FRAC_PI_2 };
        let quarter = std::f64::consts::FRAC_PI_2;
        let mount = Mount { forward_m: -0.04, bearing_rad: 0.0, turned_rad: quarter };
        // 4 cm behind the centre of a robot that faces y; it looks to the robot's left.
        assert!(mount.on(robot).position.distance(DVec2::new(1.0, 1.96)) < 1e-12);
        assert!(mount.hit(robot, 0.5).distance(DVec2::new(0.5, 1.96)) < 1e-12);
        assert_eq!(mount.looks_rad(), quarter);
    }
}
