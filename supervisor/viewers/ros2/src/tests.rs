//! Messages below were serialised by rclpy of ROS 2 Kilted with Fast DDS, with zeros as padding.

use std::f64::consts::{FRAC_PI_2, PI};

use common::{
    grid::{Cell, CellState, GridFrame, Part},
    mission::Mission,
    samples::*,
};
use glam::{DAffine2, DVec2};
use robot_state::Sample;
use ros2::{
    cdr::Cdr,
    messages::{COVARIANCE, battery, scan, twist},
    msg::{Path as PathMessage, *},
};

use crate::{
    RVIZ,
    action::Server,
    asked,
    goals::{
        Status::{Aborted, Canceled, Succeeded},
        Uuid,
    },
    messages::{self, disc, lines},
    shown::Shown,
    topics::{Id, TABLE},
};

const PATH: &[u8] = b"\0\x01\0\0\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\x01\0\0\0\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\0\0\0\0\0\0\0\0\0\0\xf0?\0\0\0\0\0\0\0@\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?";
const BATTERY: &[u8] = b"\0\x01\0\0\x0c\0\0\0\0e\xcd\x1d\x0a\0\0\0base_link\0\0\0\0\0HA\0\0\xc0\x7f\0\0\xc0\x7f\0\0\xc0\x7f\0\0\xc0\x7f\0\0\xc0\x7f\0\0\xc0\x7f\0\0\0\x01\0\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\x01\0\0\0\0";
const SCAN: &[u8] = b"\0\x01\0\0\x0c\0\0\0\0e\xcd\x1d\x06\0\0\0laser\0\0\0\0\0\x80\xbf\0\0\x80?\0\0\x80?\0\0\0\0\0\0\0>\0\0\x80>\0\0\0A\x03\0\0\0\0\0\x80?\0\0\x80\x7f\0\0\0@\0\0\0\0";
const RANGE: &[u8] =
    b"\0\x01\0\0\x0c\0\0\0\0e\xcd\x1d\x06\0\0\0front\0\x01\0\0\0\0?\0\0\x80>\0\0\0@\0\0\xc0?\0\0\0\0";
const MAP: &[u8] = b"\0\x01\0\0\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\x0c\0\0\0\0e\xcd\x1d\0\0\0?\x02\0\0\0\x02\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0\xbf\0\0\0\0\0\0\0\xc0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\x04\0\0\0\xff\0cd";
const DIAGNOSTICS: &[u8] = b"\0\x01\0\0\x0c\0\0\0\0e\xcd\x1d\x01\0\0\0\0\0\0\0\x01\0\0\0\x01\0\0\0\x02\0\0\0a\0\0\0\x03\0\0\0bc\0\0\x04\0\0\0x80\0\x01\0\0\0\x02\0\0\0k\0\0\0\x02\0\0\0v\0";
const MARKERS: &[u8] = b"\0\x01\0\0\x02\0\0\0\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\x01\0\0\0\0\0\0\0\0\0\0\0\x03\0\0\0\x03\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\x06\0\0\0field\0\0\0\x07\0\0\0\x05\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\0\0\0\0\0\0\0@\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\0\0\0\0\0\0\xe0?\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x80>\0\0\0?\0\0@?\0\0\x80?\0\0\0\0\0\0\0\0\0\0\0\0\x02\0\0\0\0\0\0\0\0\0\xf0?\0\0\0\0\0\0\0@\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x08@\0\0\0\0\0\0\x10@\0\0\0\0\0\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\0\0\0\0\0";

const AT_NS: u64 = 12_500_000_000;

const FRAME: GridFrame = GridFrame { cells: 10, resolution_m: 0.1, centre: DVec2::ZERO };

fn mission(text: &str) -> Mission {
    Mission::parse(text, "m.toml").unwrap()
}

