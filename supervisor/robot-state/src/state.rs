use std::collections::BTreeMap;

use common::{
    grid::{Applied, Replica},
    mission::Mission,
    samples::{
        CommandSample, ComplaintSample, DeathSample, FieldCell, FieldHeader, FollowState,
        FollowingSample, GridHeader, GuidanceSample, GuidanceStatus, HoldReason, LinkSample,
        MirrorSample, PoseSample, PowerSample, RosterEntry, RosterHeader, TargetPoint,
        TargetSample, name_str,
    },
};
use glam::DVec2;

use crate::{
    events::{Event, Events, Kind},
    sample::Sample,
    words::{failsafe_in_words, guidance_in_words},
};

const MOST_POINTS: usize = 2000;
/// Least distance between two points of the path, metres.
const POINT_EVERY_M: f64 = 0.05;

/// Age from which a mirror is outdated, seconds. States come several times a second.
const OLD_S: f64 = 1.0;
/// State of a robot. Missing samples are `None`, lists start empty. Lengths are metres in the
/// mission frame.
#[derive(Clone, Debug, Default)]
pub struct RobotState {
    pub supervisor: Option<RosterHeader>,
    pub stages: Vec<RosterEntry>,
    pub pose: Option<PoseSample>,
    /// Believed path at about equal distances.
    pub way: Vec<DVec2>,
    way_every_m: f64,
    /// Safety map, a [`common::grid::CellState`] a cell.
    pub map: Replica<u8>,
    pub map_header: GridHeader,
    pub field: Replica<FieldCell>,
    pub field_header: FieldHeader,
    pub target: Option<TargetSample>,
    pub following: Option<FollowingSample>,
    pub guidance: Option<GuidanceSample>,
    pub command: Option<CommandSample>,
    pub link: Option<LinkSample>,
    /// Newest complaint, repeated by its stage while it lasts.
    complaint: Option<ComplaintSample>,
    pub power: Option<PowerSample>,
    pub mirror: Option<MirrorSample>,
    pub deaths: BTreeMap<String, DeathSample>,
    pub stalls: u64,
    events: Events,
}

impl RobotState {
    pub fn of_mission(mission: &Mission) -> Self {
        Self { target: Some(TargetSample::first(mission)), ..Self::default() }
    }

