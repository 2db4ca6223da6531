//! Covariances of odometry and speeds, from the mission's `[robot.odometry]`. Odometry has no
//! fixes, so its error only grows. Pure.

use common::{
    kinematics::Pose2,
    mission::{Mission, Odometry},
    samples::PoseSample,
};
use glam::{DMat3, DVec3};

/// Variance of components that wheels do not measure.
const UNKNOWN: f64 = 1e6;

type Covariance = [f64; 36];

/// Errors of x, y and heading in the odometry frame since the bridge first saw the run. Systematic
/// ones are per relative error of wheel ratio, track and mean diameter, as in dead reckoning.
#[derive(Debug)]
pub struct Drift {
    slipped: DMat3,
    systematic: [DVec3; 3],
    at_s: Option<f64>,
}

impl Drift {
    pub const NONE: Self = Self { slipped: DMat3::ZERO, systematic: [DVec3::ZERO; 3], at_s: None };

    /// Returns the covariances of pose and speeds, for stamps `pace` times slower than mission
    /// time.
    pub fn after(&mut self, sample: &PoseSample, mission: &Mission, pace: f64) -> [Covariance; 2] {
        let (model, body) = (&mission.robot.odometry, mission.body());
        let period_s = 1.0 / mission.robot.rate_hz;
        let now_s = sample.stamp.seconds();
        let gap_s = self.at_s.replace(now_s).map_or(0.0, |before| (now_s - before).max(0.0));
        let (v, omega, track_m) = (sample.v_m_s, sample.omega_rad_s, body.track_m);
        self.grow(model, track_m, sample.odometry(), [v * gap_s, omega * gap_s]);
        // Each wheel slips independently, and each reading is off by up to half a count.
        let slip = model.slip.powi(2) * v.abs() / period_s;
        let counted = (body.metres_per_count() / period_s).powi(2) / 6.0;
        let ahead = (model.distance_scale_sd * v).powi(2) + (slip + counted) / 2.0;
        let turn = (model.diameter_ratio_sd * v / track_m).powi(2)
            + (model.track_scale_sd * omega).powi(2)
            + 2.0 * (slip + counted) / track_m.powi(2);
        let mut speeds = [0.0; 36];
        for (part, variance) in [ahead, ahead, UNKNOWN, UNKNOWN, UNKNOWN, turn].iter().enumerate() {
            speeds[7 * part] = variance * if *variance < UNKNOWN { pace * pace } else { 1.0 };
        }
        [self.covariance(model), speeds]
    }

    fn grow(&mut self, model: &Odometry, track_m: f64, at: Pose2, [arc, turn]: [f64; 2]) {
        let (y, x) = (at.heading - turn / 2.0).sin_cos();
        let effect = |arc_error: f64, turn_error: f64| {
            let aside = 0.5 * arc * turn_error;
            DVec3::new(arc_error * x - aside * y, arc_error * y + aside * x, turn_error)
        };
        // A heading error rotates subsequent motion.
        let carried = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::new(-arc * y, arc * x, 1.0));
        self.slipped = carried * self.slipped * carried.transpose();
        for side in [-1.0, 1.0] {
            let rolled = arc + side * turn * track_m / 2.0;
            let slip = effect(0.5, side / track_m) * (model.slip * rolled.abs().sqrt());
            self.slipped += outer(slip);
        }
        let ratio = effect(turn * track_m / 4.0, arc / track_m);
        let added = [ratio, effect(0.0, -turn), effect(arc, turn)];
        for (error, added) in self.systematic.iter_mut().zip(added) {
            *error = carried * *error + added;
        }
    }

    fn covariance(&self, model: &Odometry) -> Covariance {
        let shares = [model.diameter_ratio_sd, model.track_scale_sd, model.distance_scale_sd];
        let [x, y, turn] = self
            .systematic
            .iter()
            .zip(shares)
            .map(|(error, sd)| outer(*error * sd))
            .fold(self.slipped, |sum, error| sum + error)
            .to_cols_array_2d();
        let covariance = [x[0], x[1], x[2], y[1], y[2], turn[2]];
        let mut whole = PoseSample { covariance, ..PoseSample::default() }.covariance_6x6();
        for part in [2, 3, 4] {
            whole[7 * part] = UNKNOWN;
        }
        whole
    }
}

fn outer(error: DVec3) -> DMat3 {
    DMat3::from_cols(error * error.x, error * error.y, error * error.z)
}
