//! The data of the screen.

use std::collections::VecDeque;

use common::{
    domain::RobotName,
    grid::Replica,
    process_usage::Usage,
    samples::{
        CommandSample, FieldCell, GuidanceSample, LinkSample, PoseSample, PowerSample, RosterEntry,
        RosterHeader, name_str,
    },
};
use glam::DVec2;
use recording::downsampled::drop_every_second;

/// The longest way, in points. If it is longer, every second point is dropped.
const MOST_POINTS: usize = 4000;
/// The distance between two points of the way, metres.
const POINT_EVERY_M: f64 = 0.05;
const MOST_EVENTS: usize = 50;

#[derive(Debug)]
pub(super) struct View {
    pub(super) robot: RobotName,
    /// Whether a run of the robot goes on.
    pub(super) connected: bool,
    /// The supervisor; none before its first roster.
    pub(super) supervisor: Option<RosterHeader>,
    pub(super) supervisor_usage: Usage,
    pub(super) stages: Vec<Stage>,
    /// The row of the stage that the keys concern.
    pub(super) chosen: usize,
    pub(super) pose: Option<PoseSample>,
    pub(super) guidance: Option<GuidanceSample>,
    pub(super) command: Option<CommandSample>,
    pub(super) link: Option<LinkSample>,
    pub(super) power: Option<PowerSample>,
    pub(super) grid: Replica<u8>,
    pub(super) field: Replica<FieldCell>,
    /// The target and those after it, metres in the mission frame.
    pub(super) targets: Vec<DVec2>,
    /// The believed way of the robot, metres in the mission frame.
    pub(super) way: Vec<DVec2>,
    /// Deaths and stalls, the newest first.
    pub(super) events: VecDeque<String>,
    /// The result of the last key.
    pub(super) message: String,
}

#[derive(Clone, Debug)]
pub(super) struct Stage {
    pub(super) entry: RosterEntry,
    /// Samples a second on its first output; none before they were counted.
    pub(super) rate_hz: Option<f64>,
    pub(super) usage: Usage,
}

impl View {
    pub(super) fn of(robot: RobotName) -> Self {
        Self {
            robot,
            connected: false,
            supervisor: None,
            supervisor_usage: Usage::default(),
            stages: Vec::new(),
            chosen: 0,
            pose: None,
            guidance: None,
            command: None,
            link: None,
            power: None,
            grid: Replica::default(),
            field: Replica::default(),
            targets: Vec::new(),
            way: Vec::new(),
            events: VecDeque::new(),
            message: String::new(),
        }
    }

    /// Note that a run of the robot began, and drop the data of the last run.
    pub(super) fn on_connected(&mut self) {
        let chosen = self.chosen;
        *self = Self::of(self.robot.clone());
        (self.connected, self.chosen) = (true, chosen);
    }

    /// The name of the chosen stage; none before the first roster.
    pub(super) fn chosen_stage(&self) -> Option<&str> {
        let stage = self.stages.get(self.chosen);
        stage.map(|stage| name_str(&stage.entry.stage))
    }

    pub(super) fn on_pose(&mut self, pose: PoseSample) {
        let position = pose.pose().position;
        let last = self.way.last();
        if last.is_none_or(|last| last.distance(position) >= POINT_EVERY_M) {
            if self.way.len() == MOST_POINTS {
                drop_every_second(&mut self.way);
            }
            self.way.push(position);
        }
        self.pose = Some(pose);
    }

    pub(super) fn on_roster(&mut self, header: RosterHeader, entries: &[RosterEntry]) {
        self.supervisor = Some(header);
        self.stages.resize_with(entries.len(), || Stage {
            entry: RosterEntry::default(),
            rate_hz: None,
            usage: Usage::default(),
        });
        for (stage, entry) in self.stages.iter_mut().zip(entries) {
            stage.entry = *entry;
        }
        self.chosen = self.chosen.min(entries.len().saturating_sub(1));
    }

    pub(super) fn on_event(&mut self, event: String) {
        self.events.push_front(event);
        self.events.truncate(MOST_EVENTS);
    }
}
