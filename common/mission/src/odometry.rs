//! How the wheels of a robot differ from its nominal body, as far as is known, and the file in which a calibration says so.

use serde::{Deserialize, Serialize};

/// The wheels as dead reckoning takes them, each value with its standard deviation. With s = `distance_scale` and
/// rho = `diameter_ratio` the left wheel rolls 2 s / (1 + rho) times its nominal way and the right one 2 s rho / (1 + rho) times. The
/// track on the ground is `track_scale` times the nominal one.
///
/// The defaults are those of a robot that nobody has calibrated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Odometry {
    /// Diameter of the right wheel over that of the left one.
    pub diameter_ratio: f64,
    pub diameter_ratio_sd: f64,
    /// Track on the ground over the nominal one.
    pub track_scale: f64,
    pub track_scale_sd: f64,
    /// Mean diameter of the wheels over the nominal one.
    pub distance_scale: f64,
    pub distance_scale_sd: f64,
    /// Standard deviation of the way that a wheel loses or wins by slip, metres per square root of a metre.
    pub slip: f64,
    pub slip_sd: f64,
    /// Where the values come from; none without a calibration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibrated: Option<Provenance>,
}

/// Where calibrated values come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// The day, year-month-day, UTC.
    pub date: String,
    /// The name of the robot.
    pub robot: String,
    /// `wall` or `squares`.
    pub method: String,
    /// Metres that the wheels rolled, on average of both.
    pub metres: f64,
    /// The sum of the squared residuals over their variances, per degree of freedom.
    pub chi2_per_dof: f64,
}

/// The procedure of `firsthand calibrate`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CalibrationPlan {
    pub procedure: Procedure,
    /// The standard deviation of the ratio of the diameters at which it may stop.
    pub ratio_sd: f64,
    /// The most loops.
    pub loops: u32,
    /// The way from the wall, or the side of the square, metres.
    pub drive_m: f64,
}

/// The way that is driven.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Procedure {
    /// Loops before a wall.
    #[default]
    Wall,
    /// One square to the left.
    LeftSquare,
    /// One square to the right.
    RightSquare,
}

impl Default for CalibrationPlan {
    fn default() -> Self {
        Self { procedure: Procedure::Wall, ratio_sd: 0.0005, loops: 12, drive_m: 2.0 }
    }
}

impl Default for Odometry {
    fn default() -> Self {
        Self {
            diameter_ratio: 1.0,
            diameter_ratio_sd: 0.005,
            track_scale: 1.0,
            track_scale_sd: 0.015,
            distance_scale: 1.0,
            distance_scale_sd: 0.01,
            slip: 0.001,
            slip_sd: 0.0005,
            calibrated: None,
        }
    }
}

impl Odometry {
    /// Ways of the left and the right wheel over their nominal ones.
    #[must_use]
    pub fn wheel_scales(&self) -> [f64; 2] {
        let both = 2.0 * self.distance_scale / (1.0 + self.diameter_ratio);
        [both, both * self.diameter_ratio]
    }

    /// The values with the range of each, and the names of their keys in a mission.
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

/// A calibration file: the table `[robot.odometry]` as a mission has it, with its provenance.
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
    #[must_use]
    pub const fn new(odometry: Odometry) -> Self {
        Self { robot: Calibrated { odometry } }
    }

    /// The text of the file.
    ///
    /// # Errors
    /// If a value cannot be written as TOML.
    pub fn to_text(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }

    /// The values in the text of a file.
    ///
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