#[test]
fn what_is_written_is_what_rclpy_writes() {
    let header = |frame| Header::at(AT_NS, frame);
    let ranges = vec![1.0, f32::INFINITY, 2.0];
    let range = Range {
        header: header("front"),
        radiation_type: Range::INFRARED,
        field_of_view: 0.5,
        min_range: 0.25,
        max_range: 2.0,
        range: 1.5,
        variance: 0.0,
    };
    let info = MapMetaData {
        map_load_time: AT_NS.into(),
        resolution: 0.5,
        width: 2,
        height: 2,
        origin: [-1.0, -2.0, 0.0].into(),
    };
    let map = OccupancyGrid { header: header("map"), info, data: vec![-1, 0, 99, 100] };
    let status = DiagnosticStatus {
        level: DiagnosticStatus::WARN,
        name: "a".to_owned(),
        message: "bc".to_owned(),
        hardware_id: "x80".to_owned(),
        values: vec![KeyValue { key: "k".to_owned(), value: "v".to_owned() }],
    };
    let diagnostics = DiagnosticArray { header: header(""), status: vec![status] };
    let points = [DVec2::new(1.0, 2.0), DVec2::new(3.0, 4.0)];
    let mut drawn = lines(("field", 7), &points, 0.5, [0.25, 0.5, 0.75, 1.0]);
    drawn.pose = [1.0, 2.0, 0.0].into();
    for (message, written) in [
        (messages::path(header("map"), &[[1.0, 2.0, 0.0]]).encode(), PATH),
        (battery(header("base_link"), 12.5), BATTERY),
        (scan(header("laser"), [-1.0, 1.0], [0.25, 8.0], [0.0, 0.125], ranges), SCAN),
        (range.encode(), RANGE),
        (map.encode(), MAP),
        (diagnostics.encode(), DIAGNOSTICS),
        (messages::markers(&header("map"), vec![drawn]), MARKERS),
    ] {
        assert_eq!(message, written);
    }
}

fn pose_in(frame: &str) -> PoseStamped {
    Header::at(0, frame).with([1.0, 2.0, 0.5])
}

#[test]
fn a_goal_is_taken_in_the_frame_of_the_map_only_and_never_in_part() {
    let goal = |pose: &PoseStamped| asked::goal(&pose.clone().encode());
    let mut pose = pose_in("map");
    let taken = goal(&pose).unwrap();
    assert_eq!((taken.x_m, taken.y_m, taken.has_heading), (1.0, 2.0, 1));
    assert!((taken.heading_rad - 0.5).abs() < 1e-12);
    assert!(goal(&pose_in("odom")).unwrap_err().contains("give it in \"map\""));
    let whole = pose.clone().encode();
    for end in 0..whole.len() {
        assert!(asked::goal(&whole[..end]).is_err(), "{end} bytes");
    }
    pose.pose.position.x = f64::NAN;
    assert!(goal(&pose).unwrap_err().contains("metres"));
    (pose.pose.orientation.z, pose.pose.orientation.w) = (0.0, 0.0);
    assert!(goal(&pose).unwrap_err().contains("rotation"));
}

fn goal(id: u8, frame: &str) -> Vec<u8> {
    let mut request = NavigateToPoseSendGoalRequest::default();
    (request.goal_id.uuid, request.goal.pose) = ([id; 16], pose_in(frame));
    request.encode()
}

fn cancel(id: u8) -> Vec<u8> {
    let goal_info = GoalInfo { goal_id: UUID { uuid: [id; 16] }, stamp: 0.into() };
    CancelGoalRequest { goal_info }.encode()
}

fn sent(id: u8) -> (Uuid, TargetPoint) {
    let (id, point) = Server::read_goal(&goal(id, "map")).unwrap();
    (id, point.unwrap())
}

/// Returns the state of the goal `id`, its error code and its text.
fn told(goals: &Server, id: u8) -> (i8, u16, String) {
    let result = goals.result([id; 16]).unwrap();
    let NavigateToPoseGetResultResponse { status, result } = Cdr::decode(&result).unwrap();
    (status, result.error_code, result.error_msg)
}

fn state(goals: &Server, id: u8) -> Option<i8> {
    goals.result([id; 16]).map(|_| told(goals, id).0)
}

/// Returns a server with goal 1 to (1, 2), as target number 5.
fn with_a_goal() -> Server {
    let mut goals = Server::default();
    goals.target(&target(4));
    goals.accept(sent(1), goals.newest_target, 7);
    goals.target(&target(5));
    goals
}

