//! Samples of a robot as the page shows them: rows of its charts, states, events, maps and fields. The live page and the recorded one
//! both come from here.

use std::collections::{BTreeMap, VecDeque};

use common::{
    bus::{Layout, decode_sample, decode_slice},
    grid::{Applied, Replica},
    ground_truth::GroundTruthTick,
    mission::Mission,
    process_usage::Usage,
    samples::{
        CommandSample, FieldCell, FieldHeader, GridHeader, GuidanceSample, GuidanceStatus,
        HoldReason, LinkSample, Order, PoseSample, PowerSample, RangeReading, RangeStatus,
        RangesHeader, RosterEntry, RosterHeader, StageState, TargetSample, WheelSample, name_str,
    },
    topics::{self, AnyTopic},
};
use glam::DVec2;
use serde_json::{Value, json};

use crate::{
    blob::{self, Shown},
    events::{Event, Events, words},
};

/// The columns of a row before those of the sensors.
pub(crate) const COLUMNS: [&str; 24] = [
    "t",
    "x",
    "y",
    "heading",
    "xx",
    "xy",
    "yy",
    "v",
    "omega",
    "v_told",
    "omega_told",
    "left",
    "right",
    "left_told",
    "right_told",
    "distance",
    "limit",
    "latency_ms",
    "board_v",
    "motor_v",
    "status",
    "true_x",
    "true_y",
    "true_heading",
];
/// The mission time after which a state is given again although only ages have changed, seconds.
const STATE_AGAIN_S: f64 = 1.0;
/// Most ticks whose samples come in at a time.
const MOST_TICKS: usize = 4096;
/// Most ticks of the ground truth that wait for their pose.
const MOST_TRUTHS: usize = 4096;

/// The samples of a tick. A recording has them by topics, some ticks at a time.
#[derive(Clone, Debug, Default)]
struct Tick {
    pose: Option<PoseSample>,
    /// Speeds of the left and the right wheel by their encoders, rad/s.
    wheels: Option<[f64; 2]>,
    command: Option<CommandSample>,
    guidance: Option<GuidanceSample>,
    ranges: Option<Vec<Option<f64>>>,
    latency_ns: Option<u64>,
}

/// The content of the newest samples.
#[derive(Debug)]
pub struct Collector {
    mission: Mission,
    /// Ticks whose samples come in, by their numbers.
    ticks: BTreeMap<u64, Tick>,
    /// The tick of the newest pose.
    pose_tick: u64,
    /// The samples of the newest row.
    newest: Tick,
    power: Option<PowerSample>,
    link: LinkSample,
    roster: RosterHeader,
    stages: Vec<RosterEntry>,
    usage: Vec<Usage>,
    grid: Replica<u8>,
    grid_header: GridHeader,
    field: Replica<FieldCell>,
    field_target: DVec2,
    target: DVec2,
    events: Events,
    /// The targets after the current one.
    ahead: Vec<DVec2>,
    /// The ground truth from the tick of the newest row on, as far as it was read.
    truths: VecDeque<GroundTruthTick>,
    /// The facts that decided the newest state, and their time.
    state_of: Option<(Vec<u64>, f64)>,
    map_of: Option<u64>,
    field_of: Option<u64>,
}

impl Collector {
    /// The topics whose messages are shown, besides the field.
    pub const TOPICS: [&dyn AnyTopic; 15] = [
        &topics::POSE,
        &topics::RANGES,
        &topics::WHEELS,
        &topics::COMMAND,
        &topics::GUIDANCE,
        &topics::TARGET,
        &topics::POWER,
        &topics::GRID,
        &topics::ROSTER,
        &topics::DEATHS,
        &topics::DIRECTIVE,
        &topics::STALLS,
        &topics::REQUESTS,
        &topics::FAULTS,
        // The link ends a tick, so it is read last.
        &topics::LINK,
    ];

    pub fn new(mission: &Mission) -> Self {
        Self {
            mission: mission.clone(),
            ticks: BTreeMap::new(),
            pose_tick: 0,
            newest: Tick {
                ranges: Some(vec![None; mission.sensor_table().len()]),
                ..Tick::default()
            },
            power: None,
            link: LinkSample::default(),
            roster: RosterHeader::default(),
            stages: Vec::new(),
            usage: Vec::new(),
            grid: Replica::default(),
            grid_header: GridHeader::default(),
            field: Replica::default(),
            field_target: mission.target,
            target: mission.target,
            ahead: Vec::new(),
            events: Events::default(),
            truths: VecDeque::new(),
            state_of: None,
            map_of: None,
            field_of: None,
        }
    }

