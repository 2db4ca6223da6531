//! The state of a robot: its newest samples.

use std::collections::BTreeMap;

use common::{
    grid::{Applied, Replica},
    mission::Mission,
    samples::{
        CommandSample, DeathSample, FieldCell, FieldHeader, GridHeader, GuidanceSample, LinkSample,
        PoseSample, PowerSample, RosterEntry, RosterHeader, TargetPoint, TargetSample, name_str,
    },
};
use glam::DVec2;

use crate::{
    events::{Event, Events, Kind},
    sample::Sample,
};

/// The longest way, in points.
const MOST_POINTS: usize = 2000;
/// The least distance between two points of the way, metres.
const POINT_EVERY_M: f64 = 0.05;

/// What a robot is doing. Samples that have not come yet are none, lists are empty. Lengths are metres in the mission frame.
#[derive(Clone, Debug, Default)]
pub struct RobotState {
    /// The supervisor with its order.
    pub supervisor: Option<RosterHeader>,
    pub stages: Vec<RosterEntry>,
    pub pose: Option<PoseSample>,
    /// Where the robot believes to have been, at about equal distances.
    pub way: Vec<DVec2>,
    /// The distance between two points of the way; 0 before the first.
    way_every_m: f64,
    /// The safety map, a [`common::grid::CellState`] a cell.
    pub map: Replica<u8>,
    pub map_header: GridHeader,
    pub field: Replica<FieldCell>,
    pub field_header: FieldHeader,
    pub target: Option<TargetSample>,
    pub guidance: Option<GuidanceSample>,
    pub command: Option<CommandSample>,
    pub link: Option<LinkSample>,
    pub power: Option<PowerSample>,
    /// The newest death of each stage that died.
    pub deaths: BTreeMap<String, DeathSample>,
    /// The number of stalls that were seen.
    pub stalls: u64,
    events: Events,
}

impl RobotState {
    /// A robot before its first sample, which drives `mission`.
    pub fn of_mission(mission: &Mission) -> Self {
        Self { target: Some(TargetSample::first(mission)), ..Self::default() }
    }

    /// Take a sample. Returns false for a part of a map that does not follow the parts before it; then a whole map is awaited.
    pub fn apply(&mut self, sample: &Sample) -> bool {
        self.events.sample(sample);
        match sample {
            Sample::Pose(pose) => self.pose(pose),
            Sample::Command(command) => self.command = Some(*command),
            Sample::Guidance(guidance) => self.guidance = Some(*guidance),
            Sample::Target(target) => self.target = Some(*target),
            Sample::Power(power) => self.power = Some(*power),
            Sample::Link(link) => self.link = Some(*link),
            Sample::Stall(_) => self.stalls += 1,
            Sample::Death(death) => {
                self.deaths.insert(name_str(&death.stage).to_owned(), *death);
            }
            Sample::Roster(header, entries) => {
                self.supervisor = Some(*header);
                self.stages.clone_from(entries);
            }
            Sample::Grid(header, cells) => {
                if self.map.apply(&header.part, cells) == Applied::Missed {
                    return false;
                }
                self.map_header = *header;
            }
            Sample::Field(header, cells) => {
                if self.field.apply(&header.part, cells) == Applied::Missed {
                    return false;
                }
                self.field_header = *header;
            }
            Sample::Ranges(..)
            | Sample::Scan(..)
            | Sample::Wheels(_)
            | Sample::Directive(_)
            | Sample::Request(_)
            | Sample::Fault(_) => {}
        }
        true
    }

    fn pose(&mut self, pose: &PoseSample) {
        self.pose = Some(*pose);
        let position = pose.pose().position;
        let last = self.way.last();
        if last.is_some_and(|last| last.distance(position) < self.way_every_m) {
            return;
        }
        if self.way.len() == MOST_POINTS {
            drop_every_second(&mut self.way);
            self.way_every_m *= 2.0;
        }
        self.way_every_m = self.way_every_m.max(POINT_EVERY_M);
        self.way.push(position);
    }

    /// Take a line of the log of `process`.
    pub fn log(&mut self, process: &str, line: &str) {
        self.events.log(process, line);
    }

    /// The events since the last call, the oldest first. Only the newest are held.
    pub fn take_events(&mut self) -> Vec<Event> {
        self.events.drain()
    }

    /// The mission time of the newest pose, seconds.
    pub const fn now_s(&self) -> f64 {
        self.events.now_s
    }

    /// The current target and those after it.
    pub fn targets(&self) -> impl Iterator<Item = &TargetPoint> {
        self.target.iter().flat_map(|sent| [&sent.target].into_iter().chain(sent.ahead()))
    }

    /// The importance of what the link's failsafe does.
    pub fn failsafe(&self) -> Kind {
        self.events.kind(&self.link.unwrap_or_default())
    }
}

/// Drop every second item, from the second one on.
pub fn drop_every_second<T>(items: &mut Vec<T>) {
    let mut nth = 0;
    items.retain(|_| {
        nth += 1;
        nth % 2 == 1
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::grid::{GridFrame, Part, Window};

    #[test]
    fn the_way_is_bounded_and_its_points_are_about_equally_far_apart() {
        let mut state = RobotState::default();
        for nth in 0..1_000_000 {
            let pose = PoseSample { x_m: f64::from(nth) * 0.01, ..PoseSample::default() };
            state.apply(&Sample::Pose(pose));
        }
        assert!((MOST_POINTS / 2..=MOST_POINTS).contains(&state.way.len()));
        let apart = || state.way.windows(2).map(|pair| pair[0].distance(pair[1]));
        let (least, most) = (apart().fold(f64::MAX, f64::min), apart().fold(0.0, f64::max));
        assert!(most < 2.5 * least, "{least} to {most} m");
    }

    #[test]
    fn a_part_of_a_map_that_does_not_follow_is_refused_until_a_whole_map_comes() {
        let mut state = RobotState::default();
        let frame = GridFrame { cells: 10, resolution_m: 0.1, centre: DVec2::ZERO };
        let mut grid = |part, cells: &[u8]| {
            let header = GridHeader { part, ..GridHeader::default() };
            state.apply(&Sample::Grid(header, cells.to_vec()))
        };
        let window =
            |version| Part::of(frame, Window { col: 0, row: 0, width: 1, height: 1 }, version);
        assert!(!grid(window(1), &[1]));
        assert!(grid(Part::whole(frame, 1), &[0; 100]));
        assert!(grid(window(2), &[1]));
        assert!(!grid(window(4), &[1]));
        assert!(grid(Part::whole(frame, 4), &[2; 100]));
        assert_eq!((state.map.version(), state.map.cells()[0]), (4, 2));
    }
}
