//! Straight to the target, as long as no hazard cell is ahead.

use std::process::ExitCode;

use common::{
    bus::Reader,
    grid::{Applied, Replica},
    outputs::Outputs,
    readers,
    samples::{GridHeader, GuidanceSample, GuidanceStatus, PoseSample, TargetSample},
    shell::{self, Context, Process, Progress, StageError},
    target::TargetReader,
    topics::{GRID, GUIDANCE, POSE, TARGET},
    wiring::Topics,
};
use glam::DVec2;

/// So far ahead the map must be free, metres.
const AHEAD_M: f64 = 0.5;

readers! {
    struct Inputs {
        inputs {
            pose: Reader<PoseSample> = POSE,
            grid: Reader<GridHeader, u8> = GRID,
            target: TargetReader = TARGET,
        }
    }
}

struct Planner {
    inputs: Inputs,
    out: Outputs,
    target: TargetSample,
    map: Replica<u8>,
    latest: Option<PoseSample>,
}

impl Process for Planner {
    const NAME: &'static str = "planner";
    const WAKES: Topics = &[&GRID];
    const OUTPUTS: Topics = &[&GUIDANCE];
    type Readers = Inputs;

    fn open(context: &mut Context, inputs: Inputs) -> Result<Self, StageError> {
        Ok(Self {
            inputs,
            out: Outputs::without_inputs(context)?,
            target: TargetSample::default(),
            map: Replica::default(),
            latest: None,
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        while let Some(grid) = self.inputs.grid.next_slice()? {
            let header = *grid.header();
            if self.map.apply(&header.part, &grid) == Applied::Missed {
                continue; // The mapper publishes the whole map again within a second.
            }
            self.out.at = Progress::of(&header.stamp);
            let tick = header.stamp.tick;
            // The pose of a tick is published before its grid.
            self.latest = self.inputs.pose.newest()?.or(self.latest);
            self.target = self.inputs.target.next(tick)?.unwrap_or(self.target);
            if let Some(pose) = self.latest.take_if(|pose| pose.stamp.tick == tick) {
                let guidance = self.guide(&pose, &header);
                self.out.publish(&GUIDANCE, guidance)?;
            }
        }
        Ok(self.out.at)
    }
}

impl Planner {
    fn guide(&self, pose: &PoseSample, header: &GridHeader) -> GuidanceSample {
        let here = pose.pose().position;
        let to_target = self.target.target.position() - here;
        let direction = to_target.normalize_or(DVec2::X);
        let ahead = AHEAD_M.min(to_target.length()) / 10.0;
        let mut points = (1..=10).map(|step| here + direction * ahead * f64::from(step));
        let (status, direction) = match points.all(|at| !self.map.is_hazard(at)) {
            true => (GuidanceStatus::Along, direction),
            false => (GuidanceStatus::Unreachable, DVec2::ZERO),
        };
        GuidanceSample {
            ex: direction.x,
            ey: direction.y,
            speed_limit_m_s: f64::INFINITY,
            status: status.into(),
            maneuver: status.maneuver().into(),
            grid_version: header.part.version,
            ..GuidanceSample::for_pose(pose, header, &self.target)
        }
    }
}

fn main() -> ExitCode {
    shell::main::<Planner>()
}