    /// Take the message `data` of `topic`. None if it does not match its topic; other topics are ignored.
    pub fn take(&mut self, topic: &str, data: &[u8]) -> Option<()> {
        fn sample<P: Layout>(data: &[u8]) -> Option<P> {
            decode_sample(data)
        }
        let is = |known: &dyn AnyTopic| topic == known.spec().name;
        if is(&topics::POSE) {
            self.pose(sample(data)?);
        } else if is(&topics::RANGES) {
            let (header, readings) = decode_slice::<RangesHeader, RangeReading>(data)?;
            self.ranges(header.stamp.tick, &readings);
        } else if is(&topics::WHEELS) {
            self.wheels(&sample(data)?);
        } else if is(&topics::COMMAND) {
            self.command(sample(data)?);
        } else if is(&topics::GUIDANCE) {
            let guidance: GuidanceSample = sample(data)?;
            self.tick(guidance.stamp.tick).guidance = Some(guidance);
        } else if is(&topics::TARGET) {
            self.sent(&sample(data)?);
        } else if is(&topics::POWER) {
            self.power = Some(sample(data)?);
        } else if is(&topics::LINK) {
            self.link(sample(data)?);
        } else if is(&topics::GRID) {
            let (header, cells) = decode_slice::<GridHeader, u8>(data)?;
            self.grid(&header, &cells);
        } else if is(&topics::FIELD) {
            let (header, cells) = decode_slice::<FieldHeader, FieldCell>(data)?;
            self.field(&header, &cells);
        } else if is(&topics::ROSTER) {
            let (header, entries) = decode_slice::<RosterHeader, RosterEntry>(data)?;
            self.roster(header, &entries);
        } else if is(&topics::DEATHS) {
            self.events.death(&sample(data)?);
        } else if is(&topics::DIRECTIVE) {
            self.events.directive(&sample(data)?);
        } else if is(&topics::STALLS) {
            self.events.stall(&sample(data)?);
        } else if is(&topics::REQUESTS) {
            self.events.request(&sample(data)?);
        } else if is(&topics::FAULTS) {
            self.events.fault(&sample(data)?);
        }
        Some(())
    }

    fn pose(&mut self, pose: PoseSample) {
        self.events.now_s = self.events.now_s.max(pose.stamp.time().seconds());
        self.pose_tick = pose.stamp.tick;
        self.tick(pose.stamp.tick).pose = Some(pose);
    }

    fn tick(&mut self, number: u64) -> &mut Tick {
        if self.ticks.len() >= MOST_TICKS {
            self.ticks.pop_first();
        }
        self.ticks.entry(number).or_default()
    }

    fn ranges(&mut self, tick: u64, readings: &[RangeReading]) {
        let mut ranges = vec![None; self.newest.ranges.as_ref().map_or(0, Vec::len)];
        for reading in readings {
            let Some(range) = ranges.get_mut(usize::from(reading.sensor)) else {
                continue;
            };
            *range = match reading.status() {
                RangeStatus::Measured | RangeStatus::AtContact => Some(reading.range_m),
                RangeStatus::Absent | RangeStatus::Nothing | RangeStatus::Invalid => None,
            };
        }
        self.tick(tick).ranges = Some(ranges);
    }

    fn wheels(&mut self, wheels: &WheelSample) {
        let per_count = std::f64::consts::TAU / self.mission.body().counts_per_turn;
        let speeds = [wheels.left_counts_per_s, wheels.right_counts_per_s];
        self.tick(wheels.stamp.tick).wheels =
            Some(speeds.map(|speed| f64::from(speed) * per_count));
    }

    fn command(&mut self, command: CommandSample) {
        self.events.command(&command);
        self.tick(command.stamp.tick).command = Some(command);
    }

    fn grid(&mut self, header: &GridHeader, cells: &[u8]) {
        if self.grid.apply(&header.part, cells) != Applied::Missed {
            self.grid_header = *header;
        }
    }

    pub(crate) fn field(&mut self, header: &FieldHeader, cells: &[FieldCell]) {
        if self.field.apply(&header.part, cells) != Applied::Missed {
            self.field_target = DVec2::new(header.target_x_m, header.target_y_m);
        }
    }

    fn sent(&mut self, target: &TargetSample) {
        self.events.target(target);
        self.target = target.target.position();
        self.ahead = target.ahead().iter().map(|point| point.position()).collect();
    }

