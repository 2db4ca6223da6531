//! Calibration file named by a mission.

use super::{Mission, MissionError, read_bounded};
use crate::odometry::Calibration;

impl Mission {
    /// Replaces the name of the calibration file by its values, so that a run is independent of the
    /// file. Relative paths are resolved against the current directory.
    ///
    /// # Errors
    /// If the file cannot be read or is invalid.
    pub fn with_calibration(mut self) -> Result<Self, MissionError> {
        if let Some(file) = self.robot.calibration.take() {
            self.robot.odometry = read_bounded(&file)
                .map_err(|error| error.to_string())
                .and_then(|text| Calibration::parse(&text))
                .map_err(|problem| MissionError::Calibration { file, problem })?;
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        odometry::{Odometry, Provenance},
        testing::mission,
    };

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
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(&file, Calibration::text(calibrated()).unwrap()).unwrap();
        let named = mission(&format!("robot.calibration = {:?}", file.path()));
        let with_values = named.with_calibration().unwrap();
        assert_eq!(with_values.robot.odometry, calibrated());
        drop(file);
        let copy = mission(&toml::to_string(&with_values).unwrap());
        assert_eq!(copy.with_calibration().unwrap().robot.odometry, calibrated());
    }

    #[test]
    fn a_calibration_file_that_cannot_be_used_is_refused_with_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let whole = Calibration::text(calibrated()).unwrap();
        for (name, text, said) in [
            ("missing", None, "missing"),
            ("empty", Some(String::new()), "robot"),
            ("unknown", Some(whole.replace("slip_sd", "slip_off")), "slip_off"),
            ("range", Some(whole.replace("1.004", "2.004")), "diameter_ratio"),
            ("half", Some("[robot.odometry]\nslip = 0.001".to_owned()), "calibrated"),
        ] {
            let file = folder.path().join(name);
            text.into_iter().for_each(|text| std::fs::write(&file, text).unwrap());
            let named = mission(&format!("robot.calibration = {file:?}"));
            let refusal = named.with_calibration().unwrap_err();
            let says_file =
                matches!(&refusal, MissionError::Calibration { file: it, .. } if *it == file);
            assert!(says_file && refusal.to_string().contains(said), "{name}: {refusal:?}");
        }
    }
}