fn target(number: u64) -> TargetSample {
    let target = TargetPoint::at(DVec2::new(1.0, 2.0));
    TargetSample { number, last: number, target, ..TargetSample::default() }
}

fn directive(reason: HoldReason) -> DirectiveSample {
    DirectiveSample { reason: reason.into(), ..DirectiveSample::default() }
}

fn arrival(target_number: u64) -> CommandSample {
    CommandSample { target_number, state: CommandState::Arrived.into(), ..CommandSample::default() }
}

#[test]
fn a_place_is_taken_with_the_deviations_of_its_covariance() {
    let mut covariance = [0.0; 36];
    (covariance[0], covariance[7], covariance[35]) = (0.25, 0.25, 0.0685);
    let place = |covariance| {
        let PoseStamped { header, pose } = pose_in("map");
        let pose = PoseWithCovariance { pose, covariance };
        asked::place(&PoseWithCovarianceStamped { header, pose }.encode()).unwrap()
    };
    let (at, [sigma_m, sigma_rad]) = place(covariance);
    assert_eq!((at.x_m, at.y_m, sigma_m), (1.0, 2.0, 0.5));
    assert!((at.heading_rad - 0.5).abs() < 1e-9 && (sigma_rad - 0.262).abs() < 1e-3);
    assert_eq!(place([0.0; COVARIANCE]).1, [0.05; 2]);
}

#[test]
fn a_twist_is_a_stick_in_shares_of_the_missions_speeds_and_one_that_is_no_number_is_refused() {
    let text = "controller = { speed_m_s = 0.4, turn_rad_s = 1.6 }\nstay = true";
    let mission = mission(text);
    let stick =
        |ahead, left| asked::stick(&twist([ahead, left]).encode(), &mission).map(<[f64; 2]>::from);
    assert_eq!(stick(0.2, 0.8), Ok([0.5, 0.5]));
    assert_eq!(stick(-7.0, -1.6), Ok([-1.0, -1.0]));
    assert!(stick(f64::NAN, 0.0).unwrap_err().contains("m/s"));
    assert!(asked::stick(&[0, 1, 0, 0, 1], &mission).is_err());
}

#[test]
fn a_goal_of_the_action_ends_with_its_own_target_or_when_the_robot_is_sent_elsewhere_or_waits() {
    type Said = fn(&mut Server);
    let waits: Said = |it| it.directive(&directive(HoldReason::Waiting));
    let arrives: Said = |it| it.command(&arrival(5));
    for (what, said, want) in [
        ("another target's arrival", &[(|it| it.command(&arrival(4))) as Said][..], None),
        ("its arrival", &[arrives], Some(Succeeded)),
        ("another target", &[|it| it.target(&target(6))], Some(Aborted)),
        ("a newer goal", &[|it| it.accept(sent(2), it.newest_target, 8)], Some(Aborted)),
        ("a wait, whose arrival may still be read", &[waits], None),
        ("a run that stays without it", &[waits, waits], Some(Aborted)),
        ("an arrival within a wait", &[waits, arrives, waits], Some(Succeeded)),
    ] {
        let mut goals = with_a_goal();
        said.iter().for_each(|said| said(&mut goals));
        assert_eq!(state(&goals, 1), want.map(|status| status as i8), "{what}");
        assert!([None, Some(0)].contains(&state(&goals, 2)), "{what}");
        assert_eq!(state(&goals, 9), Some(0), "an unknown goal has an unknown state");
    }
}

#[test]
fn a_goal_that_is_refused_has_nav2s_error_code_and_words_and_the_one_before_goes_on() {
    let (id, point) = Server::read_goal(&goal(2, "odom")).unwrap();
    let mut goals = with_a_goal();
    goals.refuse(id, &point.unwrap_err(), 8);
    let (status, code, text) = told(&goals, 2);
    assert_eq!((status, code), (Aborted as i8, NavigateToPoseResult::TF_ERROR));
    assert!(text.contains("give it in \"map\""), "{text}");
    goals.command(&arrival(5));
    assert_eq!(told(&goals, 1), (Succeeded as i8, 0, String::new()));
}

