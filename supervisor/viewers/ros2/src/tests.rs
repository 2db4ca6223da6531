//! The messages below were serialised by rclpy of ROS 2 Kilted with Fast DDS. The bytes that pad them are zeros here.

use std::{
    f64::consts::{FRAC_PI_2, PI},
    path::Path,
};

use common::{
    grid::{Cell, CellState, GridFrame, Part},
    mission::Mission,
    samples::{
        CommandSample, CommandState, DirectiveSample, FieldCell, FieldHeader, GridHeader,
        HoldReason, Mover, PoseSample, ScanHeader, TargetPoint, TargetSample,
    },
};
use glam::DVec2;
use robot_state::Sample;
use ros2::cdr::{Reader, Writer};

use crate::{
    RVIZ,
    action::Server,
    asked,
    goals::Status,
    messages::{self, Header, Level, Marker, Shape},
    shown::Shown,
    topics::{Id, TABLE},
};

const PATH: &str = "000100000c0000000065cd1d040000006d617000010000000c0000000065cd1d040000006d61700000000000000000000000f03f00000000000000400000000000000000000000000000000000000000000000000000000000000000000000000000f03f";
const BATTERY: &str = "000100000c0000000065cd1d0a000000626173655f6c696e6b000000000048410000c07f0000c07f0000c07f0000c07f0000c07f0000c07f00000001000000000000000001000000000000000100000000";
const SCAN: &str = "000100000c0000000065cd1d060000006c61736572000000000080bf0000803f0000803f000000000000003e0000803e00000041030000000000803f0000807f0000004000000000";
const RANGE: &str =
    "000100000c0000000065cd1d0600000066726f6e740001000000003f0000803e000000400000c03f00000000";
const MAP: &str = "000100000c0000000065cd1d040000006d6170000c0000000065cd1d0000003f020000000200000000000000000000000000f0bf00000000000000c00000000000000000000000000000000000000000000000000000000000000000000000000000f03f04000000ff006364";
const DIAGNOSTICS: &str = "000100000c0000000065cd1d0100000000000000010000000100000002000000610000000300000062630000040000007838300001000000020000006b000000020000007600";
const MARKERS: &str = "00010000020000000c0000000065cd1d040000006d6170000100000000000000000000000300000003000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000f03f0000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000100000000000000000000000000000001000000000000000100000000000000000000000000000001000000000000000100000000000000010000000000000000000000000000000c0000000065cd1d040000006d617000060000006669656c6400000007000000050000000000000000000000000000000000f03f00000000000000400000000000000000000000000000000000000000000000000000000000000000000000000000f03f000000000000e03f000000000000000000000000000000000000803e0000003f0000403f0000803f00000000000000000000000002000000000000000000f03f0000000000000040000000000000000000000000000008400000000000001040000000000000000000000000010000000000000000000000000000000100000000000000010000000000000000000000000000000100000000000000010000000000000001000000000000000000000000";

const AT: Header<'_> = Header(12_500_000_000, "map");

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn what_is_written_is_what_rclpy_writes() {
    let Header(ns, _) = AT;
    assert_eq!(hex(&messages::path(AT, &[[1.0, 2.0, 0.0]])), PATH);
    assert_eq!(hex(&messages::battery(Header(ns, "base_link"), 12.5)), BATTERY);
    let ranges = [1.0, f32::INFINITY, 2.0];
    let scan = messages::scan(Header(ns, "laser"), [-1.0, 1.0], [0.25, 8.0], [0.0, 0.125], &ranges);
    assert_eq!(hex(&scan), SCAN);
    assert_eq!(hex(&messages::range(Header(ns, "front"), false, 0.5, [0.25, 2.0], 1.5)), RANGE);
    let map = messages::map(AT, 0.5, [2, 2], [-1.0, -2.0], &[255, 0, 99, 100]);
    assert_eq!(hex(&map), MAP);
    let status = messages::Status {
        level: Level::Warn,
        name: "a".to_owned(),
        message: "bc".to_owned(),
        values: vec![("k", "v".to_owned())],
    };
    assert_eq!(hex(&messages::diagnostics(Header(ns, ""), "x80", &[status])), DIAGNOSTICS);
    let lines = Marker {
        namespace: "field",
        id: 7,
        shape: Shape::Lines,
        pose: [1.0, 2.0, 0.0],
        scale: [0.5, 0.0, 0.0],
        color: [0.25, 0.5, 0.75, 1.0],
        points: vec![[1.0, 2.0], [3.0, 4.0]],
    };
    assert_eq!(hex(&messages::markers(AT, &[lines])), MARKERS);
}

