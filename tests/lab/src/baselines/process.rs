//! `firsthand-lab stage NAME`: a planner for comparison as a stage process, which `firsthand stage
//! NAME` becomes.
//!
//! Reads `grid` and `pose`, and publishes `guidance` after saving its state.

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
    wiring::{Persists, Topics},
};
use processes::stages::PLANNER;

use super::{
    bug::Bug,
    planner::{Baseline, Planner},
    wavefront::Wavefront,
};
use crate::error::{Refused, Result};

pub const BASELINES: &[&str] = &["wavefront", "bug"];

/// Be a planner for comparison: wavefront or bug.
#[derive(Debug, Args)]
pub struct Arguments {
    name: String,
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    options: Vec<OsString>,
}

pub fn main(arguments: &Arguments) -> Result {
    let run = match &*arguments.name {
        "wavefront" => run_stage::<Shell<Wavefront>>,
        "bug" => run_stage::<Shell<Bug>>,
        name => {
            let message = format!("unknown comparison planner {name:?}; give wavefront or bug");
            return Err(Refused::new("unknown-stage", message).into());
        }
    };
    Ok(run(&stage_command::start_with(PLANNER, arguments.options.iter().cloned())?)?)
}

/// Bytes; Bug2's state is under 150.
const STATE_BYTES: usize = 256;

readers! {
    pub struct Inputs {
        inputs {
            pose: Reader<PoseSample> = POSE,
            grid: Reader<GridHeader, u8> = GRID,
            target: TargetReader = TARGET,
        }
    }
}

pub struct Shell<P> {
    inputs: Inputs,
    out: Outputs,
    baseline: Baseline<P>,
    latest: Option<PoseSample>,
}

impl<P: Planner> Process for Shell<P> {
    const NAME: &'static str = "planner";
    const WAKES: Topics = &[&GRID];
    const OUTPUTS: Topics = &[&GUIDANCE];
    const PERSISTS: Persists = Persists::State(STATE_BYTES);
    type Readers = Inputs;

    fn open(context: &mut Context, inputs: Inputs) -> Result<Self, StageError> {
        let mut baseline = Baseline::new(&context.run.mission);
        if let Some(planner) = context.saved_state()? {
            baseline.planner = planner;
            tracing::info!(state = ?baseline.planner, "restored");
        }
        let out = Outputs::without_inputs(context)?;
        Ok(Self { inputs, out, baseline, latest: None })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        while let Some(grid) = self.inputs.grid.next_slice()? {
            let header = grid.header();
            if !self.baseline.belief.follow(header, &grid) {
                tracing::warn!(version = header.part.version, "missed a grid version");
                continue;
            }
            self.out.at = Progress::of(&header.stamp);
            let tick = header.stamp.tick;
            // A tick's pose precedes its grid. A grid for new readers may belong to an answered
            // tick.
            self.latest = self.inputs.pose.newest()?.or(self.latest);
            if let Some(target) = self.inputs.target.next(tick)? {
                self.baseline.send_to(target);
            }
            if let Some(pose) = self.latest.take_if(|pose| pose.stamp.tick == tick) {
                let guidance = self.baseline.guidance(&pose);
                self.out.save(&self.baseline.planner)?;
                self.out.publish(&GUIDANCE, guidance)?;
            }
        }
        Ok(self.out.at)
    }
}
