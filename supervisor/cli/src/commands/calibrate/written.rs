//! A calibration's file, picture and lines.

use std::{
    fs,
    path::{Path, PathBuf},
};

use calibration::loops::Estimate;
use common::{
    file::{FileError, replace},
    mission::{Calibration, Odometry, Provenance},
};
use picture::{Chart, Mark, Series};
use serde_json::json;

use console::{failure::Failure, logging::today, output::print_text};

pub(super) struct Found {
    pub robot: String,
    pub method: &'static str,
    pub before: Odometry,
    pub estimate: Estimate,
    pub metres: f64,
    pub seconds: f64,
    pub residuals: Vec<Residual>,
    pub directory: PathBuf,
}

/// A loop or a square against the estimate.
pub(super) struct Residual {
    pub number: u32,
    pub to_the_left: bool,
    pub deviations: f64,
}

impl Found {
    /// A kill leaves the old file or the new one.
    pub(super) fn write(&self, file: &Path) -> Result<(), Failure> {
        let mut odometry = self.estimate.odometry(&self.before);
        odometry.calibrated = Some(Provenance {
            date: today(),
            robot: self.robot.clone(),
            method: self.method.to_owned(),
            metres: self.metres,
            chi2_per_dof: self.estimate.chi2_per_dof,
        });
        let text = Calibration::new(odometry).to_text()?;
        Ok(replace(file, text).map_err(FileError::of("write", file))?)
    }

    pub(super) fn print(&self, file: &Path, as_json: bool) -> Result<(), Failure> {
        let picture = self.picture()?;
        let it = &self.estimate;
        let text = if as_json {
            let object = json!({
                "diameter_ratio": it.ratio(),
                "diameter_ratio_sd": it.ratio_sd(),
                "track_scale": it.track(),
                "track_scale_sd": it.track_sd(),
                "slip": it.slip,
                "slip_sd": it.slip_sd,
                "method": self.method,
                "loops": self.residuals.len(),
                "metres": self.metres,
                "seconds": self.seconds,
                "chi2_per_dof": it.chi2_per_dof,
                "file": file,
                "picture": picture,
            });
            format!("{object}\n")
        } else {
            format!(
                "ratio of the diameters, right over left: {:.5} +- {:.5}\n\
                 track over nominal:                      {:.5} +- {:.5}\n\
                 slip of a wheel, m per square root of m: {:.5} +- {:.5}\n\
                 {} {}, {:.0} m in {:.1} min, chi^2 {:.2} per degree of freedom\n\
                 picture: {}\ncalibration: {}; name it in a mission: robot.calibration = {:?}\n",
                it.ratio(),
                it.ratio_sd(),
                it.track(),
                it.track_sd(),
                it.slip,
                it.slip_sd,
                self.residuals.len(),
                if self.method == "wall" { "loops" } else { "squares" },
                self.metres,
                self.seconds / 60.0,
                it.chi2_per_dof,
                picture.display(),
                file.display(),
                file.display(),
            )
        };
        Ok(print_text(&text)?)
    }

    /// The residuals, beside the recording of the run.
    fn picture(&self) -> Result<PathBuf, Failure> {
        let file = self.directory.join("calibration.svg");
        fs::write(&file, self.svg()).map_err(FileError::of("write", &file))?;
        Ok(file)
    }

    fn svg(&self) -> String {
        let series = |name, to_the_left: bool| Series {
            name,
            mark: if to_the_left { Mark::Discs } else { Mark::Crosses },
            points: self
                .residuals
                .iter()
                .filter(|it| it.to_the_left == to_the_left)
                .map(|it| [f64::from(it.number), it.deviations])
                .collect(),
        };
        Chart {
            title: "Residuals of the calibration",
            description: "How far each loop or square is from what the calibrated wheels say, in standard deviations.",
            axes: ["loop or square", "residual, standard deviations"],
            series: vec![series("to the left", true), series("to the right", false)],
        }
        .svg()
    }
}
