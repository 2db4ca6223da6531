//! `grid` and `pose` in, `guidance` out, the state saved before the guidance is published.

use common::{
    bus::{Reader, Writer},
    samples::{GridHeader, GuidanceSample, PoseSample},
    saved::Saved,
    shell::{Context, Process, Progress, StageError},
    target::TargetReader,
    topics::{GRID, GUIDANCE, POSE, TARGET},
    wiring::{Persists, Wiring},
};

use crate::baselines::planner::{Baseline, Planner};

/// Room for the encoded state, bytes: Bug2's is under 150.
const STATE_BYTES: usize = 256;

#[derive(Debug)]
pub struct Shell<P> {
    grid: Reader<GridHeader, u8>,
    pose: Reader<PoseSample>,
    target: TargetReader,
    guidance: Writer<GuidanceSample>,
    saved: Saved,
    baseline: Baseline<P>,
    latest_pose: Option<PoseSample>,
    answered: Option<u64>,
    progress: Progress,
}

impl<P: Planner> Process for Shell<P> {
    const WIRING: &'static Wiring = &Wiring {
        inputs: &[&POSE, &GRID, &TARGET],
        wakes: &[&GRID],
        outputs: &[&GUIDANCE],
        persists: Persists::State(STATE_BYTES),
        ..Wiring::of("planner")
    };

    fn open(context: &mut Context) -> Result<Self, StageError> {
        let mut baseline = Baseline::new(&context.run.mission);
        if let Some(planner) = context.saved_state()? {
            baseline.planner = planner;
            tracing::info!(state = ?baseline.planner, "restored");
        }
        Ok(Self {
            grid: context.reader(&GRID)?,
            pose: context.reader(&POSE)?,
            target: TargetReader::open(context)?,
            guidance: context.writer(&GUIDANCE)?,
            saved: context.take_saved(),
            baseline,
            latest_pose: None,
            answered: None,
            progress: Progress::default(),
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        let mut asked = false;
        while let Some(grid) = self.grid.next_slice()? {
            let header = grid.header();
            if !self.baseline.follow(header, &grid) {
                tracing::warn!(version = header.part.version, "missed a grid version");
                continue;
            }
            // The whole map, published again after the tick to which it belongs, asks for nothing; a tick that is given
            // again was not answered to the end.
            asked |= header.part.keyframe == 0 || self.answered != Some(header.stamp.tick);
            self.progress = Progress::of(&header.stamp);
        }
        if asked {
            self.answer()?;
        }
        Ok(self.progress)
    }
}

impl<P: Planner> Shell<P> {
    /// Publish guidance for the pose of the tick, which was published before the grid was.
    fn answer(&mut self) -> Result<(), StageError> {
        self.latest_pose = self.pose.newest()?.or(self.latest_pose);
        let Progress { tick, time } = self.progress;
        if let Some(target) = self.target.next(tick)? {
            self.baseline.send_to(target);
        }
        // A grid for new readers may be of a tick that is over.
        if let Some(pose) = self.latest_pose.filter(|pose| pose.stamp.tick == tick) {
            let guidance = self.baseline.guidance(&pose);
            self.saved.save(&self.baseline.planner)?;
            self.guidance.publish(tick, time, guidance)?;
            self.answered = Some(tick);
        }
        Ok(())
    }
}