#[test]
fn a_goal_that_ends_says_why_by_the_recorded_result_of_its_target_to_a_later_bridge_too() {
    let waits = directive(HoldReason::Waiting);
    for (outcome, status, code, words) in [
        ("unreachable", Aborted, 208, "no path"),
        ("timed_out", Aborted, 9003, "did not arrive"),
        ("missed", Aborted, 9000, "gave up"),
        ("reached", Succeeded, 0, ""),
    ] {
        let mut goals = with_a_goal();
        goals.directive(&waits);
        goals.directive(&waits);
        goals.recorded(4, "unreachable");
        assert!(told(&goals, 1).2.contains("gave up"), "the record is another target's");
        goals.recorded(5, outcome);
        let (is, was, text) = told(&goals, 1);
        assert_eq!((is, was), (status as i8, code), "{outcome}");
        assert!(text.contains(words), "{text}");
        let stored = serde_json::to_string(&with_a_goal()).unwrap();
        let mut later: Server = serde_json::from_str(&stored).unwrap();
        assert_eq!(state(&later, 1), None, "it is not over");
        later.recorded(5, outcome);
        assert_eq!(state(&later, 1), Some(status as i8), "{outcome}");
    }
    let mut goals = with_a_goal();
    goals.accept(sent(2), goals.newest_target, 8);
    assert_eq!(told(&goals, 1).2, "a newer goal replaced it");
}

#[test]
fn goals_of_the_action_are_reached_one_after_the_other_in_a_run_that_stays() {
    let (waits, drives) = (directive(HoldReason::Waiting), directive(HoldReason::None));
    let mut goals = Server::default();
    for nth in 1..=20 {
        goals.accept(sent(nth), goals.newest_target, 7);
        goals.target(&target(nth.into()));
        // The supervisor publishes the target before it orders the robot to drive.
        for said in [waits, drives, drives, waits] {
            assert_eq!(state(&goals, nth), None);
            goals.directive(&said);
        }
        goals.command(&arrival(nth.into()));
        goals.directive(&waits);
        assert_eq!(state(&goals, nth), Some(Succeeded as i8), "goal {nth}");
    }
}

#[test]
fn a_goal_that_is_canceled_stays_canceled_although_the_robot_arrives() {
    for id in [0, 1] {
        let mut goals = with_a_goal();
        let (reply, stands) = goals.goals.cancel(&cancel(id)).unwrap();
        assert_eq!((reply[4], stands), (0, true), "it is taken");
        goals.command(&arrival(5));
        assert_eq!(state(&goals, 1), None, "the robot does not stand yet");
        goals.goals.end(Canceled);
        assert_eq!(state(&goals, 1), Some(Canceled as i8));
    }
    let (reply, stands) = with_a_goal().goals.cancel(&cancel(2)).unwrap();
    assert_eq!((reply[4], stands), (2, false), "it is unknown");
}

fn shown() -> Shown {
    Shown::new("x80".to_owned(), mission("target = [4, 0]"))
}

fn published(show: impl FnOnce(&mut dyn FnMut(Id, Vec<u8>))) -> Vec<(Id, Vec<u8>)> {
    let mut sent = Vec::new();
    show(&mut |id, payload| sent.push((id, payload)));
    sent
}

fn shows(shown: &mut Shown, sample: &Sample) -> Vec<(Id, Vec<u8>)> {
    published(|sink| shown.sample(sample, 0, sink))
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
    let (ids, sent): (Vec<_>, Vec<_>) =
        shows(&mut shown(), &Sample::Pose(pose)).into_iter().unzip();
    assert_eq!(ids, [Id::Tf, Id::Pose, Id::Odom, Id::Clock]);
    let odometry = Odometry::decode(&sent[2]).unwrap();
    assert_eq!([&*odometry.header.frame_id, &odometry.child_frame_id], ["odom", "base_link"]);
    let pose = odometry.pose.pose;
    let back = DVec2::from_angle(0.25).rotate(pose.at().into()) + DVec2::new(0.5, -0.5);
    assert!(back.distance(DVec2::new(1.0, 2.0)) < 1e-12);
    assert!((pose.orientation.heading().unwrap() - 0.5).abs() < 1e-12);
}

