//! Process in the planner's place: reads `pose`, `ranges` and `scan`, publishes `guidance`. The
//! state is saved before the guidance is published.

use std::path::Path;

use common::{
    bus::Reader,
    checkpoint::{Checkpoint, CheckpointError},
    kinematics::Pose2,
    mission::{Body, CalibrationPlan, Procedure, SensorKind},
    outputs::Outputs,
    readers, run,
    samples::{
        GridHeader, GuidanceSample, GuidanceStatus, PoseSample, RangeReading, RangesHeader,
        ScanHeader, TargetSample,
    },
    shell::{Context, Process, Progress, StageError},
    topics::{GUIDANCE, POSE, RANGES, SCAN},
    wiring::{Persists, Topics},
};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    script::Script,
    wall::{Order, Wall, echo_m},
};

const SCAN_HOLDS_S: f64 = 0.5;
/// Encoded size of two legs of 200 readings, and 64 loops.
pub(crate) const STATE_BYTES: usize = 16 << 10;

#[derive(Debug, Serialize, Deserialize)]
pub enum Drive {
    Wall(Box<Wall>),
    Script(Script),
}

impl Drive {
    /// Reads the procedure that the run in `directory` saved in its last tick. A recording may lack
    /// ticks.
    pub fn of_run(directory: &Path) -> Result<Option<Self>, CheckpointError> {
        Ok(Checkpoint::open(&run::checkpoint_file(directory, Shell::NAME), STATE_BYTES)?.1)
    }

    fn new(plan: CalibrationPlan, rate_hz: f64) -> Self {
        match plan.procedure {
            Procedure::Wall => Self::Wall(Box::new(Wall::new(plan))),
            procedure => Self::Script(Script::new(procedure, plan.drive_m, rate_hz)),
        }
    }

    fn step(&mut self, counts: [u16; 2], echo_m: Option<f64>, body: &Body) -> Order {
        match self {
            Self::Wall(wall) => wall.step(counts, echo_m, body),
            Self::Script(script) => script.step(counts, echo_m, body),
        }
    }
}

readers! {
    pub struct Inputs {
        inputs {
            pose: Reader<PoseSample> = POSE,
            ranges: Reader<RangesHeader, RangeReading> = RANGES,
            scan: Reader<ScanHeader, f32> = SCAN,
        }
    }
}

struct FreeByScan {
    half_width_m: f64,
    /// Time of the scan, and the free distance before the body, metres.
    seen: Option<(f64, f64)>,
}

impl FreeByScan {
    fn take(&mut self, at_s: f64, header: &ScanHeader, beams: &[f32]) {
        let place = DVec2::new(header.x_m, header.y_m);
        let free_m = beams
            .iter()
            .enumerate()
            .filter(|(_, range)| range.is_finite())
            .map(|(beam, range)| {
                let along = DVec2::from_angle(header.first_rad + header.step_rad * beam as f64);
                place + f64::from(*range) * along
            })
            .filter(|end| end.x > 0.0 && end.y.abs() <= self.half_width_m)
            .fold(f64::INFINITY, |free_m, end| free_m.min(end.x - self.half_width_m));
        self.seen = Some((at_s, free_m));
    }

    /// Returns the free distance; zero if the last scan is older than [`SCAN_HOLDS_S`].
    fn free_m(&self, now_s: f64) -> f64 {
        self.seen.filter(|(at_s, _)| now_s - at_s <= SCAN_HOLDS_S).map_or(0.0, |(_, free_m)| free_m)
    }
}

pub struct Shell {
    inputs: Inputs,
    front: usize,
    out: Outputs,
    body: Body,
    /// Place where the robot faces the wall.
    target: TargetSample,
    drive: Drive,
    /// Newest tick with readings, and the front sonar's echo, metres.
    newest: Option<(u64, Option<f64>)>,
    scan: Option<FreeByScan>,
    answered: Option<GuidanceSample>,
}

impl Process for Shell {
    const NAME: &'static str = "planner";
    const WAKES: Topics = &[&POSE];
    const OUTPUTS: Topics = &[&GUIDANCE];
    const PERSISTS: Persists = Persists::State(STATE_BYTES);
    type Readers = Inputs;

    fn open(context: &mut Context, inputs: Inputs) -> Result<Self, StageError> {
        let mission = &context.run.mission;
        let plan = mission.planner.calibration.clone().unwrap_or_default();
        let (body, front) = (mission.body(), mission.front_row());
        let target = TargetSample::first(mission);
        let is_watched =
            plan.procedure == Procedure::Gyro && mission.front_sonar().kind == SensorKind::Scan;
        let scan = is_watched.then_some(FreeByScan { half_width_m: body.radius_m, seen: None });
        let mut drive = Drive::new(plan, mission.robot.rate_hz);
        if let Some(state) = context.saved_state()? {
            drive = state;
            tracing::info!("restored");
        }
        Ok(Self {
            inputs,
            front,
            out: Outputs::without_inputs(context)?,
            body,
            target,
            drive,
            newest: None,
            scan,
            answered: None,
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        while let Some(pose) = self.inputs.pose.next_sample()? {
            self.out.at = Progress::of(&pose.stamp);
            // A repeated tick gets its answer again.
            if let Some(answered) = self.answered.filter(|it| it.pose_ns == pose.stamp.stamp_ns) {
                self.out.publish(&GUIDANCE, answered)?;
                continue;
            }
            // The link publishes the readings of a tick before its wheels.
            while self.newest.is_none_or(|(tick, _)| tick < pose.stamp.tick)
                && let Some(ranges) = self.inputs.ranges.next_slice()?
            {
                let front = ranges.iter().find(|it| usize::from(it.sensor) == self.front);
                self.newest = Some((ranges.header().stamp.tick, front.and_then(echo_m)));
            }
            let mut echo_m = self
                .newest
                .filter(|(tick, _)| *tick == pose.stamp.tick)
                .and_then(|(_, echo_m)| echo_m);
            if let Some(free) = &mut self.scan {
                while let Some(scan) = self.inputs.scan.next_slice()? {
                    free.take(scan.header().stamp.seconds(), scan.header(), &scan);
                }
                echo_m = Some(free.free_m(pose.stamp.seconds()));
            }
            self.answer(&pose, echo_m)?;
        }
        Ok(self.out.at)
    }
}

impl Shell {
    fn answer(&mut self, pose: &PoseSample, echo_m: Option<f64>) -> Result<(), StageError> {
        let order = self.drive.step([pose.left_counts, pose.right_counts], echo_m, &self.body);
        self.out.save(&self.drive)?;
        let heading_rad = order.heading_rad;
        let at = Pose2 { position: DVec2::ZERO, heading: heading_rad + order.aside_rad };
        let direction = match order.status {
            GuidanceStatus::Along | GuidanceStatus::Look => at.axis(),
            _ => DVec2::ZERO,
        };
        let guidance = GuidanceSample {
            ex: direction.x,
            ey: direction.y,
            distance_m: self.target.target.position().distance(DVec2::new(order.x_m, 0.0)),
            speed_limit_m_s: order.speed_limit_m_s,
            status: order.status.into(),
            maneuver: order.status.maneuver().into(),
            // The place before the wall: uncalibrated dead reckoning would be metres off after some
            // loops.
            x_m: order.x_m,
            y_m: 0.0,
            heading_rad,
            ..GuidanceSample::for_pose(pose, &GridHeader::default(), &self.target)
        };
        self.answered = Some(guidance);
        self.out.publish(&GUIDANCE, guidance)
    }
}
