//! The covariance of the pose's error, propagated with the motion to first order.
//!
//! The error has five parts: x, y, theta, and two errors of the robot that stay the same for a mission, of the ratio of
//! the wheels' diameters and of the track (J. Borenstein, L. Feng, IEEE Trans. Robotics and Automation 12(6), 1996). Each
//! wheel slips besides, independently, by a variance that grows with the way it rolls (K. S. Chong, L. Kleeman, "Accurate
//! odometry and error modelling for a mobile robot", ICRA 1997). A car has the driven wheel's slip and,
//! nominally, the same share of its curvature in place of the ratio of the wheels.

use common::{
    kinematics::{Pose2, Twist},
    mission::{Body, Odometry},
};
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

type Error = SVector<f64, 5>;

/// Covariance of (x, y, theta, ratio of the diameters, track): m, rad, shares.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Covariance(SMatrix<f64, 5, 5>);

/// The errors that the motions of a robot add to the covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ErrorModel {
    /// Variance of a wheel's slip, m^2 per metre rolled.
    slip: f64,
    /// Variances of the two systematic errors.
    systematic: [f64; 2],
    track_m: f64,
    steers: bool,
}

impl ErrorModel {
    pub(crate) fn new(odometry: &Odometry, body: &Body) -> Self {
        Self {
            slip: odometry.slip.powi(2),
            systematic: [odometry.diameter_ratio_sd.powi(2), odometry.track_scale_sd.powi(2)],
            track_m: body.track_m,
            steers: body.steering.is_some(),
        }
    }

    /// The covariance at the start, where the pose is exact because it defines the mission frame.
    pub(crate) fn start(&self) -> Covariance {
        let [ratio, track] = self.systematic;
        Covariance(SMatrix::from_diagonal(&Error::from([0.0, 0.0, 0.0, ratio, track])))
    }

    /// The covariance after the arc `moved.v` and the turn `moved.omega`, metres and radians, that were integrated from `pose`.
    pub(crate) fn after(&self, before: &Covariance, pose: Pose2, moved: Twist) -> Covariance {
        let Twist { v: arc, omega: turn } = moved;
        let axis = Pose2 { heading: pose.heading + turn / 2.0, ..pose }.axis();
        // The error of the pose that follows from one of arc and turn; the turn's acts half way through the arc.
        let effect = |arc_error: f64, turn_error: f64| {
            let aside = 0.5 * arc * turn_error;
            Error::from([
                arc_error * axis.x - aside * axis.y,
                arc_error * axis.y + aside * axis.x,
                turn_error,
                0.0,
                0.0,
            ])
        };
        let mut carried = SMatrix::<f64, 5, 5>::identity();
        carried[(0, 2)] = -arc * axis.y;
        carried[(1, 2)] = arc * axis.x;
        let half_track = self.track_m / 2.0;
        let (ratio, track, slips) = if self.steers {
            let along = effect(1.0, turn / if arc == 0.0 { 1.0 } else { arc });
            let slips = [along * (self.slip * arc.abs()).sqrt(), Error::zeros()];
            (effect(0.0, turn), Error::zeros(), slips)
        } else {
            // A wheel's way is the arc, more or less half the track times the turn.
            let [left, right] = [arc - turn * half_track, arc + turn * half_track];
            let slip = |rolled: f64| (self.slip * rolled.abs()).sqrt();
            let slips = [
                effect(0.5, -1.0 / self.track_m) * slip(left),
                effect(0.5, 1.0 / self.track_m) * slip(right),
            ];
            let ratio = effect(0.5 * turn * half_track, arc / self.track_m);
            (ratio, effect(0.0, -turn), slips)
        };
        carried.set_column(3, &(carried.column(3) + ratio));
        carried.set_column(4, &(carried.column(4) + track));
        let noise: SMatrix<f64, 5, 5> = slips.iter().map(|slip| slip * slip.transpose()).sum();
        Covariance(carried * before.0 * carried.transpose() + noise)
    }

