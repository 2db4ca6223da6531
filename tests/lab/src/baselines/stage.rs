//! `firsthand-lab stage NAME`: a planner to compare with, as the process of a stage, which `firsthand stage NAME` becomes.

use std::ffi::OsString;

use crate::baselines::{bug::Bug, shell::Shell, wavefront::Wavefront};
use clap::Args;
use common::{shell::run_stage, stage_command};
use console::failure::{Failure, Refused};
use processes::stages::PLANNER;

/// The planners to compare with.
pub const BASELINES: &[&str] = &["wavefront", "bug"];

/// Be a planner to compare with: wavefront or bug.
#[derive(Debug, Args)]
pub struct Arguments {
    name: String,
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    options: Vec<OsString>,
}

pub fn main(arguments: &Arguments) -> Result<(), Failure> {
    let run = match &*arguments.name {
        "wavefront" => run_stage::<Shell<Wavefront>>,
        "bug" => run_stage::<Shell<Bug>>,
        name => {
            let message = format!("{name:?} is no planner to compare with; give wavefront or bug");
            return Err(Refused::new("unknown-stage", message).into());
        }
    };
    let start = stage_command::start_with(PLANNER, arguments.options.iter().cloned())?;
    Ok(run(&start)?)
}
