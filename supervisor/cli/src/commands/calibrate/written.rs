//! Writes and prints a calibration.

use calibration::loops::Estimate;
use common::{
    file::{FileError, replace},
    mission::{Calibration, Odometry, Provenance},
};
use serde_json::json;

use super::Arguments;
use console::{failure::Result, logging::today, output::print_line};

pub struct Found {
    pub method: &'static str,
    pub estimate: Estimate,
    pub metres: f64,
    pub seconds: f64,
}

impl Found {
    /// Replaces the file atomically.
    pub fn write(&self, arguments: &Arguments, before: &Odometry) -> Result {
        let (file, setting) = (&arguments.out, &arguments.setting);
        let it = &self.estimate;
        let mut odometry = it.odometry(before);
        odometry.calibrated = Some(Provenance {
            date: today(),
            robot: setting.robot.to_string(),
            method: self.method.to_owned(),
            metres: self.metres,
            chi2_per_dof: it.chi2_per_dof,
        });
        let mut object = serde_json::to_value(&odometry)?;
        let text = Calibration::text(odometry)?;
        replace(file, &text).map_err(FileError::of("write", file))?;
        if setting.json {
            object["residuals"] = json!(it.residuals);
            object["seconds"] = json!(self.seconds);
            object["file"] = json!(file);
            print_line(object)
        } else {
            let (loops, minutes) = (it.residuals.len(), self.seconds / 60.0);
            print_line(format_args!(
                "{text}# {loops} loops, squares or motions in {minutes:.1} min; name it in a mission: robot.calibration = {file:?}"
            ))
        }
    }
}
