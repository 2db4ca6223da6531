//! How the wheels of a robot differ from its nominal body, as far as is known, and the file in which a calibration says so.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::{Mission, MissionError, check::read_bounded};

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

    fn read(path: &Path) -> Result<Odometry, MissionError> {
        let failed =
            |problem: String| MissionError::Calibration { file: path.to_path_buf(), problem };
        let text = read_bounded(path).map_err(|error| failed(error.to_string()))?;
        Self::parse(&text).map_err(failed)
    }
}

impl Mission {
    /// The mission with the values of its calibration file in place of the name of that file: a run does not depend on the file
    /// any more. A relative name is taken from the current directory.
    ///
    /// # Errors
    /// If the file cannot be read, or is no calibration.
    pub fn with_calibration(mut self) -> Result<Self, MissionError> {
        if let Some(file) = self.robot.calibration.take() {
            self.robot.odometry = Calibration::read(&file)?;
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Mission, MissionError> {
        Mission::parse(&format!("target = [3, 0]\n{text}"), Path::new("m.toml"))
    }

    fn calibrated() -> Odometry {
        Odometry {
            diameter_ratio: 1.004,
            diameter_ratio_sd: 0.0004,
            calibrated: Some(Provenance {
                date: "2026-11-22".to_owned(),
                robot: "x80".to_owned(),
                method: "wall".to_owned(),
                metres: 37.0,
                chi2_per_dof: 1.1,
            }),
            ..Odometry::default()
        }
    }

    #[test]
    fn a_mission_takes_the_values_of_its_calibration_file_and_no_longer_needs_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("calibration.toml");
        std::fs::write(&file, Calibration::new(calibrated()).to_text().unwrap()).unwrap();
        let mission = parse(&format!("robot.calibration = {:?}", file.display())).unwrap();
        let mission = mission.with_calibration().unwrap();
        assert_eq!(mission.robot.odometry, calibrated());
        std::fs::remove_file(&file).unwrap();
        let copy = toml::to_string(&mission).unwrap();
        let copy = Mission::parse(&copy, Path::new("run.toml")).unwrap();
        assert_eq!(copy.with_calibration().unwrap().robot.odometry, calibrated());
    }

    #[test]
    fn a_calibration_file_that_cannot_be_used_is_refused_with_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let whole = Calibration::new(calibrated()).to_text().unwrap();
        let cases = [
            ("missing", None, "missing"),
            ("empty", Some(String::new()), "robot"),
            ("unknown", Some(whole.replace("slip_sd", "slip_off")), "slip_off"),
            ("range", Some(whole.replace("1.004", "2.004")), "diameter_ratio"),
            ("half", Some("[robot.odometry]\nslip = 0.001".to_owned()), "calibrated"),
        ];
        for (name, text, said) in cases {
            let file = folder.path().join(name);
            if let Some(text) = text {
                std::fs::write(&file, text).unwrap();
            }
            let mission = parse(&format!("robot.calibration = {:?}", file.display())).unwrap();
            let refusal = mission.with_calibration().unwrap_err();
            assert!(
                matches!(&refusal, MissionError::Calibration { file: its, .. } if *its == file),
                "{refusal:?}"
            );
            assert!(refusal.to_string().contains(said), "{name}: {refusal}");
        }
    }

    #[test]
    fn a_right_wheel_that_is_larger_rolls_farther_and_the_mean_is_the_distance_scale() {
        let odometry =
            Odometry { diameter_ratio: 1.02, distance_scale: 0.99, ..Odometry::default() };
        let [left, right] = odometry.wheel_scales();
        assert!((right / left - 1.02).abs() < 1e-12);
        assert!((f64::midpoint(left, right) - 0.99).abs() < 1e-12);
    }

    #[test]
    fn a_value_of_the_odometry_that_cannot_be_is_refused_with_line_and_key() {
        let refusal = parse("[robot.odometry]\ntrack_scale = 3").unwrap_err().to_string();
        assert!(refusal.starts_with("m.toml:3: robot.odometry.track_scale: "), "{refusal}");
    }

    #[test]
    fn a_mission_that_has_values_and_a_calibration_file_is_told_that_the_file_wins() {
        let text = "[robot]\ncalibration = 'c.toml'\n[robot.odometry]\nslip = 0.002";
        assert!(parse(text).unwrap().remarks[0].contains("robot.calibration"));
    }
}