    fn roster(&mut self, header: RosterHeader, entries: &[RosterEntry]) {
        self.events.roster(entries);
        self.roster = header;
        self.stages = entries.to_vec();
    }

    fn link(&mut self, link: LinkSample) {
        self.events.link(&link);
        self.tick(link.stamp.tick).latency_ns = Some(link.latency_ns);
        self.link = link;
    }

    /// The row of `tick`. Values that did not come in it are as before.
    fn row(&mut self, tick: Tick) -> Option<Value> {
        let pose = &tick.pose?;
        let Tick { wheels, command, guidance, ranges, latency_ns, .. } =
            std::mem::take(&mut self.newest);
        self.newest = Tick {
            pose: Some(*pose),
            wheels: tick.wheels.or(wheels),
            command: tick.command.or(command),
            guidance: tick.guidance.or(guidance),
            ranges: tick.ranges.or(ranges),
            latency_ns: tick.latency_ns.or(latency_ns),
        };
        let [left, right] = self.newest.wheels.unwrap_or([f64::NAN; 2]);
        let command = self.newest.command.unwrap_or_default();
        let guidance = self.newest.guidance.unwrap_or_default();
        let [xx, xy, _, yy, ..] = pose.covariance;
        let of_pose = self.truths.iter().position(|truth| truth.is_of(pose));
        self.truths.drain(..of_pose.unwrap_or_default());
        let truth = of_pose.and_then(|_| self.truths.front());
        let truth = truth.map_or([f64::NAN; 3], |truth| [truth.x, truth.y, truth.heading]);
        let volts = self.power.map_or([f64::NAN; 2], |power| [power.board_v, power.motor_v]);
        let values = [
            pose.stamp.time().seconds(),
            pose.x_m,
            pose.y_m,
            pose.heading_rad,
            xx,
            xy,
            yy,
            pose.v_m_s,
            pose.omega_rad_s,
            command.v_m_s,
            command.omega_rad_s,
            left,
            right,
            command.left_rad_s,
            command.right_rad_s,
            guidance.distance_m,
            guidance.speed_limit_m_s,
            self.newest.latency_ns.map_or(f64::NAN, |ns| ns as f64 / 1e6),
            volts[0],
            volts[1],
            f64::from(guidance.status),
            truth[0],
            truth[1],
            truth[2],
        ];
        let ranges = self.newest.ranges.iter().flatten();
        let ranges = ranges.map(|range| range.map_or(Value::Null, rounded));
        Some(values.into_iter().map(rounded).chain(ranges).collect())
    }

    /// Take a line of the ground truth, which is written before the tick's pose is published. Returns whether a further line may come
    /// before the next pose.
    pub fn truth(&mut self, line: &str) -> bool {
        if let Ok(truth) = serde_json::from_str(line) {
            if self.truths.len() == MOST_TRUTHS {
                self.truths.pop_front();
            }
            self.truths.push_back(truth);
        }
        self.truths.len() < MOST_TRUTHS
    }

    /// Take a line of the log of `process`.
    pub fn log(&mut self, process: &str, line: &str) {
        self.events.log(process, line);
    }

    /// The processes of the stages, and the supervisor's.
    pub fn processes(&self) -> Vec<u32> {
        let stages = self.stages.iter().map(|entry| entry.pid);
        stages.chain([self.roster.supervisor_pid]).collect()
    }

    /// Take the usage of these processes, in the order of [`Self::processes`].
    pub fn used(&mut self, usage: Vec<Usage>) {
        self.usage = usage;
    }

    /// The rows of the ticks that have ended since the last time: a sample of the link ends a tick.
    pub fn take_rows(&mut self) -> Vec<Value> {
        let last = self.link.stamp.tick.min(self.pose_tick);
        let mut rows = Vec::new();
        while let Some(first) = self.ticks.first_entry().filter(|first| *first.key() <= last) {
            let tick = first.remove();
            rows.extend(self.row(tick));
        }
        rows
    }

    /// The events since the last time.
    pub fn take_events(&mut self) -> Vec<Event> {
        self.events.take()
    }

    /// The mission time of the newest pose, seconds.
    pub fn now_s(&self) -> f64 {
        self.events.now_s
    }

    /// The map as a message, if it has changed since the last time.
    pub fn take_map(&mut self) -> Option<Vec<u8>> {
        let frame = self.grid.frame()?;
        let version = self.grid.version();
        let changed = self.map_of.replace(version) != Some(version);
        changed.then(|| blob::map(frame, self.grid.cells(), self.now_s()))
    }