    /// The covariance after a motion that nobody measured: each wheel rolled any way up to `farthest` metres, forward or
    /// back. The robot may have gone as far aside as ahead, because it may have turned first.
    pub(crate) fn after_lost(&self, before: &Covariance, farthest: f64) -> Covariance {
        // Evenly distributed, for each wheel. A car turns less than two wheels that roll freely, so this holds for it too.
        let wheel = farthest * farthest / 3.0;
        let place = wheel / 2.0;
        let heading = 2.0 * wheel / (self.track_m * self.track_m);
        Covariance(
            before.0 + SMatrix::from_diagonal(&Error::from([place, place, heading, 0.0, 0.0])),
        )
    }
}

impl Covariance {
    /// The entries of x, y and theta: xx, xy, x theta, yy, y theta, theta theta; m^2, m rad, rad^2.
    pub(crate) fn of_pose(&self) -> [f64; 6] {
        [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|entry| self.0[entry])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::mission::Mission;
    use std::path::Path;

    fn model(settings: &str) -> ErrorModel {
        let text = format!("target = [3, 0]\n[robot.odometry]\n{settings}");
        let mission = Mission::parse(&text, Path::new("test.toml")).unwrap();
        ErrorModel::new(&mission.robot.odometry, &mission.body())
    }

    const AHEAD: Twist = Twist { v: 0.002, omega: 0.0 };

    /// The covariance after `steps` times the same motion.
    fn drive(model: &ErrorModel, steps: usize, moved: Twist) -> [f64; 6] {
        let (mut pose, mut covariance) = (Pose2::default(), model.start());
        for _ in 0..steps {
            covariance = model.after(&covariance, pose, moved);
            pose = pose.along_arc(moved.v, moved.omega);
        }
        covariance.of_pose()
    }

    fn close(got: f64, want: f64) {
        assert!((got - want).abs() <= 1e-3 * want.abs(), "got {got}, want {want}");
    }

    #[test]
    fn slip_on_a_straight_way_by_hand() {
        // Variance of the heading 2 q s / W^2, aside its integral q s^3 2 / (3 W^2), ahead q s / 2.
        let model = model("slip = 0.01\ndiameter_ratio_sd = 0\ntrack_scale_sd = 0");
        let [xx, _, _, yy, _, heading] = drive(&model, 1000, AHEAD);
        let per_metre = 2.0 * 1e-4 / (0.26 * 0.26);
        close(heading, per_metre * 2.0);
        close(yy, per_metre * 8.0 / 3.0);
        close(xx, 1e-4 * 2.0 / 2.0);
    }

    #[test]
    fn unequal_wheels_bend_a_straight_way_into_a_circle() {
        // The heading is off by e s / W and the way aside by e s^2 / 2 W.
        let model = model("slip = 0\ndiameter_ratio_sd = 0.006\ntrack_scale_sd = 0");
        let [_, _, _, yy, _, heading] = drive(&model, 1000, AHEAD);
        let variance = 0.006 * 0.006;
        close(heading, variance * (2.0_f64 / 0.26).powi(2));
        close(yy, variance * (4.0_f64 / 2.0 / 0.26).powi(2));
    }

    #[test]
    fn an_uncertain_track_is_undone_by_turning_back() {
        let model = model("slip = 0\ndiameter_ratio_sd = 0\ntrack_scale_sd = 0.01");
        let there = Twist { v: 0.0, omega: 0.02 };
        let [.., heading] = drive(&model, 50, there);
        close(heading, 1e-4);
        let (mut covariance, mut pose) = (model.start(), Pose2::default());
        for omega in [0.02; 50].into_iter().chain([-0.02; 50]) {
            covariance = model.after(&covariance, pose, Twist { v: 0.0, omega });
            pose = pose.along_arc(0.0, omega);
        }
        assert!(covariance.of_pose()[5] < 1e-18);
    }
}