/// A goal at (1, 2), in `frame`.
fn goal(frame: &str) -> Vec<u8> {
    Writer::default().header(0, frame).pose([1.0, 2.0, 0.5]).take()
}

#[test]
fn a_goal_is_taken_in_the_frame_of_the_map_only_and_never_in_part() {
    let taken = asked::goal(&goal("map")).unwrap();
    assert_eq!((taken.x_m, taken.y_m, taken.has_heading), (1.0, 2.0, 1));
    assert!((taken.heading_rad - 0.5).abs() < 1e-12);
    assert!(asked::goal(&goal("odom")).unwrap_err().contains("give it in \"map\""));
    let whole = goal("map");
    for end in 0..whole.len() {
        assert!(asked::goal(&whole[..end]).is_err(), "{end} bytes");
    }
    let flat = Writer::default().header(0, "map").f64s(&[1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0]).take();
    assert!(asked::goal(&flat).unwrap_err().contains("rotation"));
    let nowhere = Writer::default().header(0, "map").pose([f64::NAN, 2.0, 0.0]).take();
    assert!(asked::goal(&nowhere).unwrap_err().contains("metres"));
}

/// A call of the action that names the goal `id`, with `rest` behind that.
fn call(id: u8, rest: &[u8]) -> Vec<u8> {
    Writer::default().raw(&[id; 16]).raw(rest).take()
}

/// The state of the goal `id` by its result; none while it is not over.
fn state(goals: &Server, id: u8) -> Option<u8> {
    let result = goals.result([id; 16])?;
    Some(Reader::new(&result).unwrap().u8().unwrap())
}

/// A server with the goal 1, to (1, 2), which is the target with the number 5.
fn with_a_goal() -> Server {
    let mut goals = Server::default();
    goals.target(&TargetSample { number: 4, ..TargetSample::default() });
    let sent = Server::read_goal(&call(1, &goal("map")[4..])).unwrap();
    goals.accept(sent, goals.newest_target, 7);
    goals.target(&target(5));
    goals
}

fn target(number: u64) -> TargetSample {
    let target = TargetPoint::at(DVec2::new(1.0, 2.0));
    TargetSample { number, last: number, target, ..TargetSample::default() }
}

fn arrival(target_number: u64) -> CommandSample {
    CommandSample { target_number, state: CommandState::Arrived.into(), ..CommandSample::default() }
}

#[test]
fn a_place_is_taken_with_the_deviations_of_its_covariance() {
    let mut covariance = [0.0; 36];
    (covariance[0], covariance[7], covariance[35]) = (0.25, 0.25, 0.0685);
    let message = Writer::default().header(0, "map").pose([1.0, 2.0, 0.5]).f64s(&covariance).take();
    let (place, [sigma_m, sigma_rad]) = asked::place(&message).unwrap();
    assert_eq!((place.x_m, place.y_m, sigma_m), (1.0, 2.0, 0.5));
    assert!((place.heading_rad - 0.5).abs() < 1e-9 && (sigma_rad - 0.262).abs() < 1e-3);
    let sure = Writer::default().header(0, "map").pose([1.0, 2.0, 0.5]).f64s(&[0.0; 36]).take();
    assert_eq!(asked::place(&sure).unwrap().1, [0.05; 2]);
}

#[test]
fn a_twist_is_a_stick_in_shares_of_the_missions_speeds_and_one_that_is_no_number_is_refused() {
    let text = "controller = { speed_m_s = 0.4, turn_rad_s = 1.6 }\nstay = true";
    let mission = Mission::parse(text, Path::new("m.toml")).unwrap();
    let stick = |ahead, left| {
        let twist = Writer::default().f64s(&[ahead, 9.0, 9.0, 9.0, 9.0, left]).take();
        asked::stick(&twist, &mission).map(<[f64; 2]>::from)
    };
    assert_eq!(stick(0.2, 0.8), Ok([0.5, 0.5]));
    assert_eq!(stick(-7.0, -1.6), Ok([-1.0, -1.0]));
    assert!(stick(f64::NAN, 0.0).unwrap_err().contains("m/s"));
    assert!(asked::stick(&[0, 1, 0, 0, 1], &mission).is_err());
}

