//! `corpus`: residuals of healthy missions, tick by tick, from which thresholds of suspicion come.
//!
//! A residual is what a source says less what the others predict. Robots, realism, sensors, radio
//! and load are drawn. Nothing is faulty, so every residual is one that a monitor has to accept.

use std::{
    collections::{BTreeMap, HashMap},
    num::NonZero,
    path::{Path, PathBuf},
};

use clap::Args;
use common::{
    bus::{Bus, BusError, Reader},
    ground_truth::GroundTruthTick,
    kinematics::Pose2,
    mission::{Body, Mission, ModelledSpeed, Sensor, SensorKind},
    readers,
    samples::{
        Cause, CommandSample, DoubtsSample, FixSample, LinkSample, PoseSample, RangeReading,
        RangeStatus, RangesHeader, TurnSample,
    },
    topics,
    wire::counts_between,
    wiring::Readers as _,
};
use console::{
    missions,
    output::{print_line, say},
};
use glam::{DMat2, DVec2};
use simulation::{Load, Observer, Random, Scenario};

use crate::{
    error::{OrCannot as _, Result},
    missions::{runner::in_parallel, trial::swept_m},
    simulate,
    worlds::{self, Asked},
};

/// Stream of the drawn robots.
const STREAM: u64 = 20;
const WORLDS: [&str; 6] = ["rooms", "doors", "furnished", "corridors", "glazed", "people"];
/// Keys of each robot.
const ROBOTS: [(&str, &[&str]); 8] = [
    ("X80", &["robot.model='x80'"]),
    ("X80SV", &["robot.model='x80sv'"]),
    ("JSON, sonars and gyro", &["robot.protocol='json'", "robot.gyro=true"]),
    ("Jackal", &["robot.model='jackal'"]),
    ("Kobuki", &["robot.model='kobuki'"]),
    ("Create 3", &["robot.model='create3'"]),
    ("TurtleBot 4", &["robot.model='turtlebot4'"]),
    ("TurtleBot3 Burger", &["robot.model='turtlebot3-burger'"]),
];
const REALISMS: [&str; 3] = ["laboratory", "measured", "harsh"];
/// Causes that a healthy robot should not give.
const FAULTS: [Cause; 6] = [
    Cause::OdometryImplausible,
    Cause::RangeImplausible,
    Cause::RangeDoubtful,
    Cause::RobotDoesNotStop,
    Cause::AnotherCommander,
    Cause::BaseSlow,
];
const OUTAGES: [f64; 4] = [0.0, 0.0, 0.0, 0.1];
/// Longest interval of poses over which a residual is taken, seconds.
const LONGEST_S: f64 = 1.0;
/// Largest turn between two echoes of the same surface, rad.
const SAME_SURFACE_RAD: f64 = 0.02;
/// Largest change of an echo's distance on the same surface, metres.
const SAME_SURFACE_M: f64 = 0.3;

/// Drive healthy missions of drawn robots in one process, and measure how far what each source
/// says is from what the others predict.
///
/// Writes `corpus.csv`, a row per robot and residual, and `doubts.csv`, how often each doubt would
/// stop a healthy robot.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Number of missions.
    #[arg(long, default_value_t = 2000)]
    count: u64,
    /// Seed of robots, worlds and noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Directory of the tables.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Only record mission N of the seed, as `mission-N.mcap`.
    #[arg(long, value_name = "N")]
    record: Option<u64>,
    /// Number of missions at once; by default one per processor.
    #[arg(long)]
    jobs: Option<NonZero<usize>>,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Source {
    Way,
    Turn,
    Gyro,
    Echo,
    ScanFix,
    Interval,
    Pose,
}

/// Residual of each source in words, with its unit.
const RESIDUALS: [&str; 7] = [
    "way of the wheels less that of the stated response, m per tick",
    "turn of the wheels less that of the stated response, rad per tick",
    "turn of the gyro less that of the wheels, rad per tick",
    "echo less the last one and the way between, m",
    "scan fix less pose, squared over both variances",
    "interval of ticks less the nominal one, s",
    "pose less ground truth, squared over its variance",
];