/// Returns parent and frame of a message's only transform, with its translation and rotation.
fn only_transform(payload: &[u8]) -> ([String; 2], ([f64; 2], f64)) {
    let [transform] = TFMessage::decode(payload).unwrap().transforms.try_into().unwrap();
    let Vector3 { x, y, .. } = transform.transform.translation;
    let turned = transform.transform.rotation.heading().unwrap();
    ([transform.header.frame_id, transform.child_frame_id], ([x, y], turned))
}

#[test]
fn where_another_node_has_the_robot_in_odom_the_map_alone_is_told_so_that_both_make_up_the_pose() {
    let sample = |x_m, heading_rad| {
        Sample::Pose(PoseSample { x_m, y_m: 2.0, heading_rad, ..PoseSample::default() })
    };
    let mut shown = shown();
    shown.others_odom = Some(None);
    let sent = shows(&mut shown, &sample(1.0, 0.75));
    assert!(sent.iter().all(|(id, _)| *id != Id::Tf), "the other node has not said it yet");
    for (x_m, heading) in [(1.0, 0.75), (-3.0, 2.5)] {
        let robot = DAffine2::from_angle_translation(-0.5, DVec2::new(7.0, -4.0));
        shown.others_odom = Some(Some(robot));
        let sent = shows(&mut shown, &sample(x_m, heading));
        let (names, (at, turned)) = only_transform(&sent[0].1);
        assert_eq!(names, ["map", "odom"]);
        let both = DAffine2::from_angle_translation(turned, at.into()) * robot;
        assert!(both.translation.distance(DVec2::new(x_m, 2.0)) < 1e-12);
        assert!((both.matrix2.x_axis.to_angle() - heading).abs() < 1e-12);
    }
}

/// Returns an odometry's pose covariance, speed and turn rate, and twist covariance.
fn read_odometry(payload: &[u8]) -> ([f64; 36], [f64; 2], [f64; 36]) {
    let Odometry { pose, twist, .. } = Odometry::decode(payload).unwrap();
    let Twist { linear, angular } = twist.twist;
    (pose.covariance, [linear.x, angular.z], twist.covariance)
}

#[test]
fn the_covariance_of_odometry_grows_with_the_way_and_is_large_on_what_no_wheel_measures() {
    let mut shown = shown();
    let mut drive = |tick: u64| {
        let mut pose = PoseSample { x_m: 0.01 * tick as f64, v_m_s: 0.1, ..PoseSample::default() };
        (pose.stamp.tick, pose.stamp.stamp_ns) = (tick, tick * 100_000_000);
        let sent = shows(&mut shown, &Sample::Pose(pose));
        read_odometry(&sent.iter().find(|(id, _)| *id == Id::Odom).unwrap().1)
    };
    let start = drive(0).0;
    assert_eq!((start[0], start[7], start[35]), (0.0, 0.0, 0.0));
    let (at_10_m, speeds, of_speeds) = (1..=1000).map(&mut drive).last().unwrap();
    assert_eq!(speeds, [0.1, 0.0]);
    // 1 % of the distance by the mean diameter, and slip of 1 mm per root metre of two wheels.
    assert!((at_10_m[0].sqrt() - 0.1).abs() < 0.001, "{at_10_m:?}");
    // Lateral: half the ratio's deviation times the distance squared, over the track.
    assert!(at_10_m[7].sqrt() > 0.5 && at_10_m[35].sqrt() > 0.1, "{at_10_m:?}");
    assert!((at_10_m[11] - at_10_m[31]).abs() < 1e-12 && at_10_m[11] > 0.0);
    for covariance in [at_10_m, of_speeds] {
        assert!([14, 21, 28].iter().all(|part| covariance[*part] == 1e6));
    }
    assert!(
        of_speeds[0] > 0.0 && of_speeds[0] < 1e-2 && of_speeds[35] > 0.0 && of_speeds[35] < 1.0
    );
}

#[test]
fn speeds_are_in_the_time_of_the_stamps_at_every_pace() {
    let mut shown = shown();
    let pose = PoseSample { v_m_s: 0.1, omega_rad_s: -0.2, ..PoseSample::default() };
    let [(speeds, fast), (_, slow)] = [4.0, 1.0].map(|pace| {
        shown.pace = pace;
        let sent = shows(&mut shown, &Sample::Pose(pose));
        let (_, speeds, of_speeds) = read_odometry(&sent[2].1);
        (speeds, of_speeds)
    });
    assert_eq!(speeds, [0.4, -0.8]);
    assert!((fast[0] / slow[0] - 16.0).abs() < 1e-9 && fast[14] == slow[14]);
}

