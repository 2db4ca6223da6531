//! `grid` and `pose` in, `guidance` out, the state saved before the guidance is published.

use std::fmt::Debug;

use common::{
    bus::{Reader, SliceReader, Writer},
    samples::{GridHeader, GuidanceSample, PoseSample},
    saved::Saved,
    shell::{Context, Process, Progress, StageError},
    step::Step,
    topics::{GRID, GUIDANCE, POSE},
    wiring::{Persists, Wiring},
};

use crate::baselines::planner::{Input, Outcome};

/// Room for the encoded state, bytes: Bug2's is under 150.
const STATE_BYTES: usize = 256;

/// The process of a planner whose step is `P`.
#[derive(Debug)]
pub struct Shell<P> {
    grid: SliceReader<GridHeader, u8>,
    pose: Reader<PoseSample>,
    guidance: Writer<GuidanceSample>,
    saved: Saved,
    planner: P,
    latest_pose: Option<PoseSample>,
    /// The tick last answered.
    answered: Option<u64>,
    progress: Progress,
}

impl<P> Process for Shell<P>
where
    P: for<'a> Step<Input<'a> = Input<'a>, Output = Outcome>,
    P::State: Debug + Clone,
{
    const WIRING: &'static Wiring = &Wiring {
        inputs: &[&POSE, &GRID],
        wakes: &[&GRID],
        outputs: &[&GUIDANCE],
        persists: Persists::State(STATE_BYTES),
        ..Wiring::of("planner")
    };

    fn open(context: &mut Context) -> Result<Self, StageError> {
        let mut planner = P::new(&context.run.mission);
        if let Some(state) = context.saved_state()? {
            match planner.restore(state) {
                Ok(()) => tracing::info!(state = ?planner.state(), "restored"),
                Err(foreign) => tracing::warn!("{foreign}"),
            }
        }
        Ok(Self {
            grid: context.slice_reader(&GRID)?,
            pose: context.reader(&POSE)?,
            guidance: context.writer(&GUIDANCE)?,
            saved: context.take_saved(),
            planner,
            latest_pose: None,
            answered: None,
            progress: Progress::default(),
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        let mut asked = false;
        while let Some(grid) = self.grid.take()? {
            let header = grid.header();
            let input = Input::Grid { header, cells: &grid };
            let (tick, time) = (header.stamp.tick, header.stamp.time());
            if self.planner.step(input, time) == Outcome::Missed {
                tracing::warn!(version = header.part.version, "missed a grid version");
                continue;
            }
            // The whole map, published again behind the tick it belongs to, asks for nothing; a tick that is given
            // again was not answered to the end.
            asked |= header.part.keyframe == 0 || self.answered != Some(tick);
            self.progress = Progress { tick, time };
        }
        if asked {
            self.answer()?;
        }
        Ok(self.progress)
    }
}

impl<P> Shell<P>
where
    P: for<'a> Step<Input<'a> = Input<'a>, Output = Outcome>,
{
    /// Guidance for the pose of the tick, which was published before the grid was.
    fn answer(&mut self) -> Result<(), StageError> {
        if let Some(pose) = self.pose.newest()? {
            self.latest_pose = Some(pose);
        }
        let Progress { tick, time } = self.progress;
        // A grid for new readers may be of a tick that is over.
        let Some(pose) = self.latest_pose.filter(|pose| pose.stamp.tick == tick) else {
            return Ok(());
        };
        if let Outcome::Guidance(guidance) = self.planner.step(Input::Pose(&pose), time) {
            self.saved.save(self.planner.state())?;
            self.guidance.publish(tick, time, guidance)?;
        }
        self.answered = Some(tick);
        Ok(())
    }
}
