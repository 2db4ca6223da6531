//! Calibration file named by a mission.

use std::path::Path;

use super::{Mission, MissionError, read_bounded};
use crate::odometry::{Calibration, Odometry};

fn read(path: &Path) -> Result<Odometry, MissionError> {
    let failed = |problem: String| MissionError::Calibration { file: path.to_path_buf(), problem };
    let text = read_bounded(path).map_err(|error| failed(error.to_string()))?;
    Calibration::parse(&text).map_err(failed)
}

impl Mission {
    /// Replaces the name of the calibration file by its values, so that a run is independent of the
    /// file. Relative paths are resolved against the current directory.
    ///
    /// # Errors
    /// If the file cannot be read or is invalid.
    pub fn with_calibration(mut self) -> Result<Self, MissionError> {
        if let Some(file) = self.robot.calibration.take() {
            self.robot.odometry = read(&file)?;
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use crate::odometry::Provenance;

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