#[test]
fn ranges_too_far_too_near_and_not_measured_are_those_of_rep_117() {
    let told = [4.01, 0.05, 1.0, f64::NAN].map(|range| messages::within([0.06, 4.0], range));
    assert_eq!(told[..3], [f64::INFINITY, f64::NEG_INFINITY, 1.0]);
    assert!(told[3].is_nan());
    // X80's sonars.
    let mut shown = shown();
    for (status, is) in [
        (RangeStatus::AtContact, Some(f32::NEG_INFINITY)),
        (RangeStatus::Nothing, Some(f32::INFINITY)),
        (RangeStatus::Measured, Some(1.5)),
        (RangeStatus::Absent, None),
    ] {
        let reading =
            RangeReading { range_m: 1.5, status: status.into(), ..RangeReading::default() };
        let ranges = Sample::Ranges(RangesHeader::default(), vec![reading]);
        let sent = shows(&mut shown, &ranges);
        assert_eq!(sent.first().map(|it| Range::decode(&it.1).unwrap().range), is);
    }
}

/// Returns a robot with a laser, and the header of its scans.
fn with_a_laser() -> (Shown, ScanHeader) {
    let mission = mission("target = [4, 0]\nrobot.model = 'turtlebot4'");
    let (row, laser) = mission.laser().unwrap();
    (Shown::new("tb4".to_owned(), mission), ScanHeader::of(row, &laser))
}

#[test]
fn a_scan_is_stamped_when_its_first_beam_was_measured_and_says_the_time_between_beams() {
    let (mut shown, header) = with_a_laser();
    let mut told = |pace, beam_ns| {
        shown.pace = pace;
        let sweep = Sweep { first_beam_ns: -90_000_000, beam_ns, first_beam: 0 };
        let scan = Sample::Scan(header.swept(sweep), vec![1.0; 360]);
        let sent = published(|sink| shown.sample(&scan, 1_000_000_000, sink));
        let scan = LaserScan::decode(&sent[0].1).unwrap();
        (scan.header.stamp.ns(), scan.time_increment)
    };
    assert_eq!(told(1.0, 250_000), (910_000_000, 0.00025));
    assert_eq!(told(2.0, 250_000), (955_000_000, 0.000_125));
    // A clockwise laser has its beams in another order, so the stamp is that of the middle.
    assert_eq!(told(1.0, -250_000), (955_000_000, 0.0));
}

#[test]
fn what_happens_is_logged_with_its_severity_and_clocks_are_mission_time() {
    let mut shown = shown();
    let mut pose = PoseSample::default();
    pose.stamp.stamp_ns = 2_500_000_000;
    let sent = shows(&mut shown, &Sample::Pose(pose));
    assert_eq!(sent[3], (Id::Clock, Clock { clock: 2_500_000_000.into() }.encode()));
    shows(&mut shown, &Sample::Stall(StallSample::default()));
    let sent = published(|sink| shown.tick(9, sink));
    let logs: Vec<_> = sent.iter().filter(|it| it.0 == Id::Rosout).collect();
    let log = Log::decode(&logs[0].1).unwrap();
    assert_eq!((log.stamp.ns(), log.level, &*log.name), (9, Log::ERROR, "stalls"));
    assert!(log.msg.contains("no progress"));
    assert_eq!(logs.len(), 1);
}

