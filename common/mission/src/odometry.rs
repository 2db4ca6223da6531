//! Wheel deviations from the nominal body, and the calibration file.

use serde::{Deserialize, Serialize};

keys! {
    /// Wheel parameters, each with its standard deviation; the defaults describe an uncalibrated
    /// robot.
    ///
    /// Let s = `distance_scale` and rho = `diameter_ratio`. The left wheel rolls 2 s / (1 + rho)
    /// times its nominal distance. The right one rolls 2 s rho / (1 + rho) times. The track on the
    /// ground is `track_scale` times the nominal one.
    Odometry {
        diameter_ratio: f64 = 1.0,
        diameter_ratio_sd: f64 = 0.005,
        track_scale: f64 = 1.0,
        track_scale_sd: f64 = 0.015,
        distance_scale: f64 = 1.0,
        distance_scale_sd: f64 = 0.01,
        /// Standard deviation of the distance lost or gained, metres per square root of a metre.
        slip: f64 = 0.001,
        slip_sd: f64 = 0.0005,
        calibrated: Option<Provenance>,
    }
}

rows! {
    Provenance {
        /// Year-month-day, UTC.
        date: String,
        robot: String,
        /// `wall`, `squares` or `gyro`.
        method: String,
        metres: f64,
        /// Sum of squared residuals over their variances, per degree of freedom.
        chi2_per_dof: f64,
    }
}

keys! {
    CalibrationPlan {
        procedure: Procedure,
        /// Standard deviation of the diameter ratio at which the procedure may stop.
        ratio_sd: f64 = 0.0005,
        loops: u32 = 12,
        /// Distance from the wall, or side of the square.
        drive_m: f64 = 2.0,
    }
}

words! {
    #[derive(Default)]
    Procedure {
        #[default]
        Wall,
        LeftSquare,
        RightSquare,
        Turns,
        Gyro,
        BringUp,
    }
}

impl Odometry {
    /// Returns the distances of the left and right wheel over the nominal ones.
    pub fn wheel_scales(&self) -> [f64; 2] {
        let both = 2.0 * self.distance_scale / (1.0 + self.diameter_ratio);
        [both, both * self.diameter_ratio]
    }

    pub(crate) fn ranges(&self) -> [crate::Ranged; 8] {
        [
            ("robot.odometry.diameter_ratio", self.diameter_ratio, 0.8..=1.25),
            ("robot.odometry.diameter_ratio_sd", self.diameter_ratio_sd, 0.0..=0.1),
            ("robot.odometry.track_scale", self.track_scale, 0.8..=1.25),
            ("robot.odometry.track_scale_sd", self.track_scale_sd, 0.0..=0.1),
            ("robot.odometry.distance_scale", self.distance_scale, 0.8..=1.25),
            ("robot.odometry.distance_scale_sd", self.distance_scale_sd, 0.0..=0.1),
            ("robot.odometry.slip", self.slip, 0.0..=0.5),
            ("robot.odometry.slip_sd", self.slip_sd, 0.0..=0.5),
        ]
    }
}

/// Table `[robot.odometry]` in the form of a mission, with its provenance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    robot: Calibrated,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Calibrated {
    odometry: Odometry,
}

impl Calibration {
    pub fn text(odometry: Odometry) -> Result<String, toml::ser::Error> {
        toml::to_string(&Self { robot: Calibrated { odometry } })
    }

    /// # Errors
    /// Returns a sentence that describes the fault.
    pub fn parse(text: &str) -> Result<Odometry, String> {
        let file: Self =
            toml::from_str(text).map_err(|error| error.message().trim().replace('\n', " "))?;
        let odometry = file.robot.odometry;
        for (key, value, range) in odometry.ranges() {
            if !range.contains(&value) {
                let least = range.start();
                let most = range.end();
                return Err(format!("{key} = {value} is outside {least} to {most}"));
            }
        }
        if odometry.calibrated.is_none() {
            return Err("the table [robot.odometry.calibrated] is missing".to_owned());
        }
        Ok(odometry)
    }
}
