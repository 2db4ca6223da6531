//! `firsthand-lab stage NAME`: a planner for comparison as a stage process, which `firsthand stage
//! NAME` becomes.
//!
//! Reads `grid` and `pose`, and publishes `guidance`. It keeps no state between ticks.

use std::ffi::OsString;

use clap::Args;
use common::{
    bus::Reader,
    outputs::Outputs,
    readers,
    samples::{GridHeader, PoseSample},
    shell::{Context, Process, Progress, StageError, run_stage},
    stage_command,
    target::TargetReader,
    topics::{GRID, GUIDANCE, POSE, TARGET},
    wiring::Topics,
};
use processes::stages::PLANNER;

use super::planner::Baseline;
use crate::error::{Result, refuse};

pub const BASELINES: &[&str] = &["wavefront"];

/// Be a planner for comparison: wavefront.
#[derive(Debug, Args)]
pub struct Arguments {
    name: String,
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    options: Vec<OsString>,
}

pub fn main(arguments: &Arguments) -> Result {
    let name = &*arguments.name;
    if !BASELINES.contains(&name) {
        let message = format!("unknown comparison planner {name:?}; give wavefront");
        return refuse("unknown-stage", message);
    }
    Ok(run_stage::<Shell>(&stage_command::start_with(PLANNER, arguments.options.iter().cloned())?)?)
}

readers! {
    pub struct Inputs {
        inputs {
            pose: Reader<PoseSample> = POSE,
            grid: Reader<GridHeader, u8> = GRID,
            target: TargetReader = TARGET,
        }
    }
}

pub struct Shell {
    inputs: Inputs,
    out: Outputs,
    baseline: Baseline,
    latest: Option<PoseSample>,
}

impl Process for Shell {
    const NAME: &'static str = "planner";
    const WAKES: Topics = &[&GRID];
    const OUTPUTS: Topics = &[&GUIDANCE];
    type Readers = Inputs;

    fn open(context: &mut Context, inputs: Inputs) -> Result<Self, StageError> {
        let baseline = Baseline::new(&context.run.mission);
        let out = Outputs::without_inputs(context)?;
        Ok(Self { inputs, out, baseline, latest: None })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        while let Some(grid) = self.inputs.grid.next_slice()? {
            let header = grid.header();
            if !self.baseline.follow(header, &grid) {
                tracing::warn!(version = header.part.version, "missed a grid version");
                continue;
            }
            self.out.at = Progress::of(&header.stamp);
            let tick = header.stamp.tick;
            // A tick's pose precedes its grid. A grid for new readers may belong to an answered
            // tick.
            self.latest = self.inputs.pose.newest()?.or(self.latest);
            if let Some(target) = self.inputs.target.next(tick)? {
                self.baseline.target = Some(target);
            }
            if let Some(pose) = self.latest.take_if(|pose| pose.stamp.tick == tick) {
                let guidance = self.baseline.guidance(&pose);
                self.out.publish(&GUIDANCE, guidance)?;
            }
        }
        Ok(self.out.at)
    }
}