    /// Takes a sample. Returns false for a map part that does not follow the previous ones.
    pub fn apply(&mut self, sample: &Sample) -> bool {
        self.events.sample(sample);
        match sample {
            Sample::Pose(pose) => self.pose(pose),
            Sample::Command(command) => self.command = Some(*command),
            Sample::Guidance(guidance) => self.guidance = Some(*guidance),
            Sample::Target(target) => self.target = Some(*target),
            Sample::Following(following) => self.following = Some(*following),
            Sample::Power(power) => self.power = Some(*power),
            Sample::Mirror(mirror) => self.mirror = Some(*mirror),
            Sample::Link(link) => self.link = Some(*link),
            Sample::Complaint(complaint) => self.complaint = Some(*complaint),
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
            | Sample::Order(_)
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
        assert!(self.way.len() <= MOST_POINTS && self.way_every_m >= POINT_EVERY_M);
    }

    /// Takes a line of a log that was written at mission time `at_s`; now if it is unknown.
    pub fn log(&mut self, process: &str, line: &str, at_s: Option<f64>) {
        self.events.log(process, line, at_s);
    }

    pub fn processes(&self) -> Vec<u32> {
        self.stages
            .iter()
            .map(|entry| entry.pid)
            .chain([self.supervisor.unwrap_or_default().supervisor_pid])
            .collect()
    }

    pub fn take_events(&mut self) -> Vec<Event> {
        self.events.drain()
    }

    /// Returns the mission time of the newest pose, seconds.
    pub const fn now_s(&self) -> f64 {
        self.events.now_s
    }

    pub fn targets(&self) -> impl Iterator<Item = &TargetPoint> {
        self.target().into_iter().flat_map(|sent| [&sent.target].into_iter().chain(sent.ahead()))
    }

    /// Returns the robot's activity in a sentence, with a mirror's age, and its importance.
    pub fn doing(&self) -> (Kind, String) {
        let (kind, mut text) = self.does();
        if let Some(complaint) = self.complaint() {
            text += &format!("; {complaint}");
        }
        match self.age_in_words() {
            None => (kind, text),
            Some((is_old, age)) => {
                (if is_old { Kind::Bad } else { kind }, format!("{text} ({age})"))
            }
        }
    }

    /// Returns the age of a mirror's data, and whether it is outdated.
    pub fn age_in_words(&self) -> Option<(bool, String)> {
        let age_s = self.mirror?.age_s();
        let is_old = age_s >= OLD_S;
        let how = if is_old { "NOT HEARD for" } else { "as of" };
        let ago = if is_old { "" } else { " ago" };
        Some((is_old, format!("another machine, {how} {age_s:.1} s{ago}")))
    }

    /// Without samples of the link, no newer time makes a complaint old.
    pub fn complaint(&self) -> Option<&ComplaintSample> {
        let said = self.complaint.as_ref()?;
        let is_old =
            |link: LinkSample| link.stamp.time().since(said.stamp.time()) >= ComplaintSample::LASTS;
        (!self.link.is_some_and(is_old)).then_some(said)
    }

    fn does(&self) -> (Kind, String) {
        let status = self.guidance.unwrap_or_default().status;
        let (kind, text) = match (&self.link, self.supervisor.unwrap_or_default().reason()) {
            (Some(link), _) if link.connected == 0 && link.losses > 0 => {
                return (Kind::Bad, "the robot does not answer".to_owned());
            }
            (None, _) | (Some(_), HoldReason::Starting) => {
                return (Kind::Warn, "the robot starts".to_owned());
            }
            (_, HoldReason::Waiting) => (Kind::Warn, "the robot waits for a target".to_owned()),
            (_, HoldReason::Lost) => (Kind::Warn, self.lost()),
            (Some(link), _) => (self.events.kind(link), failsafe_in_words(link)),
        };
        let link = self.link.unwrap_or_default();
        if link.stopped() {
            return (kind, text + if link.at_rest == 1 { ", at rest" } else { "" });
        }
        let kind = match GuidanceStatus::from_byte(status) {
            GuidanceStatus::Unreachable => Kind::Warn,
            _ => kind,
        };
        (kind, format!("{text}; {}", guidance_in_words(status)))
    }

    /// Returns `None` while the robot waits for a target.
    pub fn target(&self) -> Option<&TargetSample> {
        let waits =
            |it: RosterHeader| matches!(it.reason(), HoldReason::Waiting | HoldReason::Lost);
        self.target.as_ref().filter(|_| !self.supervisor.is_some_and(waits))
    }

    pub fn following(&self) -> Option<&FollowingSample> {
        self.following.as_ref().filter(|following| following.state() != FollowState::Ended)
    }

    fn lost(&self) -> String {
        let ago_s = self.following().and_then(|it| it.heard_ago_s(self.now_s()));
        match ago_s {
            Some(ago_s) => format!("the robot lost its beacon, last seen {ago_s:.0} s ago"),
            None => "the robot has not seen its beacon yet".to_owned(),
        }
    }

    pub fn to_go_m(&self) -> Option<f64> {
        Some(self.pose?.pose().position.distance(self.target()?.target.position()))
    }

    /// Returns the remaining distance and target number in words.
    pub fn way_to_go(&self) -> Option<String> {
        let TargetSample { number, last, .. } = self.target()?;
        if let Some(following) = self.following() {
            let beacon = DVec2::new(following.x_m, following.y_m);
            let off_m = self.pose?.pose().position.distance(beacon);
            return Some(format!("follows {off_m:.1} m behind a beacon"));
        }
        Some(format!("{:.1} m to target {number} of {last}", self.to_go_m()?))
    }
}

pub fn drop_every_second<T>(items: &mut Vec<T>) {
    let (mut nth, half) = (0, items.len().div_ceil(2));
    items.retain(|_| {
        nth += 1;
        nth % 2 == 1
    });
    assert_eq!(items.len(), half);
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::{
        driver::Refusal,
        grid::{GridFrame, Part},
    };

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
    fn a_robot_that_waits_or_finds_no_way_is_a_warning_and_one_that_stands_or_is_lost_is_bad() {
        use common::samples::{Action, Cause, HoldReason};
        let mut state = RobotState::default();
        assert_eq!(state.doing(), (Kind::Warn, "the robot starts".to_owned()));
        let header =
            |reason: HoldReason| RosterHeader { reason: reason.into(), ..RosterHeader::default() };
        state.supervisor = Some(header(HoldReason::None));
        let link = |action: Action, cause: Cause| LinkSample {
            connected: 1,
            action: action.into(),
            cause: cause.into(),
            at_rest: u8::from(action == Action::Stop),
            ..LinkSample::default()
        };
        state.link = Some(link(Action::Go, Cause::None));
        state.guidance = Some(GuidanceSample {
            status: GuidanceStatus::Along.into(),
            ..GuidanceSample::default()
        });
        assert_eq!(state.doing(), (Kind::Good, "the robot goes; on its way".to_owned()));
        state.guidance = Some(GuidanceSample {
            status: GuidanceStatus::Unreachable.into(),
            ..GuidanceSample::default()
        });
        assert_eq!(state.doing().0, Kind::Warn);
        state.link = Some(link(Action::Stop, Cause::OperatorStop));
        let told = "the robot stands: stopped by an operator, at rest".to_owned();
        assert_eq!(state.doing(), (Kind::Bad, told));
        state.target = Some(TargetSample { number: 2, last: 3, ..TargetSample::default() });
        state.pose = Some(PoseSample { x_m: 1.25, ..PoseSample::default() });
        assert_eq!(state.way_to_go().as_deref(), Some("1.2 m to target 2 of 3"));
        state.supervisor = Some(header(HoldReason::Waiting));
        state.link = Some(link(Action::Stop, Cause::NotOrdered));
        assert_eq!(state.doing().0, Kind::Warn);
        assert_eq!((state.way_to_go(), state.targets().count()), (None, 0), "it has no target");
        let mut link = LinkSample { connected: 0, losses: 1, ..LinkSample::default() };
        state.link = Some(link);
        assert_eq!(state.doing(), (Kind::Bad, "the robot does not answer".to_owned()));
        let trouble = Refusal { remedy: "open it".to_owned(), ..Refusal::from("the port is shut") };
        state.apply(&Sample::Complaint(ComplaintSample::of("link", &trouble)));
        assert!(state.doing().1.ends_with("; link: the port is shut; open it"));
        link.stamp.stamp_ns = ComplaintSample::LASTS.as_nanos() as u64;
        state.link = Some(link);
        assert_eq!(state.complaint(), None, "the stage no longer repeats it");
    }

    #[test]
    fn a_mirror_that_is_not_heard_says_so_with_the_age() {
        let mut state = RobotState::default();
        let mut doing = |age_ns| {
            state.apply(&Sample::Mirror(MirrorSample { age_ns, ..MirrorSample::default() }));
            state.doing()
        };
        let told = "the robot starts (another machine, as of 0.2 s ago)".to_owned();
        assert_eq!(doing(200_000_000), (Kind::Warn, told));
        let told = "the robot starts (another machine, NOT HEARD for 7.0 s)".to_owned();
        assert_eq!(doing(7_000_000_000), (Kind::Bad, told));
    }

    #[test]
    fn a_part_of_a_map_that_does_not_follow_is_refused_until_a_whole_map_comes() {
        let mut state = RobotState::default();
        let frame = GridFrame { cells: 1, resolution_m: 0.1, centre: DVec2::ZERO };
        let mut grid = |part| {
            let header = GridHeader { part, ..GridHeader::default() };
            state.apply(&Sample::Grid(header, vec![1]))
        };
        let part = |version| Part::of(frame, frame.whole(), version);
        let parts = [part(1), Part::whole(frame, 1), part(2), part(4), Part::whole(frame, 4)];
        assert_eq!(parts.map(&mut grid), [false, true, true, false, true]);
    }
}
