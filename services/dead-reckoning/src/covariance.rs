//! First-order covariance of the pose's error.
//!
//! The error has seven parts: x, y, theta; three constant over a mission, of the wheel diameters'
//! ratio, the track and the mean diameter (J. Borenstein, L. Feng, IEEE Trans. Robotics and
//! Automation 12(6), 1996); and a gyro's bias. Each wheel slips independently, with a variance that
//! grows with its travel (K. S. Chong, L. Kleeman, "Accurate odometry and error modelling for a
//! mobile robot", ICRA 1997). A car has its driven wheel's slip and, in place of the ratio,
//! nominally the same share of its curvature.

use common::{
    kinematics::{Pose2, Twist},
    mission::{Body, Odometry},
};
use nalgebra::{SMatrix, SVector};

/// x, y, theta, diameter ratio, track, distance, gyro bias; m, rad, shares, rad/s.
pub(crate) const PARTS: usize = 7;
pub(crate) const BIAS: usize = 6;

pub(crate) type Error = SVector<f64, PARTS>;
pub(crate) type Matrix = SMatrix<f64, PARTS, PARTS>;

/// Deviation of a gyro's bias before it is learned at rest, rad/s: 0.1 degrees/s. Worse sources
/// remove their bias themselves. With more, a robot that never rests takes unequal wheels for bias.
pub(crate) const BIAS_RAD_S: f64 = 0.002;
/// Growth of that deviation, rad/s per square root of a second.
const BIAS_WALK: f64 = 2e-5;

#[derive(Clone, Copy, Debug)]
pub(crate) struct ErrorModel {
    /// Variance, m^2 per metre rolled.
    slip: f64,
    systematic: [f64; 3],
    track_m: f64,
    steers: bool,
    /// Variance of a tick's turn by counts, rad^2: each reading is off by half a count.
    counted: f64,
}

/// Factor of the earlier error, and added covariance.
pub(crate) struct Transition {
    pub carried: Matrix,
    pub noise: Matrix,
}

impl ErrorModel {
    pub(crate) fn new(odometry: &Odometry, body: &Body) -> Self {
        assert!(body.track_m > 0.0 && body.metres_per_count() > 0.0);
        Self {
            slip: odometry.slip.powi(2),
            systematic: [
                odometry.diameter_ratio_sd.powi(2),
                odometry.track_scale_sd.powi(2),
                odometry.distance_scale_sd.powi(2),
            ],
            track_m: body.track_m,
            steers: body.steering.is_some(),
            counted: (body.metres_per_count() / body.track_m).powi(2),
        }
    }

    /// Returns the start's covariance, exact in pose because it defines the mission frame.
    pub(crate) fn start(&self) -> Matrix {
        let [ratio, track, distance] = self.systematic;
        let bias = BIAS_RAD_S * BIAS_RAD_S;
        Matrix::from_diagonal(&Error::from([0.0, 0.0, 0.0, ratio, track, distance, bias]))
    }

    /// The shares are of ratio, track and distance.
    pub(crate) fn corrected(&self, by_counts: Twist, shares: [f64; 3]) -> Twist {
        let [ratio, track, distance] = shares;
        let v = by_counts.v * (1.0 + distance);
        let omega = by_counts.omega * (1.0 + distance);
        if self.steers {
            return Twist { v, omega: omega * (1.0 + ratio) };
        }
        Twist {
            v: v + ratio * 0.25 * omega * self.track_m,
            omega: (omega + ratio * v / self.track_m) / (1.0 + track),
        }
    }

    pub(crate) fn transition(&self, pose: Pose2, moved: Twist, seconds: f64) -> Transition {
        let Twist { v: arc, omega: turn } = moved;
        let axis = Pose2 { heading: pose.heading + turn / 2.0, ..pose }.axis();
        // Pose error by errors of arc and turn; the latter acts half way.
        let effect = |arc_error: f64, turn_error: f64| {
            let aside = 0.5 * arc * turn_error;
            Error::from([
                arc_error * axis.x - aside * axis.y,
                arc_error * axis.y + aside * axis.x,
                turn_error,
                0.0,
                0.0,
                0.0,
                0.0,
            ])
        };
        let mut carried = Matrix::identity();
        carried[(0, 2)] = -arc * axis.y;
        carried[(1, 2)] = arc * axis.x;
        let half_track = self.track_m / 2.0;
        let (ratio, track, slips) = if self.steers {
            let along = effect(1.0, turn / if arc == 0.0 { 1.0 } else { arc });
            let slips = [along * (self.slip * arc.abs()).sqrt(), Error::zeros()];
            (effect(0.0, turn), Error::zeros(), slips)
        } else {
            // Wheels roll the arc plus or minus half the track times the turn.
            let [left, right] = [arc - turn * half_track, arc + turn * half_track];
            let slip = |rolled: f64| (self.slip * rolled.abs()).sqrt();
            let slips = [
                effect(0.5, -1.0 / self.track_m) * slip(left),
                effect(0.5, 1.0 / self.track_m) * slip(right),
            ];
            (effect(0.5 * turn * half_track, arc / self.track_m), effect(0.0, -turn), slips)
        };
        carried.set_column(3, &(carried.column(3) + ratio));
        carried.set_column(4, &(carried.column(4) + track));
        carried.set_column(5, &(carried.column(5) + effect(arc, turn)));
        let mut noise: Matrix = slips.iter().map(|slip| slip * slip.transpose()).sum();
        noise[(BIAS, BIAS)] += BIAS_WALK * BIAS_WALK * seconds;
        Transition { carried, noise }
    }