#[test]
fn the_frame_of_a_laser_is_where_it_is_mounted_and_its_beams_are_told_in_that_frame() {
    let (mut shown, header) = with_a_laser();
    let sent = published(|sink| shown.mounting(0, sink));
    let (names, (at, turned)) = only_transform(&sent[0].1);
    assert_eq!((names, at), (["base_link", "laser"].map(str::to_owned), [-0.04, 0.0]));
    assert!((turned - FRAC_PI_2).abs() < 1e-12);
    // The first of 360 beams points to the robot's right, which is behind the laser.
    assert!((header.first_rad + FRAC_PI_2).abs() < 1e-12);
    let sent = shows(&mut shown, &Sample::Scan(header, vec![1.0; 360]));
    assert!((LaserScan::decode(&sent[0].1).unwrap().angle_min + PI as f32).abs() < 1e-6);
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
        let shown = Shown::new("r".to_owned(), mission(&text));
        let named = shown.sensor_topics().map(|(id, sensor)| {
            let name = crate::endpoints::topic_name(crate::topics::spec(id).unwrap(), sensor);
            crate::node::full_name("r", &name)
        });
        assert!(named.eq(topics.iter().copied()), "{names:?}");
    }
}

#[test]
fn a_map_is_published_whole_and_then_by_what_changes_and_says_what_nobody_looked_at() {
    let mut cells = vec![CellState::Free as u8; 100];
    cells[..4].copy_from_slice(
        &[CellState::Scanned, CellState::Margin, CellState::Sensed, CellState::Perimeter]
            .map(|state| state as u8),
    );
    let mut shown = shown();
    let whole = GridHeader { part: Part::whole(FRAME, 1), ..GridHeader::default() };
    assert!(shows(&mut shown, &Sample::Grid(whole, cells)).is_empty());
    let [(Id::Map, map), (Id::Diagnostics, _)] = &published(|sink| shown.tick(0, sink))[..] else {
        panic!("no map");
    };
    let occupied = &map[map.len() - 100..];
    assert_eq!(occupied[..6], [0, 99, 100, 100, 255, 255]);
    let window = common::grid::Window { col: 3, row: 4, width: 2, height: 1 };
    let part = GridHeader { part: Part::of(FRAME, window, 2), ..GridHeader::default() };
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
    let frame = GridFrame { cells: 20, ..FRAME };
    let ahead = FieldCell { ex: 1.0, ..FieldCell::default() };
    let path = |cells: &[FieldCell]| {
        let mut shown = shown();
        let target_x_m = 0.5;
        let header =
            FieldHeader { part: Part::whole(frame, 1), target_x_m, ..FieldHeader::default() };
        let field = Sample::Field(header, cells.to_vec());
        let sent = shows(&mut shown, &field);
        PathMessage::decode(&sent[0].1).unwrap().poses.last().unwrap().pose.at()
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
    let mut header = GridHeader { part: Part::whole(FRAME, 1), ..GridHeader::default() };
    let mut published_of = |header: &GridHeader| {
        let sample = Sample::Grid(*header, vec![CellState::Free as u8; 100]);
        shows(&mut shown, &sample)
    };
    assert!(published_of(&header).is_empty(), "no robot without a laser has the topic");
    let mover = Mover { x_m: 3.0, vy_m_s: 0.5, radius_m: 0.25, doubt_m: 0.1, ..Mover::default() };
    header.movers[..2].copy_from_slice(&[mover, Mover { x_m: f32::NAN, ..mover }]);
    header.mover_count = 2;
    let disc = |namespace, across, alpha| {
        disc((namespace, 0), [3.0, 0.0, 0.0], across, [0.8, 0.1, 0.1, alpha])
    };
    let points = [DVec2::new(3.0, 0.0), DVec2::new(3.0, 0.5)];
    let way = lines(("in 1 s", 0), &points, 0.05, [0.8, 0.1, 0.1, 1.0]);
    let reach_m = mover.reach_m();
    let wanted = [disc("movers", 0.5, 0.6), disc("doubt", 2.0 * reach_m, 0.2), way];
    let markers = |wanted: &[_]| {
        vec![(Id::Movers, messages::markers(&Header::at(0, "map"), wanted.to_vec()))]
    };
    assert_eq!(published_of(&header), markers(&wanted));
    header.mover_count = 0;
    assert_eq!(published_of(&header), markers(&[]));
    assert!(published_of(&header).is_empty());
}

#[test]
fn the_configuration_of_rviz_names_topics_that_the_bridge_has() {
    let named = RVIZ.lines().filter_map(|line| line.trim().strip_prefix("Value: "));
    for name in named.clone() {
        assert!(TABLE.iter().any(|spec| spec.name.starts_with(name)), "{name}");
    }
    assert_eq!(named.count(), 9);
}