#[test]
fn a_goal_of_the_action_is_reached_with_its_own_target_only() {
    let mut goals = with_a_goal();
    goals.command(&arrival(4));
    assert_eq!(state(&goals, 1), None);
    goals.command(&arrival(5));
    assert_eq!(state(&goals, 1), Some(Status::Succeeded as u8));
    assert_eq!(state(&goals, 9), Some(0), "an unknown goal has an unknown state");
}

#[test]
fn a_goal_of_the_action_ends_when_the_robot_is_sent_elsewhere() {
    let mut goals = with_a_goal();
    goals.target(&TargetSample { number: 6, ..TargetSample::default() });
    assert_eq!(state(&goals, 1), Some(Status::Aborted as u8));
    let mut goals = with_a_goal();
    let sent = Server::read_goal(&call(2, &goal("map")[4..])).unwrap();
    goals.accept(sent, goals.newest_target, 8);
    assert_eq!((state(&goals, 1), state(&goals, 2)), (Some(Status::Aborted as u8), None));
}

#[test]
fn a_goal_of_the_action_whose_target_is_given_up_ends_though_the_run_stays() {
    let waits =
        DirectiveSample { reason: HoldReason::Waiting.into(), ..DirectiveSample::default() };
    let mut goals = with_a_goal();
    goals.directive(&waits);
    assert_eq!(state(&goals, 1), None, "its arrival may still be read");
    goals.directive(&waits);
    assert_eq!(state(&goals, 1), Some(Status::Aborted as u8));
    let mut goals = with_a_goal();
    goals.directive(&waits);
    goals.command(&arrival(5));
    goals.directive(&waits);
    assert_eq!(state(&goals, 1), Some(Status::Succeeded as u8));
}

#[test]
fn goals_of_the_action_are_reached_one_after_the_other_in_a_run_that_stays() {
    let directive = |reason: HoldReason| DirectiveSample {
        reason: reason.into(),
        ..DirectiveSample::default()
    };
    let (waits, drives) = (directive(HoldReason::Waiting), directive(HoldReason::None));
    let mut goals = Server::default();
    for nth in 1..=20 {
        let sent = Server::read_goal(&call(nth, &goal("map")[4..])).unwrap();
        goals.accept(sent, goals.newest_target, 7);
        goals.target(&target(nth.into()));
        // The supervisor tells of the target before it orders the robot to drive.
        for said in [waits, drives, drives, waits] {
            assert_eq!(state(&goals, nth), None);
            goals.directive(&said);
        }
        goals.command(&arrival(nth.into()));
        goals.directive(&waits);
        assert_eq!(state(&goals, nth), Some(Status::Succeeded as u8), "goal {nth}");
    }
}

#[test]
fn a_goal_that_is_canceled_stays_canceled_although_the_robot_arrives() {
    let any_time = [0; 8];
    for id in [0, 1] {
        let mut goals = with_a_goal();
        let (reply, stands) = goals.goals.cancel(&call(id, &any_time)).unwrap();
        assert!(stands);
        assert_eq!(reply[4], 0, "it is taken");
        goals.command(&arrival(5));
        assert_eq!(state(&goals, 1), None, "the robot does not stand yet");
        goals.goals.end(Status::Canceled);
        assert_eq!(state(&goals, 1), Some(Status::Canceled as u8));
    }
    let mut goals = with_a_goal();
    let (reply, stands) = goals.goals.cancel(&call(2, &any_time)).unwrap();
    assert_eq!((reply[4], stands), (2, false), "it is unknown");
}

fn shown() -> Shown {
    Shown::new("x80".to_owned(), Mission::parse("target = [4, 0]", Path::new("m.toml")).unwrap())
}

/// The topics and payloads that `show` publishes.
fn published(show: impl FnOnce(&mut dyn FnMut(Id, Vec<u8>))) -> Vec<(Id, Vec<u8>)> {
    let mut sent = Vec::new();
    show(&mut |id, payload| sent.push((id, payload)));
    sent
}

