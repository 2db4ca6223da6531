//! Simulated camera and gyro, which observe a robot by its run's ground truth.

use std::{path::PathBuf, time::Duration};

use clap::Args;
use common::{
    bus::{Bus, Reader, Writer},
    domain::RobotName,
    follower::{Event, Follower},
    ground_truth::{GROUND_TRUTH, GroundTruthTick},
    samples::{FixSample, PoseSample, TurnSample, name},
    topics,
};

use console::output::print_text;
use recording::log_files::Tail;

use simulation::Random;

use crate::error::Result;

/// Publish the measurements of a camera and a gyro of a simulated robot, until its run ends.
#[derive(Debug, Args)]
pub struct Arguments {
    run: PathBuf,
    /// Robot name.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Fixes per second of mission time; 0 for none.
    #[arg(long, value_name = "HZ", default_value_t = 1.0)]
    fixes: f64,
    /// Share of fixes that are off by one metre.
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    jumps: f64,
    /// Noise of a gyro, degrees per square root of a second. The gyro has a bias of 0.02 degrees
    /// per second and a scale of 1.005.
    #[arg(long, value_name = "NOISE")]
    gyro: Option<f64>,
}

/// Standard deviation of a fix in x and in y.
const FIX_ERROR_M: f64 = 0.05;
const GYRO_BIAS_DEG_S: f64 = 0.02;
const GYRO_SCALE: f64 = 1.005;
/// Maximum poses and ground-truth ticks that wait for each other.
const WAITING: usize = 64;

pub fn main(arguments: &Arguments) -> Result {
    let open = |bus: &Bus| {
        let writers = (bus.writer(&topics::FIX, 1)?, bus.writer(&topics::TURN, 1)?);
        Ok((bus.reader(&topics::POSE)?, writers))
    };
    let mut robot = Follower::new(arguments.robot.domain(), "sources", &topics::POSE, open);
    let mut source = Source {
        arguments,
        chance: Random::new(1, 23),
        file: Tail::default(),
        truth: Vec::new(),
        poses: Vec::new(),
        next_fix_s: 0.0,
        turned: None,
        fixes: 0,
        turns: 0,
    };
    loop {
        match robot.wait(Duration::from_secs(1))? {
            Event::Connected => source.file = Tail::default(),
            Event::Samples((poses, writers)) => source.take(poses, writers)?,
            Event::Nothing => {}
            Event::Disconnected => break,
        }
    }
    let Source { fixes, turns, .. } = source;
    print_text(format!("published {fixes} fixes and {turns} turns\n"))
}

type Writers = (Writer<FixSample>, Writer<TurnSample>);

struct Source<'a> {
    arguments: &'a Arguments,
    chance: Random,
    file: Tail,
    truth: Vec<GroundTruthTick>,
    poses: Vec<PoseSample>,
    next_fix_s: f64,
    turned: Option<(f64, f64)>,
    fixes: u64,
    turns: u64,
}

impl Source<'_> {
    fn take(&mut self, poses: &mut Reader<PoseSample>, writers: &mut Writers) -> Result {
        while let Some(pose) = poses.next_sample()? {
            self.poses.push(pose);
        }
        self.read_truth();
        // Equal counts match a pose with the ground truth's mission time.
        for pose in std::mem::take(&mut self.poses) {
            let Some(at) = self.truth.iter().position(|truth| truth.is_of(&pose)) else {
                self.poses.push(pose);
                continue;
            };
            let truth = self.truth[at];
            self.truth.drain(..=at);
            self.poses.clear();
            self.measure(&pose, &truth, writers)?;
        }
        self.poses.drain(..self.poses.len().saturating_sub(WAITING));
        Ok(())
    }

    fn read_truth(&mut self) {
        let file = self.arguments.run.join(GROUND_TRUTH);
        let lines = std::iter::repeat_with(|| self.file.lines(&file));
        for lines in lines.take_while(|lines| !lines.is_empty()) {
            let ticks = lines.lines().map(serde_json::from_str::<GroundTruthTick>);
            self.truth.extend(ticks.flatten());
        }
        self.truth.drain(..self.truth.len().saturating_sub(WAITING));
    }

    fn measure(
        &mut self,
        pose: &PoseSample,
        truth: &GroundTruthTick,
        writers: &mut Writers,
    ) -> Result {
        let Arguments { fixes: rate_hz, jumps, gyro, .. } = *self.arguments;
        let (tick, time) = (pose.stamp.tick, pose.stamp.time());
        let now_s = time.seconds();
        if rate_hz > 0.0 && now_s >= self.next_fix_s {
            self.next_fix_s = now_s + 1.0 / rate_hz;
            let direction = std::f64::consts::TAU * self.chance.share();
            let off = if self.chance.share() < jumps { 1.0 } else { 0.0 };
            let variance = FIX_ERROR_M * FIX_ERROR_M;
            let fix = FixSample {
                capture_ns: time.0,
                source: name("simulated"),
                x_m: truth.x + FIX_ERROR_M * self.normal() + off * direction.cos(),
                y_m: truth.y + FIX_ERROR_M * self.normal() + off * direction.sin(),
                heading_rad: f64::NAN,
                covariance: [variance, 0.0, 0.0, variance, 0.0, 0.0],
                ..FixSample::default()
            };
            writers.0.publish(tick, time, fix)?;
            self.fixes += 1;
        }
        if let Some(noise) = gyro {
            let now = (now_s, truth.heading);
            let (before_s, heading) = self.turned.replace(now).unwrap_or(now);
            let seconds = now_s - before_s;
            let deviation = noise.to_radians() * seconds.max(0.0).sqrt();
            let turn = TurnSample {
                capture_ns: time.0,
                sequence: self.turns,
                turn_rad: (truth.heading - heading) * GYRO_SCALE
                    + GYRO_BIAS_DEG_S.to_radians() * seconds
                    + deviation * self.normal(),
                variance_rad2: deviation * deviation,
                ..TurnSample::default()
            };
            writers.1.publish(tick, time, turn)?;
            self.turns += 1;
        }
        Ok(())
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.chance.share()).sum::<f64>() - 6.0
    }
}
