//! Converts samples to chart rows, states, maps and fields.

use std::collections::{BTreeMap, VecDeque};

use common::{
    ground_truth::GroundTruthTick,
    mission::Mission,
    process_usage::Usage,
    samples::{
        CommandSample, GridHeader, GuidanceSample, LinkSample, Mover, PoseSample, RangeReading,
        RangeStatus, RosterEntry, RosterHeader, WheelSample, name_str,
    },
};
use glam::DVec2;
use robot_state::{RobotState, Sample, words};
use serde_json::{Value, json};

use crate::blob;

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
    "v_sent",
    "omega_sent",
    "left",
    "right",
    "left_sent",
    "right_sent",
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
/// Interval of states that differ only in ages, mission time in seconds.
const STATE_AGAIN_S: f64 = 1.0;
const MOST_TICKS: usize = 4096;
/// Most ground truth ticks that wait for their pose.
const MOST_TRUTHS: usize = 4096;

/// Samples of a tick. A recording yields several ticks at a time.
#[derive(Clone, Debug, Default)]
struct Tick {
    pose: Option<PoseSample>,
    /// Encoder speeds of the left and the right wheel, rad/s.
    wheels: Option<[f64; 2]>,
    command: Option<CommandSample>,
    guidance: Option<GuidanceSample>,
    ranges: Option<Vec<Option<f64>>>,
    movers: Option<Vec<Mover>>,
    /// Latency of the tick, and the share of the command that the link sends.
    link: Option<(u64, f64)>,
}

#[derive(Debug, Default)]
pub struct Collector {
    pub mission: Mission,
    ticks: BTreeMap<u64, Tick>,
    pose_tick: u64,
    newest: Tick,
    pub state: RobotState,
    /// Of [`RobotState::processes`], in their order.
    pub usage: Vec<Usage>,
    truths: VecDeque<GroundTruthTick>,
    state_of: Option<(Vec<u64>, f64)>,
    map_of: Option<u64>,
    field_of: Option<u64>,
}

impl Collector {
    pub fn new(mission: &Mission) -> Self {
        Self {
            mission: mission.clone(),
            newest: Tick {
                ranges: Some(vec![None; mission.sensor_table().len()]),
                ..Tick::default()
            },
            state: RobotState::of_mission(mission),
            ..Self::default()
        }
    }

    pub fn apply(&mut self, sample: &Sample) {
        self.state.apply(sample);
        match sample {
            // A mirror repeats its last samples.
            Sample::Pose(pose) if self.newest.pose.is_none_or(|it| it.stamp != pose.stamp) => {
                self.pose_tick = pose.stamp.tick;
                self.tick(pose.stamp.tick).pose = Some(*pose);
            }
            Sample::Ranges(header, readings) => self.ranges(header.stamp.tick, readings),
            Sample::Wheels(wheels) => self.wheels(wheels),
            Sample::Command(command) => self.tick(command.stamp.tick).command = Some(*command),
            Sample::Guidance(guidance) => {
                self.tick(guidance.stamp.tick).guidance = Some(*guidance);
            }
            Sample::Grid(header, _) => {
                let movers = header.drawn_movers().copied().collect();
                self.tick(header.stamp.tick).movers = Some(movers);
            }
            Sample::Link(link) => {
                let does = (link.latency_ns, link.action().speed_share());
                self.tick(link.stamp.tick).link = Some(does);
            }
            _ => {}
        }
    }

    fn tick(&mut self, number: u64) -> &mut Tick {
        if self.ticks.len() >= MOST_TICKS {
            self.ticks.pop_first();
        }
        assert!(self.ticks.len() < MOST_TICKS);
        self.ticks.entry(number).or_default()
    }

    fn ranges(&mut self, tick: u64, readings: &[RangeReading]) {
        let mut ranges = vec![None; self.newest.ranges.as_ref().map_or(0, Vec::len)];
        for reading in readings {
            if let Some(range) = ranges.get_mut(usize::from(reading.sensor)) {
                let is_seen =
                    matches!(reading.status(), RangeStatus::Measured | RangeStatus::AtContact);
                *range = is_seen.then_some(reading.range_m);
            }
        }
        self.tick(tick).ranges = Some(ranges);
    }

    fn wheels(&mut self, wheels: &WheelSample) {
        let per_count = std::f64::consts::TAU / self.mission.body().counts_per_turn;
        let speeds = [wheels.left_counts_per_s, wheels.right_counts_per_s];
        self.tick(wheels.stamp.tick).wheels =
            Some(speeds.map(|speed| f64::from(speed) * per_count));
    }