#[test]
fn odometry_and_its_origin_make_up_the_pose() {
    let pose = PoseSample {
        x_m: 1.0,
        y_m: 2.0,
        heading_rad: 0.75,
        map_from_odom: [0.5, -0.5, 0.25],
        ..PoseSample::default()
    };
    let sent = published(|sink| shown().sample(&Sample::Pose(pose), 0, sink));
    assert_eq!(sent.iter().map(|(id, _)| *id).collect::<Vec<_>>(), [Id::Tf, Id::Pose, Id::Odom]);
    let mut reader = Reader::new(&sent[2].1).unwrap();
    reader.time().unwrap();
    assert_eq!((reader.text().unwrap(), reader.text().unwrap()), ("odom", "base_link"));
    let ([x, y], heading) = reader.pose().unwrap();
    let back = DVec2::from_angle(0.25).rotate(DVec2::new(x, y)) + DVec2::new(0.5, -0.5);
    assert!(back.distance(DVec2::new(1.0, 2.0)) < 1e-12);
    assert!((heading.unwrap() - 0.5).abs() < 1e-12);
}

#[test]
fn the_frame_of_a_laser_is_where_it_is_mounted_and_its_beams_are_told_in_that_frame() {
    let text = "target = [4, 0]\nrobot.model = 'turtlebot4'";
    let mission = Mission::parse(text, Path::new("m.toml")).unwrap();
    let (row, laser) = mission.laser().unwrap();
    let mut shown = Shown::new("tb4".to_owned(), mission);
    let sent = published(|sink| shown.mounting(0, sink));
    let mut reader = Reader::new(&sent[0].1).unwrap();
    assert_eq!(reader.u32().unwrap(), 1);
    reader.time().unwrap();
    assert_eq!((reader.text().unwrap(), reader.text().unwrap()), ("base_link", "laser"));
    let ([x, y], heading) = reader.pose().unwrap();
    assert!((x, y) == (-0.04, 0.0) && (heading.unwrap() - FRAC_PI_2).abs() < 1e-12);
    // The first of 360 beams looks to the right of the robot, which is behind the laser.
    let header = ScanHeader::of(row, &laser);
    assert!((header.first_rad + FRAC_PI_2).abs() < 1e-12);
    let sent = published(|sink| shown.sample(&Sample::Scan(header, vec![1.0; 360]), 0, sink));
    let mut reader = Reader::new(&sent[0].1).unwrap();
    reader.header().unwrap();
    assert!((reader.f32().unwrap() + PI as f32).abs() < 1e-6);
}

#[test]
fn the_scan_of_a_single_laser_is_the_topic_scan_and_those_of_several_have_the_names_of_their_rows()
{
    let row = |name: &str| {
        format!(
            "[[robot.sensor]]\nname = '{name}'\nkind = 'scan'\nforward_m = 0\nbearing_deg = 0\n"
        )
    };
    for (names, topics) in [
        (&["front"][..], &["/r/scan"][..]),
        (&["front-1", "back"], &["/r/scan/front_1", "/r/scan/back"]),
    ] {
        let rows: String = names.iter().map(|name| row(name)).collect();
        let text = format!("target = [4, 0]\nrobot.protocol = 'json'\n{rows}");
        let mission = Mission::parse(&text, Path::new("m.toml")).unwrap();
        let shown = Shown::new("r".to_owned(), mission);
        let named = shown.sensor_topics().map(|(id, sensor)| {
            crate::endpoints::topic_name("r", crate::topics::spec(id).unwrap(), sensor)
        });
        assert!(named.eq(topics.iter().copied()), "{names:?}");
    }
}

#[test]
fn a_map_is_published_whole_and_then_by_what_changes_and_says_what_nobody_looked_at() {
    let frame = GridFrame { cells: 10, resolution_m: 0.1, centre: DVec2::ZERO };
    let mut cells = vec![CellState::Free as u8; 100];
    cells[..4].copy_from_slice(
        &[CellState::Scanned, CellState::Margin, CellState::Sensed, CellState::Perimeter]
            .map(|state| state as u8),
    );
    let mut shown = shown();
    let whole = GridHeader { part: Part::whole(frame, 1), ..GridHeader::default() };
    assert!(published(|sink| shown.sample(&Sample::Grid(whole, cells), 0, sink)).is_empty());
    let [(Id::Map, map), (Id::Diagnostics, _)] = &published(|sink| shown.tick(0, sink))[..] else {
        panic!("no map");
    };
    let occupied = &map[map.len() - 100..];
    assert_eq!(occupied[..6], [0, 99, 100, 100, 255, 255]);
    let window = common::grid::Window { col: 3, row: 4, width: 2, height: 1 };
    let part = GridHeader { part: Part::of(frame, window, 2), ..GridHeader::default() };
    let scanned = Sample::Grid(part, vec![CellState::Scanned as u8; 2]);
    let [(Id::MapUpdates, update)] = &published(|sink| shown.sample(&scanned, 1, sink))[..] else {
        panic!("no update");
    };
    assert_eq!(update[update.len() - 2..], [0, 0]);
    // A whole map follows a second later, not before.
    assert!(published(|sink| shown.tick(1, sink)).is_empty());
    let later = published(|sink| shown.tick(1_000_000_000, sink));
    assert!(later.iter().any(|(id, _)| *id == Id::Map));
}