struct Residual {
    source: Source,
    tick: u64,
    value: f64,
}

pub fn main(arguments: &Arguments) -> Result {
    let Arguments { count, seed, .. } = *arguments;
    let directory = &arguments.out;
    std::fs::create_dir_all(directory).or_cannot_file("make", directory)?;
    if let Some(number) = arguments.record {
        let file = directory.join(format!("mission-{number}.mcap"));
        let (robot, scenario) = draw(seed, number)?;
        simulate::record(&scenario, &file)?;
        return print_line(format!("{robot}, {}; see {}", scenario.mission.name, file.display()));
    }
    let mut all: BTreeMap<(&str, Source), Vec<f64>> = BTreeMap::new();
    let mut done = Vec::new();
    let drive = |&number: &u64, _: usize| drive(seed, number);
    in_parallel((0..count).collect(), arguments.jobs, drive, |number, driven| {
        match driven {
            Ok((robot, mut healthy)) => {
                for (cause, doubt) in &healthy.causes {
                    say(format_args!("mission {number}, {robot}: {} ({doubt})", cause.name()));
                }
                for Residual { source, value, .. } in std::mem::take(&mut healthy.residuals) {
                    all.entry((robot, source)).or_default().push(value);
                }
                done.push(healthy);
            }
            Err(error) => say(format_args!("mission {number}: {error}")),
        }
        Ok(())
    })?;
    summarize(all, &directory.join("corpus.csv"))?;
    write_doubts(&done, &directory.join("doubts.csv"))?;
    print_line(format!("{count} missions from seed {seed}; see {}", directory.display()))?;
    match count - done.len() as u64 {
        0 => Ok(()),
        broken => Err(format!("{broken} missions failed and are not in the tables").into()),
    }
}