    /// Returns the row of `tick`. Missing values repeat their predecessors. Movers, if any, follow
    /// the sensors.
    fn row(&mut self, tick: Tick) -> Option<Value> {
        let pose = &tick.pose?;
        let before = std::mem::take(&mut self.newest);
        self.newest = Tick {
            pose: tick.pose,
            wheels: tick.wheels.or(before.wheels),
            command: tick.command.or(before.command),
            guidance: tick.guidance.or(before.guidance),
            ranges: tick.ranges.or(before.ranges),
            movers: tick.movers.or(before.movers),
            link: tick.link.or(before.link),
        };
        let [left, right] = self.newest.wheels.unwrap_or([f64::NAN; 2]);
        let command = self.newest.command.unwrap_or_default();
        let (latency_ns, sent) = self.newest.link.unwrap_or_default();
        let guidance = self.newest.guidance.unwrap_or_default();
        let [xx, xy, _, yy, ..] = pose.covariance;
        let of_pose = self.truths.iter().position(|truth| truth.is_of(pose));
        self.truths.drain(..of_pose.unwrap_or_default());
        let truth = of_pose
            .and_then(|_| self.truths.front())
            .map_or([f64::NAN; 3], |truth| [truth.x, truth.y, truth.heading]);
        let volts = self.state.power.map_or([f64::NAN; 2], |power| [power.board_v, power.motor_v]);
        let values = [
            pose.stamp.seconds(),
            pose.x_m,
            pose.y_m,
            pose.heading_rad,
            xx,
            xy,
            yy,
            pose.v_m_s,
            pose.omega_rad_s,
            sent * command.v_m_s,
            sent * command.omega_rad_s,
            left,
            right,
            sent * command.left_rad_s,
            sent * command.right_rad_s,
            guidance.distance_m,
            guidance.signed_limit_m_s(),
            latency_ns as f64 / 1e6,
            volts[0],
            volts[1],
            f64::from(guidance.status),
            truth[0],
            truth[1],
            truth[2],
        ];
        assert_eq!(values.len(), COLUMNS.len());
        let ranges =
            self.newest.ranges.iter().flatten().map(|range| range.map_or(Value::Null, rounded));
        let movers = self
            .newest
            .movers
            .as_ref()
            .filter(|movers| !movers.is_empty())
            .map(|movers| movers.iter().map(mover).collect::<Value>());
        Some(values.into_iter().map(rounded).chain(ranges).chain(movers).collect())
    }

    /// Takes a line of ground truth, written before its tick's pose. Returns whether to read on
    /// before the next pose.
    pub fn truth(&mut self, line: &str) -> bool {
        if let Ok(truth) = serde_json::from_str(line) {
            if self.truths.len() == MOST_TRUTHS {
                self.truths.pop_front();
            }
            self.truths.push_back(truth);
            assert!(self.truths.len() <= MOST_TRUTHS);
        }
        self.truths.len() < MOST_TRUTHS
    }

    /// Returns the rows of newly ended ticks. A sample of the link ends a tick.
    pub fn take_rows(&mut self) -> Vec<Value> {
        let last = self.state.link.map_or(0, |link| link.stamp.tick).min(self.pose_tick);
        let mut rows = Vec::new();
        while let Some(first) = self.ticks.first_entry().filter(|first| *first.key() <= last) {
            let tick = first.remove();
            rows.extend(self.row(tick));
        }
        rows
    }

    pub fn take_map(&mut self) -> Option<Vec<u8>> {
        let map = &self.state.map;
        let changed = self.map_of.replace(map.version()) != Some(map.version());
        let frame = map.frame().filter(|_| changed)?;
        Some(blob::map(frame, map.cells(), self.state.now_s()))
    }

    pub fn take_field(&mut self) -> Option<Vec<u8>> {
        let (field, header) = (&self.state.field, &self.state.field_header);
        let changed = self.field_of.replace(field.version()) != Some(field.version());
        let frame = field.frame().filter(|_| changed)?;
        let target = DVec2::new(header.target_x_m, header.target_y_m);
        Some(blob::field(blob::Shown::Field, frame, field.cells(), target, self.state.now_s()))
    }

    /// Returns the map for a planner, from the first keyframe on.
    pub fn belief(&self) -> Option<(GridHeader, &[u8])> {
        let map = &self.state.map;
        let part = common::grid::Part::whole(map.frame()?, map.version());
        Some((GridHeader { part, ..self.state.map_header }, map.cells()))
    }

    pub fn target(&self) -> DVec2 {
        self.state.target.map_or(self.mission.target, |sent| sent.target.position())
    }