#[test]
fn a_path_leads_along_the_field_and_ends_where_there_is_no_direction() {
    let frame = GridFrame { cells: 20, resolution_m: 0.1, centre: DVec2::ZERO };
    let ahead = FieldCell { ex: 1.0, ..FieldCell::default() };
    let path = |cells: &[FieldCell]| {
        let mut shown = shown();
        let target_x_m = 0.5;
        let header =
            FieldHeader { part: Part::whole(frame, 1), target_x_m, ..FieldHeader::default() };
        let field = Sample::Field(header, cells.to_vec());
        let sent = published(|sink| shown.sample(&field, 0, sink));
        let mut reader = Reader::new(&sent[0].1).unwrap();
        reader.time().unwrap();
        reader.text().unwrap();
        let count = reader.u32().unwrap();
        let mut last = [0.0; 2];
        for _ in 0..count {
            reader.time().unwrap();
            reader.text().unwrap();
            last = reader.pose().unwrap().0;
        }
        last
    };
    let mut cells = vec![ahead; 400];
    assert!((path(&cells)[0] - 0.4).abs() < 0.06, "{:?}", path(&cells));
    for row in 0..20 {
        cells[frame.index(Cell { col: 12, row })] = FieldCell::default();
    }
    let ends = frame.centre_of(Cell { col: 12, row: 10 }).x;
    assert!((path(&cells)[0] - ends).abs() < 0.06, "{:?}", path(&cells));
    assert_eq!(path(&vec![FieldCell { ex: f32::NAN, ..ahead }; 400]), [0.0; 2]);
}

#[test]
fn what_moves_is_markers_of_its_disc_doubt_and_way_and_they_are_deleted_when_it_is_gone() {
    let mut shown = shown();
    let mut header = GridHeader {
        part: Part::whole(GridFrame { cells: 10, resolution_m: 0.1, centre: DVec2::ZERO }, 1),
        ..GridHeader::default()
    };
    let mut published_of = |header: &GridHeader| {
        let sample = Sample::Grid(*header, vec![CellState::Free as u8; 100]);
        published(|sink| shown.sample(&sample, 0, sink))
    };
    assert!(published_of(&header).is_empty(), "no robot without a laser has the topic");
    let mover = Mover { x_m: 3.0, vy_m_s: 0.5, radius_m: 0.25, doubt_m: 0.1, ..Mover::default() };
    header.movers[..2].copy_from_slice(&[mover, Mover { x_m: f32::NAN, ..mover }]);
    header.mover_count = 2;
    let disc = |namespace, width_m: f64, alpha| Marker {
        namespace,
        pose: [3.0, 0.0, 0.0],
        scale: [width_m, width_m, 0.01],
        color: [0.8, 0.1, 0.1, alpha],
        ..Marker::default()
    };
    let way = Marker {
        namespace: "in 1 s",
        shape: Shape::Lines,
        scale: [0.05, 0.0, 0.0],
        color: [0.8, 0.1, 0.1, 1.0],
        points: vec![[3.0, 0.0], [3.0, 0.5]],
        ..Marker::default()
    };
    let reach_m = mover.reach_m();
    let wanted = [disc("movers", 0.5, 0.6), disc("doubt", 2.0 * reach_m, 0.2), way];
    let markers =
        |wanted: &[Marker]| vec![(Id::Movers, messages::markers(Header(0, "map"), wanted))];
    assert_eq!(published_of(&header), markers(&wanted));
    header.mover_count = 0;
    assert_eq!(published_of(&header), markers(&[]));
    assert!(published_of(&header).is_empty());
}

#[test]
fn the_configuration_of_rviz_names_topics_that_the_bridge_has() {
    let named = RVIZ.lines().filter_map(|line| line.trim().strip_prefix("Value: "));
    let named: Vec<_> = named.collect();
    assert_eq!(named.len(), 9);
    let is_known = |name: &str| TABLE.iter().any(|spec| spec.name.starts_with(name));
    assert!(named.iter().all(|name| is_known(name)), "{named:?}");
}
