//! `firsthand replay-log`: what mapper and planner make of a log of real sonars.

use std::{fs, path::PathBuf, process::ExitCode};

use clap::Args;
use experiments::{replay, sonar_log};

use super::{Failure, print_text};

/// Give a log of eight sonars and odometry to mapper and planner, and draw what they believe at its end.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// CSV: t_s,x_m,y_m,theta_rad,z0_m,...,z7_m; sonars at -90, -37.5, -22.5, -7.5, 7.5, 22.5, 37.5, 90 degrees, `inf` where
    /// nothing was heard.
    log: PathBuf,
    /// The picture to write: an SVG file.
    #[arg(long, value_name = "FILE", default_value = "sonar-log.svg")]
    out: PathBuf,
}

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let log = sonar_log::read(&arguments.log)?;
    let replay = replay::replay(&log)?;
    let out = arguments.out.display();
    fs::write(&arguments.out, replay.svg("sonar-log"))
        .map_err(|error| format!("cannot write {out}: {error}; give another --out"))?;
    print_text(&format!(
        "{} samples, {:.1} s, {:.1} m by odometry, {} safety events\npicture: {out}\n",
        log.len(),
        replay.time_s,
        replay.path_m,
        replay.safety_events
    ))?;
    Ok(ExitCode::SUCCESS)
}
