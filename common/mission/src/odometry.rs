//! The wheels' differences from the nominal body, and the calibration file.

use serde::{Deserialize, Serialize};

keys! {
    /// Each value with its standard deviation. With s = `distance_scale` and rho = `diameter_ratio` the left wheel rolls
    /// 2 s / (1 + rho) times its nominal way and the right one 2 s rho / (1 + rho) times. The track on the ground is
    /// `track_scale` times the nominal one.
    ///
    /// The defaults are those of a robot that nobody has calibrated.
    Odometry {
        /// Right over left.
        diameter_ratio: f64 = 1.0,
        diameter_ratio_sd: f64 = 0.005,
        /// The track on the ground over the nominal one.
        track_scale: f64 = 1.0,
        track_scale_sd: f64 = 0.015,
        /// Mean diameter over the nominal one.
        distance_scale: f64 = 1.0,
        distance_scale_sd: f64 = 0.01,
        /// Standard deviation of the way lost or won, metres per square root of a metre.
        slip: f64 = 0.001,
        slip_sd: f64 = 0.0005,
        calibrated: Option<Provenance>,
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Year-month-day, UTC.
    pub date: String,
    pub robot: String,
    /// `wall`, `squares` or `gyro`.
    pub method: String,
    /// The way that the wheels rolled, on average.
    pub metres: f64,
    /// Squared residuals over their variances.
    pub chi2_per_dof: f64,
}

keys! {
    CalibrationPlan {
        procedure: Procedure,
        /// Standard deviation of the ratio of the diameters at which it may stop.
        ratio_sd: f64 = 0.0005,
        loops: u32 = 12,
        /// The way from the wall, or the side of the square.
        drive_m: f64 = 2.0,
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Procedure {
    #[default]
    Wall,
    LeftSquare,
    RightSquare,
    /// To and fro on the spot.
    Turns,
    /// Ahead, around, back and around, for a gyro.
    Gyro,
    /// All that `firsthand bring-up` looks at.
    BringUp,
}

impl Odometry {
    /// The ways of the left and the right wheel over the nominal ones.
    pub fn wheel_scales(&self) -> [f64; 2] {
        let both = 2.0 * self.distance_scale / (1.0 + self.diameter_ratio);
        [both, both * self.diameter_ratio]
    }

    pub(crate) fn ranges(&self) -> [(&'static str, f64, std::ops::RangeInclusive<f64>); 8] {
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

/// The table `[robot.odometry]` as a mission has it, with its provenance.
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
    pub const fn new(odometry: Odometry) -> Self {
        Self { robot: Calibrated { odometry } }
    }

    /// # Errors
    /// If a value cannot be written as TOML.
    pub fn to_text(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }

    /// # Errors
    /// The sentence that says what is wrong.
    pub fn parse(text: &str) -> Result<Odometry, String> {
        let file: Self =
            toml::from_str(text).map_err(|error| error.message().trim().replace('\n', " "))?;
        let odometry = file.robot.odometry;
        for (key, value, range) in odometry.ranges() {
            if !range.contains(&value) {
                let (least, most) = (range.start(), range.end());
                return Err(format!("{key} = {value} is not between {least} and {most}"));
            }
        }
        if odometry.calibrated.is_none() {
            return Err("it has no table [robot.odometry.calibrated]".to_owned());
        }
        Ok(odometry)
    }
}
