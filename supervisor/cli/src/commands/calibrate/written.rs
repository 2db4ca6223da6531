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

use console::{failure::Failure, output::print_text};

pub(super) struct Found {
    pub(super) robot: String,
    pub(super) method: &'static str,
    pub(super) before: Odometry,
    pub(super) estimate: Estimate,
    pub(super) metres: f64,
    pub(super) seconds: f64,
    pub(super) residuals: Vec<Residual>,
    pub(super) directory: PathBuf,
}

/// A loop or a square against the estimate.
pub(super) struct Residual {
    pub(super) number: u32,
    pub(super) to_the_left: bool,
    pub(super) deviations: f64,
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

/// UTC, year-month-day.
fn today() -> String {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let days = now.map_or(0, |since| since.as_secs() / 86_400);
    date(i64::try_from(days).unwrap_or_default())
}

/// `days` since 1970, by H. Hinnant's algorithm `civil_from_days`.
fn date(days: i64) -> String {
    let shifted = days + 719_468;
    let era = shifted.div_euclid(146_097);
    let of_era = shifted.rem_euclid(146_097);
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let shifted_month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
    let year = year + era * 400 + i64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_day_has_its_date() {
        for (days, text) in [(0, "1970-01-01"), (11_016, "2000-02-29"), (20_779, "2026-11-22")] {
            assert_eq!(date(days), text);
        }
    }
}