fn summarize(all: BTreeMap<(&str, Source), Vec<f64>>, file: &Path) -> Result {
    let mut summary = csv::Writer::from_path(file)?;
    summary.write_record([
        "section", "residual", "robot", "ticks", "mean", "median", "99 %", "99.9 %", "largest",
    ])?;
    for ((robot, source), values) in all {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let mut sizes: Vec<_> = values.iter().map(|value| value.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let at = |share: f64| sizes[((sizes.len() - 1) as f64 * share) as usize];
        let figures = [mean, at(0.5), at(0.99), at(0.999), at(1.0)];
        let figures = figures.map(|figure| format!("{figure:.4}"));
        summary.serialize(("corpus", RESIDUALS[source as usize], robot, values.len(), figures))?;
    }
    Ok(summary.flush()?)
}

/// Part of the missions whose greatest evidence is the tail that is extrapolated.
const TAIL: f64 = 0.05;
const PER_HOURS: f64 = 100.0;

/// Extrapolates how often each doubt reaches 1, at which the robot stands.
///
/// The excess over a high threshold is distributed exponentially (J. Pickands, "Statistical
/// inference using extreme order statistics", Annals of Statistics 3, 1975; shape 0).
fn write_doubts(missions: &[Healthy], file: &Path) -> Result {
    let untouched = missions.iter().filter(|it| it.hours > 0.0).count();
    let hours = missions.iter().map(|it| it.hours).sum::<f64>();
    let per_hours = |count: f64| format!("{:.2}", count / hours * PER_HOURS);
    let mut greatest: BTreeMap<_, Vec<f64>> = BTreeMap::new();
    for (doubt, evidence) in missions.iter().flat_map(|it| &it.greatest) {
        greatest.entry(*doubt).or_default().push(*evidence);
    }
    let mut causes: BTreeMap<_, u32> = BTreeMap::new();
    for (cause, _) in missions.iter().flat_map(|it| &it.causes) {
        *causes.entry(cause.name()).or_default() += 1;
    }
    let mut rows = csv::Writer::from_path(file)?;
    rows.write_record(["section", "doubt", "hours", "95 %", "largest", "found", "expected"])?;
    let in_all = format!("{hours:.1}");
    for (doubt, mut all) in greatest {
        all.resize(untouched, 0.0);
        all.sort_by(f64::total_cmp);
        let (below, tail) = all.split_at(((1.0 - TAIL) * all.len() as f64) as usize);
        let least = below.last().copied().unwrap_or_default();
        let mean = tail.iter().map(|it| it - least).sum::<f64>() / tail.len() as f64;
        let expected = if mean > 0.0 { (-(1.0 - least) / mean).exp().min(1.0) } else { 0.0 };
        let found = tail.iter().filter(|it| **it >= 1.0).count();
        let largest = tail.last().copied().unwrap_or_default();
        let figures = [least, largest].map(|figure| format!("{figure:.2}"));
        let rates = [found as f64, expected * tail.len() as f64].map(per_hours);
        rows.serialize(("doubts", doubt, &in_all, figures, rates))?;
    }
    for (cause, count) in causes {
        rows.serialize(("doubts", cause, &in_all, ["", ""], per_hours(count.into()), ""))?;
    }
    Ok(rows.flush()?)
}

/// What a healthy mission shows.
#[derive(Default)]
struct Healthy {
    residuals: Vec<Residual>,
    /// 0 for a robot that was touched.
    hours: f64,
    greatest: BTreeMap<&'static str, f64>,
    /// Causes that say that the robot is faulty, and its greatest doubt.
    causes: Vec<(Cause, &'static str)>,
}

/// Drives a drawn mission. Returns the robot and what it shows.
fn drive(seed: u64, number: u64) -> Result<(&'static str, Healthy)> {
    let _quiet = simulate::quietly();
    let (robot, scenario) = draw(seed, number)?;
    let healthy = healthy(&scenario);
    Ok((robot, healthy.map_err(|it| format!("{robot}, {}: {it}", scenario.mission.name))?))
}

fn draw(seed: u64, number: u64) -> Result<(&'static str, Scenario)> {
    let random = &mut Random::of_world(seed, STREAM, number);
    let (robot, keys) = ROBOTS[random.below(ROBOTS.len())];
    let mut keys: Vec<String> = keys.iter().map(ToString::to_string).collect();
    keys.push(format!("simulation.realism='{}'", REALISMS[random.below(REALISMS.len())]));
    let outage = OUTAGES[random.below(OUTAGES.len())];
    keys.push(format!("simulation.radio.outage_share={outage}"));
    let body = missions::parsed("target = [1, 0]", "corpus", &keys)?;
    let asked = Asked { count: Some(1), seed: random.bits(), ends: None, swept_m: swept_m(&body) };
    let mut found = worlds::find(WORLDS[random.below(WORLDS.len())], asked)?;
    let world = toml::to_string(&found.trials.swap_remove(0).mission)?;
    let mut mission = missions::parsed(&world, "corpus", &keys)?;
    mission.seed = random.bits() >> 1;
    let loads = [Load::IDLE, Load::BUSY, Load::OVERLOADED];
    let load = loads[random.below(loads.len())];
    Ok((robot, Scenario { load, ..Scenario::calm(&mission) }))
}

fn healthy(scenario: &Scenario) -> Result<Healthy> {
    let (ran, watch) = simulate::observe(scenario, Watch::new(&scenario.mission));
    if let Some(broken) = ran.broken {
        return Err(broken.to_string().into());
    }
    let mut watch = watch.ok_or("the simulation still watches a run that has ended")?;
    watch.judge_poses(&ran.truth);
    watch.readers.or_cannot("read the bus of a simulation")?;
    let hours = ran.simulated.as_secs_f64() / 3600.0;
    // A robot that was touched may rightly be doubted.
    Ok(match ran.truth.last() {
        Some(truth) if truth.contacts == 0 => Healthy { hours, ..watch.shown },
        _ => Healthy { residuals: watch.shown.residuals, ..Healthy::default() },
    })
}

impl Observer for Watch {
    fn on_bus(&mut self, bus: &Bus) {
        self.readers = Inputs::open_readers(bus).map(Some);
    }

    fn observe(&mut self) {
        if let Ok(readers) = &mut self.readers
            && let Some(mut readers) = readers.take()
        {
            self.readers = self.take(&mut readers).map(|()| Some(readers));
        }
    }
}

readers! {
    struct Inputs {
        inputs {
            command: Reader<CommandSample> = topics::COMMAND,
            pose: Reader<PoseSample> = topics::POSE,
            turn: Reader<TurnSample> = topics::IMU_TURN,
            fix: Reader<FixSample> = topics::SCAN_FIX,
            ranges: Reader<RangesHeader, RangeReading> = topics::RANGES,
            doubts: Reader<DoubtsSample> = topics::DOUBTS,
            link: Reader<LinkSample> = topics::LINK,
        }
    }
}

/// Watch of a run, which ends with the first error.
struct Watch {
    readers: Result<Option<Inputs>, BusError>,
    shown: Healthy,
    cause: Cause,
    /// Greatest doubt now.
    doubt: &'static str,
    sensors: Vec<Sensor>,
    body: Body,
    tick_s: f64,
    /// Forward speed and turn rate by the stated response.
    base: [ModelledSpeed; 2],
    poses: Vec<PoseSample>,
    /// Turn by the gyro that ends at a mission time, rad.
    gyro: HashMap<u64, f64>,
    /// Last echo of a sensor, with the robot's pose.
    echoes: HashMap<u8, (Pose2, f64)>,
}

impl Watch {
    fn new(mission: &Mission) -> Self {
        let body = mission.body();
        let response = body.response;
        let axis = |most| ModelledSpeed::new(response.dead_time_s(), most);
        Self {
            readers: Ok(None),
            shown: Healthy::default(),
            cause: Cause::None,
            doubt: "",
            sensors: mission.sensor_table(),
            body,
            tick_s: 1.0 / mission.robot.rate_hz,
            base: [response.acceleration_m_s2, response.turn_acceleration_rad_s2].map(axis),
            poses: Vec::new(),
            gyro: HashMap::new(),
            echoes: HashMap::new(),
        }
    }

    fn find(&mut self, source: Source, tick: u64, value: f64) {
        if value.is_finite() {
            self.shown.residuals.push(Residual { source, tick, value });
        }
    }

    fn take(&mut self, readers: &mut Inputs) -> Result<(), BusError> {
        while let Some(command) = readers.command.next_sample()? {
            let at_s = command.stamp.seconds();
            let [left, right] = [command.left_rad_s, command.right_rad_s];
            let Body { wheel_radius_m, track_m, .. } = self.body;
            self.base[0].command(at_s, wheel_radius_m * f64::midpoint(left, right));
            self.base[1].command(at_s, wheel_radius_m * (right - left) / track_m);
        }
        while let Some(pose) = readers.pose.next_sample()? {
            self.on_pose(pose);
        }
        while let Some(turn) = readers.turn.next_sample()? {
            self.gyro.insert(turn.capture_ns, turn.turn_rad);
        }
        while let Some(fix) = readers.fix.next_sample()? {
            let its = |pose: &&PoseSample| pose.stamp.stamp_ns == fix.capture_ns;
            if let Some(pose) = self.poses.iter().rfind(its) {
                let off = DVec2::new(fix.x_m - pose.x_m, fix.y_m - pose.y_m);
                let variance = of_place(&fix.covariance) + of_place(&pose.covariance);
                self.find(Source::ScanFix, fix.stamp.tick, squared_over(off, variance));
            }
        }
        while let Some(doubts) = readers.doubts.next_sample()? {
            let doubts = doubts.each();
            for (doubt, _, evidence) in &doubts {
                let greatest = self.shown.greatest.entry(doubt).or_default();
                *greatest = greatest.max(*evidence);
            }
            let greatest = doubts.iter().max_by(|(.., one), (.., other)| one.total_cmp(other));
            self.doubt = greatest.map_or("", |(doubt, ..)| doubt);
        }
        while let Some(link) = readers.link.next_sample()? {
            let cause = link.cause();
            if std::mem::replace(&mut self.cause, cause) != cause && FAULTS.contains(&cause) {
                self.shown.causes.push((cause, self.doubt));
            }
        }
        while let Some(slice) = readers.ranges.next_slice()? {
            let tick = slice.header().stamp.tick;
            for reading in slice.iter() {
                self.on_echo(tick, reading);
            }
        }
        Ok(())
    }

    fn on_pose(&mut self, pose: PoseSample) {
        let at_s = pose.stamp.seconds();
        let [way, turn] = self.base.each_mut().map(|axis| axis.go_on(at_s));
        if let Some(before) = self.poses.last() {
            let for_s = at_s - before.stamp.seconds();
            let tick = pose.stamp.tick;
            let per_count_m = self.body.metres_per_count();
            let metres = |from, to| f64::from(counts_between(from, to)) * per_count_m;
            let left = metres(before.left_counts, pose.left_counts);
            let right = metres(before.right_counts, pose.right_counts);
            let wheels = (right - left) / self.body.track_m;
            self.find(Source::Interval, tick, for_s - self.tick_s);
            if for_s < LONGEST_S {
                if let Some(gyro) = self.gyro.remove(&pose.stamp.stamp_ns) {
                    self.find(Source::Gyro, tick, gyro - wheels);
                }
                self.find(Source::Way, tick, f64::midpoint(left, right) - way);
                self.find(Source::Turn, tick, wheels - turn);
            }
        }
        self.poses.push(pose);
    }

    /// Compares an echo with the last one of its sensor.
    fn on_echo(&mut self, tick: u64, reading: &RangeReading) {
        if let Some(sensor) = self.sensors.get(usize::from(reading.sensor))
            && sensor.kind == SensorKind::Cone
            && reading.status() == RangeStatus::Measured
            && let Some(now) = self.poses.last().map(PoseSample::pose)
            && let Some((before, range_m)) =
                self.echoes.insert(reading.sensor, (now, reading.range_m))
        {
            let moved = now.position - before.position;
            let axis = now.heading + sensor.mount.looks_rad();
            let nearer_m = moved.dot(DVec2::from_angle(axis));
            let off_m = reading.range_m - (range_m - nearer_m);
            let turned_rad = (now.heading - before.heading).abs();
            if turned_rad < SAME_SURFACE_RAD && off_m.abs() < SAME_SURFACE_M {
                self.find(Source::Echo, tick, off_m);
            }
        }
    }

    /// Compares poses with the ground truth of their counts. A robot that something touches is not
    /// healthy from then on.
    fn judge_poses(&mut self, truth: &[GroundTruthTick]) {
        let mut rest = truth;
        for pose in std::mem::take(&mut self.poses) {
            let Some(at) = rest.iter().position(|truth| truth.is_of(&pose)) else { continue };
            rest = &rest[at..];
            if rest[0].contacts > 0 {
                self.shown.residuals.retain(|residual| residual.tick < pose.stamp.tick);
                break;
            }
            let off = pose.pose().position - rest[0].pose().position;
            let error = squared_over(off, of_place(&pose.covariance));
            self.find(Source::Pose, pose.stamp.tick, error);
        }
    }
}

/// Returns the covariance of x and y, of which a millimetre each is not asked.
fn of_place(covariance: &[f64; 6]) -> DMat2 {
    let [xx, xy, _, yy, ..] = *covariance;
    DMat2::from_cols(DVec2::new(xx + 1e-6, xy), DVec2::new(xy, yy + 1e-6))
}

/// Returns the square of `off` over its variance, per dimension: 1 in the mean if the variance is
/// true.
fn squared_over(off: DVec2, variance: DMat2) -> f64 {
    off.dot(variance.inverse() * off) / 2.0
}