    /// Returns a changed state of the processes, once a second if only ages differ. A mirror's time
    /// stands while its robot is not heard.
    pub fn take_state(&mut self) -> Option<Value> {
        if self.state.stages.is_empty() {
            return None;
        }
        let flags = |entry: &RosterEntry| [u64::from(entry.pid), u64::from(entry.state)];
        let mut key: Vec<u64> = self.state.stages.iter().flat_map(flags).collect();
        let LinkSample { action, cause, connected, at_rest, .. } =
            self.state.link.unwrap_or_default();
        let RosterHeader { order, reason, .. } = self.state.supervisor.unwrap_or_default();
        let status = self.newest.guidance.map_or(0, |guidance| guidance.status);
        key.extend([action, cause, at_rest, order, reason, status].map(u64::from));
        let target = self.state.target.map_or(0, |sent| sent.number);
        let mirror_s = self.state.mirror.map_or(0, |mirror| mirror.age_s() as u64);
        key.extend([u64::from(connected), target, self.state.targets().count() as u64, mirror_s]);
        let now = self.state.now_s();
        if let Some((before, at)) = &self.state_of
            && *before == key
            && now < at + STATE_AGAIN_S
        {
            return None;
        }
        self.state_of = Some((key, now));
        Some(self.state_json())
    }

    fn state_json(&self) -> Value {
        let usage = |at: usize| self.usage.get(at).copied().unwrap_or_default();
        let (roster, (kind, does)) =
            (self.state.supervisor.unwrap_or_default(), self.state.doing());
        let stages = self.state.stages.iter().enumerate().map(|(at, entry)| {
            json!({
                "name": name_str(&entry.stage),
                "state": words(entry.state()),
                "pid": entry.pid,
                "generation": entry.generation,
                "restarts": entry.restarts,
                "age_s": seconds(entry.uptime_ns),
                "beat_s": seconds(entry.beat_age_ns),
                "cpu": usage(at).cpu.map_or(Value::Null, rounded),
                "memory": usage(at).memory_bytes,
            })
        });
        let own = usage(self.state.stages.len());
        let targets = self.state.targets().map(|at| [at.x_m, at.y_m]);
        json!({
            "t": rounded(self.state.now_s()),
            "order": words(roster.order()),
            "kind": kind,
            "does": does,
            "to_go": self.state.way_to_go(),
            "targets": targets.collect::<Vec<_>>(),
            "stages": stages.collect::<Vec<_>>(),
            "supervisor": {
                "pid": roster.supervisor_pid,
                "cpu": own.cpu.map_or(Value::Null, rounded),
                "memory": own.memory_bytes,
            },
        })
    }
}

/// Formats place, velocity, radius and the surface's 95 % radius, rounded to save space.
fn mover(mover: &Mover) -> Value {
    let (at, velocity) = (mover.place(), mover.velocity());
    [at.x, at.y, velocity.x, velocity.y, mover.radius_m.into(), mover.reach_m()]
        .into_iter()
        .map(|value| Value::from((value * 1e2).round() / 1e2))
        .collect()
}

/// Rounds to a tenth of a millimetre. Non-finite values become null.
fn rounded(value: f64) -> Value {
    Value::from((value * 1e4).round() / 1e4)
}

fn seconds(ns: u64) -> Value {
    if ns == u64::MAX { Value::Null } else { Value::from((ns / 1_000_000) as f64 / 1e3) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::samples::Stamp;

    #[test]
    fn a_row_has_the_movers_of_its_tick_and_none_that_cannot_be_drawn() {
        let mut collector = Collector::new(&Mission::default());
        let mover =
            Mover { x_m: 1.0, vy_m_s: -0.5, radius_m: 0.25, doubt_m: 0.1, ..Mover::default() };
        let mut row = |tick, movers: &[Mover]| {
            let stamp = Stamp { tick, ..Stamp::default() };
            let pose = PoseSample { stamp, ..PoseSample::default() };
            collector.apply(&Sample::Pose(pose));
            let mut header = GridHeader { stamp, ..GridHeader::default() };
            header.movers[..movers.len()].copy_from_slice(movers);
            header.mover_count = movers.len() as u64;
            collector.apply(&Sample::Grid(header, Vec::new()));
            let link = LinkSample { stamp, ..LinkSample::default() };
            collector.apply(&Sample::Link(link));
            let sensors = Mission::default().sensor_table().len();
            collector.take_rows().remove(0).get(COLUMNS.len() + sensors).cloned()
        };
        assert_eq!(row(1, &[]), None);
        let hostile = [f32::NAN, -1.0].map(|radius_m| Mover { radius_m, ..mover });
        let drawn = row(2, &[hostile[0], mover, hostile[1]]);
        assert_eq!(drawn, Some(json!([[1.0, 0.0, 0.0, -0.5, 0.25, 0.45]])));
        assert_eq!(row(3, &[]), None);
    }
}