    /// The field as a message, if it has changed since the last time.
    pub fn take_field(&mut self) -> Option<Vec<u8>> {
        let frame = self.field.frame()?;
        let version = self.field.version();
        let changed = self.field_of.replace(version) != Some(version);
        let cells = self.field.cells();
        changed.then(|| blob::field(Shown::Field, frame, cells, self.field_target, self.now_s()))
    }

    /// The map, for a planner; none before the first keyframe.
    pub fn belief(&self) -> Option<(GridHeader, &[u8])> {
        let frame = self.grid.frame()?;
        let part = common::grid::Part::whole(frame, self.grid.version());
        Some((GridHeader { part, ..self.grid_header }, self.grid.cells()))
    }

    /// The target of the robot, metres.
    pub const fn target(&self) -> DVec2 {
        self.target
    }

    pub fn mission(&self) -> &Mission {
        &self.mission
    }

    /// Whether the link stops the robot for an operator, and the link's action in words.
    #[cfg(feature = "live")]
    pub(crate) fn link_says(&self) -> (bool, String) {
        let (action, cause) = (self.link.action().effect(), self.link.cause());
        let why = if self.link.stopped() { format!(": {}", cause.name()) } else { String::new() };
        (
            cause == common::samples::Cause::OperatorStop,
            format!("the link says that the robot {action}{why}"),
        )
    }

    /// The state of the robot's processes, if it has changed since the last time; if only ages differ, once a second.
    pub fn take_state(&mut self) -> Option<Value> {
        if self.stages.is_empty() {
            return None;
        }
        let flags = |entry: &RosterEntry| [u64::from(entry.pid), u64::from(entry.state)];
        let mut key: Vec<u64> = self.stages.iter().flat_map(flags).collect();
        let LinkSample { action, cause, connected, at_rest, .. } = self.link;
        let RosterHeader { order, reason, .. } = self.roster;
        let kind = self.events.kind(&self.link);
        key.extend(
            [action, cause, at_rest, order, reason, self.status(), kind as u8].map(u64::from),
        );
        key.extend([u64::from(connected), self.events.target, self.ahead.len() as u64]);
        let now = self.now_s();
        if let Some((before, at)) = &self.state_of
            && *before == key
            && now < at + STATE_AGAIN_S
        {
            return None;
        }
        self.state_of = Some((key, now));
        Some(self.state())
    }

    fn status(&self) -> u8 {
        self.newest.guidance.map_or(0, |guidance| guidance.status)
    }

    fn state(&self) -> Value {
        let usage = |at: usize| self.usage.get(at).copied().unwrap_or_default();
        let stages = self.stages.iter().enumerate().map(|(at, entry)| {
            json!({
                "name": name_str(&entry.stage),
                "state": words(StageState::from_byte(entry.state)),
                "pid": entry.pid,
                "generation": entry.generation,
                "restarts": entry.restarts,
                "age_s": seconds(entry.uptime_ns),
                "beat_s": seconds(entry.beat_age_ns),
                "cpu": usage(at).cpu.map_or(Value::Null, rounded),
                "memory": usage(at).memory_bytes,
            })
        });
        let own = usage(self.stages.len());
        let targets = [self.target].into_iter().chain(self.ahead.iter().copied());
        json!({
            "t": rounded(self.now_s()),
            "order": words(Order::from_byte(self.roster.order)),
            "reason": match HoldReason::from_byte(self.roster.reason) {
                HoldReason::None => String::new(),
                reason => words(reason),
            },
            "connected": self.link.connected == 1,
            "at_rest": self.link.at_rest == 1,
            "stopped": self.link.stopped(),
            "kind": self.events.kind(&self.link),
            "action": self.link.action().effect(),
            "cause": self.link.cause().name(),
            "guidance": words(GuidanceStatus::from_byte(self.status())),
            "targets": targets.map(|at| [at.x, at.y]).collect::<Vec<_>>(),
            "stages": stages.collect::<Vec<_>>(),
            "supervisor": {
                "pid": self.roster.supervisor_pid,
                "cpu": own.cpu.map_or(Value::Null, rounded),
                "memory": own.memory_bytes,
            },
        })
    }
}

/// `value` to a tenth of a millimetre; null if it is no number.
fn rounded(value: f64) -> Value {
    Value::from((value * 1e4).round() / 1e4)
}

/// An age in seconds; null if it is not known.
fn seconds(ns: u64) -> Value {
    if ns == u64::MAX { Value::Null } else { Value::from((ns / 1_000_000) as f64 / 1e3) }
}
