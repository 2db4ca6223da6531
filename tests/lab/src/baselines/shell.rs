//! `grid` and `pose` in, `guidance` out, the state saved before the guidance is published.

use common::{
    bus::Reader,
    outputs::Outputs,
    readers,
    samples::{GridHeader, PoseSample},
    shell::{Context, Process, Progress, StageError},
    target::TargetReader,
    topics::{GRID, GUIDANCE, POSE, TARGET},
    wiring::{Persists, Topics},
};

use crate::baselines::planner::{Baseline, Planner};

/// Room for the encoded state, bytes: Bug2's is under 150.
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
    latest_pose: Option<PoseSample>,
    answered: Option<u64>,
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
        Ok(Self {
            inputs,
            out: Outputs::without_inputs(context)?,
            baseline,
            latest_pose: None,
            answered: None,
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        let mut asked = false;
        while let Some(grid) = self.inputs.grid.next_slice()? {
            let header = grid.header();
            if !self.baseline.follow(header, &grid) {
                tracing::warn!(version = header.part.version, "missed a grid version");
                continue;
            }
            // The whole map, published again after the tick to which it belongs, asks for nothing; a tick that is given
            // again was not answered to the end.
            asked |= header.part.keyframe == 0 || self.answered != Some(header.stamp.tick);
            self.out.at = Progress::of(&header.stamp);
        }
        if asked {
            self.answer()?;
        }
        Ok(self.out.at)
    }
}

impl<P: Planner> Shell<P> {
    /// Publish guidance for the pose of the tick, which was published before the grid was.
    fn answer(&mut self) -> Result<(), StageError> {
        self.latest_pose = self.inputs.pose.newest()?.or(self.latest_pose);
        let tick = self.out.at.tick;
        if let Some(target) = self.inputs.target.next(tick)? {
            self.baseline.send_to(target);
        }
        // A grid for new readers may be of a tick that is over.
        if let Some(pose) = self.latest_pose.filter(|pose| pose.stamp.tick == tick) {
            let guidance = self.baseline.guidance(&pose);
            self.out.save(&self.baseline.planner)?;
            self.out.publish(&GUIDANCE, guidance)?;
            self.answered = Some(tick);
        }
        Ok(())
    }
}