    /// Returns a tick's quantization variance, which only a gyro reveals, rad^2: successive ticks
    /// cancel it. Constant counts mean rest within an eighth of a count.
    pub(crate) fn counted(&self, by_counts: Twist) -> f64 {
        let rests = by_counts.v == 0.0 && by_counts.omega == 0.0;
        if rests { self.counted / 64.0 } else { self.counted }
    }

    /// Returns the variance of a tick's turn by slip, rad^2, and the deviations that a whole motion
    /// shares: by unequal wheels, and by the track, rad.
    pub(crate) fn of_turn(&self, moved: Twist, seconds: f64) -> (f64, [f64; 2]) {
        let Transition { carried, noise } = self.transition(Pose2::default(), moved, seconds);
        let shared = |part: usize| self.systematic[part].sqrt() * carried[(2, 3 + part)];
        (noise[(2, 2)], [0, 1].map(shared))
    }

    /// Returns the covariance of unmeasured motion by up to `farthest` metres per wheel. The robot
    /// may have turned first, so both axes are equal.
    pub(crate) fn lost(&self, farthest: f64) -> Matrix {
        // Uniform distribution; cars turn less than free wheels.
        let wheel = farthest * farthest / 3.0;
        let place = wheel / 2.0;
        let heading = 2.0 * wheel / (self.track_m * self.track_m);
        Matrix::from_diagonal(&Error::from([place, place, heading, 0.0, 0.0, 0.0, 0.0]))
    }
}

/// Returns xx, xy, x theta, yy, y theta, theta theta; m^2, m rad, rad^2.
pub(crate) fn of_pose(covariance: &Matrix) -> [f64; 6] {
    upper(covariance.fixed_view::<3, 3>(0, 0).into_owned())
}

/// Returns the upper triangle of a covariance, row by row.
pub(crate) fn upper(covariance: SMatrix<f64, 3, 3>) -> [f64; 6] {
    [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|entry| covariance[entry])
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::mission::Mission;

    fn model(thousandths: [u8; 4]) -> ErrorModel {
        let [slip, ratio, track, distance] = thousandths.map(|it| f64::from(it) * 1e-3);
        let text = format!(
            "target = [3, 0]\n[robot.odometry]\nslip = {slip}\ndiameter_ratio_sd = {ratio}\ntrack_scale_sd = {track}\ndistance_scale_sd = {distance}"
        );
        let mission = Mission::parse(&text, "test.toml").unwrap();
        ErrorModel::new(&mission.robot.odometry, &mission.body())
    }

    const AHEAD: [Twist; 1000] = [Twist { v: 0.002, omega: 0.0 }; 1000];

    fn turn(omega: f64) -> [Twist; 50] {
        [Twist { v: 0.0, omega }; 50]
    }

    fn drive(model: &ErrorModel, ticks: impl IntoIterator<Item = Twist>) -> [f64; 6] {
        let (mut pose, mut covariance) = (Pose2::default(), model.start());
        for moved in ticks {
            let Transition { carried, noise } = model.transition(pose, moved, 0.1);
            covariance = carried * covariance * carried.transpose() + noise;
            pose = pose.along_arc(moved.v, moved.omega);
        }
        of_pose(&covariance)
    }

    fn close(got: f64, want: f64) {
        assert!((got - want).abs() <= 1e-3 * want.abs(), "got {got}, want {want}");
    }

    #[test]
    fn each_error_of_the_wheels_is_in_the_covariance_by_hand() {
        // Variances of slip: heading 2 q s / W^2, sideways its integral q s^3 2 / (3 W^2), ahead
        // q s / 2.
        let [xx, _, _, yy, _, heading] = drive(&model([10, 0, 0, 0]), AHEAD);
        let per_metre = 2.0 * 1e-4 / (0.26 * 0.26);
        close(heading, per_metre * 2.0);
        close(yy, per_metre * 8.0 / 3.0);
        close(xx, 1e-4 * 2.0 / 2.0);
        // Errors of unequal wheels: heading e s / W, sideways e s^2 / 2 W.
        let [_, _, _, yy, _, heading] = drive(&model([0, 6, 0, 0]), AHEAD);
        let variance = 0.006 * 0.006;
        close(heading, variance * (2.0_f64 / 0.26).powi(2));
        close(yy, variance * (4.0_f64 / 2.0 / 0.26).powi(2));
        // Larger wheels drive and turn farther.
        let larger = model([0, 0, 0, 10]);
        let [xx, .., yy, _, _] = drive(&larger, AHEAD);
        close(xx, 1e-4 * 4.0);
        assert!(yy < 1e-18);
        close(drive(&larger, turn(0.02))[5], 1e-4);
    }

    #[test]
    fn an_uncertain_track_is_undone_by_turning_back() {
        let model = model([0, 0, 10, 0]);
        close(drive(&model, turn(0.02))[5], 1e-4);
        assert!(drive(&model, [0.02, -0.02].into_iter().flat_map(turn))[5] < 1e-18);
    }
}
