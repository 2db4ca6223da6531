//! Missions in wall-clock time that something disturbs, in one process.

#![allow(clippy::unwrap_used)]

use std::{cell::RefCell, rc::Rc, time::Duration};

use common::{
    bus::{Bus, Reader},
    ground_truth::GroundTruthTick,
    mission::Mission,
    samples::{Cause, FaultKind, RequestAnswer, RequestKind, RequestSample},
    topics,
};
use mission_control::{outcome::Outcome, target_list::TargetOutcome};
use processes::stages;
use simulation::{Disturbance, Observer, Quality, Ran, Request, RobotFault, Scenario, Way, What};
use summary::Summary;

use Outcome::*;
use Request::*;
use RobotFault::*;
use What::*;

const SURE: &str = "sure_within_m = 9";

fn at(seconds: f64, what: What) -> Disturbance {
    Disturbance { at: Duration::from_secs_f64(seconds), what }
}

fn ask_at(seconds: f64, request: Request) -> Disturbance {
    at(seconds, Ask(request))
}

fn fault_at(seconds: f64, fault: impl Into<Option<RobotFault>>) -> Disturbance {
    at(seconds, Fault(fault.into()))
}

/// Runs a mission to a target 4 m ahead, with further keys.
fn ran(keys: &str, disturbances: &[Disturbance]) -> Ran {
    let text = format!("target = [4, 0]\ntimeout_s = 120\n{keys}");
    ran_text(&text, disturbances, &[])
}

/// Runs a mission file. At each wait for a target the operator makes the next request.
fn ran_text(text: &str, disturbances: &[Disturbance], while_waiting: &[Request]) -> Ran {
    ran_before(None, text, disturbances, while_waiting)
}

fn ran_before(
    observer: Option<Rc<RefCell<dyn Observer>>>,
    text: &str,
    disturbances: &[Disturbance],
    while_waiting: &[Request],
) -> Ran {
    let mission = Mission::parse(text, "disturbed.toml").unwrap();
    let (disturbances, while_waiting) = (disturbances.to_vec(), while_waiting.to_vec());
    let scenario = Scenario { disturbances, while_waiting, ..Scenario::calm(&mission) };
    let ran = scenario.run_before(observer);
    assert!(ran.broken.is_none(), "{:?}", ran.broken);
    ran
}

#[track_caller]
fn assert_outcome(ran: &Ran, outcome: Outcome) -> &Summary {
    let summary = ran.summary.as_ref().unwrap();
    assert_eq!(summary.outcome, outcome, "{summary:?}");
    summary
}

#[track_caller]
fn assert_reached(ran: &Ran) -> &Summary {
    assert_untouched(ran);
    assert_outcome(ran, Reached)
}

#[track_caller]
fn assert_untouched(ran: &Ran) {
    assert_eq!(ran.truth.last().unwrap().contacts, 0);
}

#[track_caller]
fn assert_stopped(ran: &Ran, cause: Cause) {
    assert!(ran.causes.iter().any(|(_, it)| *it == Some(cause)), "{:?}", ran.causes);
}

fn tick_after(ran: &Ran, time_s: f64) -> &GroundTruthTick {
    ran.truth.iter().find(|tick| tick.time_s > time_s).unwrap()
}

fn outcomes(ran: &Ran) -> Vec<TargetOutcome> {
    ran.finished.as_ref().unwrap().targets.iter().map(|target| target.outcome).collect()
}

#[test]
fn a_robot_whose_encoders_cannot_be_true_stands_and_its_mission_ends_with_the_reason() {
    for fault in [MotorRepeated, EncoderDead, EncoderReversed, CountsRandom] {
        let ran = ran("", &[fault_at(3.0, fault)]);
        let Summary { outcome, cause, .. } = ran.summary.unwrap();
        let found = (outcome, cause.as_deref());
        let reason = Some("odometry implausible for long");
        assert_eq!(found, (Aborted, reason), "{fault:?}");
        let moved_s = ran.moved.unwrap().as_secs_f64() - 3.0;
        assert!(moved_s < 1.5, "{fault:?}: told to move for {moved_s} s");
    }
}

#[test]
fn a_robot_stands_for_the_time_of_its_fault_and_then_goes_on() {
    for (fault, cause) in [
        (RangeInvalid, Cause::RangeSilent),
        (StreamsStop, Cause::FramesSilent),
        (Silence, Cause::RobotLost),
        (FramesSlow, Cause::FramesSlow),
    ] {
        let ran = ran(SURE, &[fault_at(3.0, fault), fault_at(8.0, None)]);
        let stood = ran.causes.iter().find(|(_, it)| *it == Some(cause));
        assert!(stood.is_some_and(|(at, _)| at.as_secs() < 8), "{cause:?}: {:?}", ran.causes);
        assert_outcome(&ran, Reached);
    }
}

#[test]
fn a_robot_whose_counts_jump_in_motion_stands_and_its_arrival_is_unsure() {
    let ran = ran("sure_within_m = 0.5", &[fault_at(4.0, CountsReset)]);
    assert_stopped(&ran, Cause::OdometryImplausible);
    assert_outcome(&ran, ReachedUnsure);
}

#[test]
fn a_robot_that_a_broken_planner_or_map_holds_comes_free_by_a_new_planner_or_a_reset_map() {
    for method in ["evidential", "paper"] {
        for (stage, fault) in [
            ("planner", FaultKind::Saddle),
            ("planner", FaultKind::CorruptField),
            ("mapper", FaultKind::HazardAroundRobot),
        ] {
            let keys = format!("method = '{method}'\n{SURE}");
            let ran = ran(&keys, &[at(3.0, Break(stage, fault))]);
            let summary = assert_reached(&ran);
            let resets = summary.resets > 0;
            assert_eq!(resets, stage == "mapper", "{method}, {fault:?}: {summary:?}");
            assert!(resets || summary.replans > 0, "{method}, {fault:?}: {summary:?}");
        }
    }
}

#[test]
fn a_robot_cut_off_for_good_resets_its_map_three_times_and_ends_unreachable() {
    let summary = ran(SURE, &[at(3.0, Break("mapper", FaultKind::CutOff))]).summary.unwrap();
    let found = (summary.outcome, summary.resets, summary.replans);
    assert_eq!(found, (Unreachable, 3, 0), "{summary:?}");
}

/// Kills each stage, or freezes it, one every two seconds.
fn each_stage(what: fn(&'static str) -> What) -> Vec<Disturbance> {
    let stages = stages::TABLE.iter().map(|stage| stage.name);
    stages.enumerate().map(|(nth, stage)| at(4.0 + 2.0 * nth as f64, what(stage))).collect()
}

#[test]
fn a_car_whose_stages_are_each_killed_or_frozen_arrives() {
    for what in [Kill, Freeze] {
        let keys = format!("robot.model = 'car'\ncontroller.speed_m_s = 0.2\n{SURE}");
        assert_reached(&ran(&keys, &each_stage(what)));
    }
}

#[test]
fn a_stopped_robot_whose_stages_are_each_killed_or_frozen_stands_until_it_is_resumed() {
    for what in [Kill, Freeze] {
        let mut disturbances = each_stage(what);
        disturbances.extend([ask_at(3.0, Stop), ask_at(20.0, Resume)]);
        let ran = ran(SURE, &disturbances);
        assert_stopped(&ran, Cause::OperatorStop);
        let [stopped, resumed] = [6.0, 19.0].map(|time_s| tick_after(&ran, time_s));
        assert_eq!((stopped.x, stopped.y), (resumed.x, resumed.y));
        let summary = assert_reached(&ran);
        // The poses go on, so that the wait is no stall.
        assert_eq!((summary.replans, summary.resets), (0, 0), "{summary:?}");
    }
}

#[test]
fn a_robot_that_is_sent_elsewhere_in_flight_goes_on_without_a_stop() {
    let ran = ran(SURE, &[ask_at(3.0, Goto([3.5, -1.0]))]);
    assert_reached(&ran);
    assert_eq!(outcomes(&ran), [TargetOutcome::Replaced, TargetOutcome::Reached]);
    let mut after = ran.truth.iter().filter(|tick| (3.0..5.5).contains(&tick.time_s));
    assert!(after.all(|tick| tick.v + tick.omega.abs() > 0.05));
}

#[test]
fn a_robot_that_stays_has_a_result_for_each_target_and_no_target_ends_it() {
    let text = format!(
        "target = [1, 0]\nstay = true\n{SURE}\ntimeout_s = 120\nperimeter.width_m = 8\n\
         world.wall = [{{ points = [[2.2, -0.4], [3, -0.4], [3, 0.4], [2.2, 0.4], [2.2, -0.4]] }}]"
    );
    let ran = ran_text(&text, &[], &[[1.0, -1.0], [2.6, 0.0], [0.5, 0.8]].map(Goto));
    use TargetOutcome::{Reached, Unreachable};
    assert_eq!(outcomes(&ran), [Reached, Reached, Unreachable, Reached]);
    assert_untouched(&ran);
    let idle = ran_text("stay = true\nperimeter.width_m = 8", &[], &[]).summary.unwrap();
    assert_eq!((idle.outcome, idle.targets.len()), (Waited, 0));
}

#[test]
fn a_hand_drives_a_robot_into_no_hazard_and_it_stands_when_the_hand_goes() {
    let wall = "target = [4, 0]\nstay = true\nperimeter.width_m = 9\n\
                world.wall = [{ points = [[3, -3], [3, 3]] }]";
    let ahead = Hand([1.0, 0.0]);
    // In one run the hand lets go before the wall, in the other it pushes on.
    for (pushes, waits, x_m) in [(5, 0, 1.0..2.2), (150, 30, 2.2..2.8)] {
        let pushes: Vec<_> =
            (0..pushes).map(|nth| ask_at(3.0 + 0.1 * f64::from(nth), ahead)).collect();
        let ran = ran_text(wall, &pushes, &vec![ahead; waits]);
        assert_untouched(&ran);
        let last = ran.truth.last().unwrap();
        assert!(last.v.abs() < 0.01 && x_m.contains(&last.x), "{last:?}");
    }
}

/// Returns the place of someone who walks 2.4 m at 0.3 m/s from 6 s on.
fn walker(time_s: f64) -> [f64; 2] {
    [1.0 + 0.3 * (time_s - 6.0).clamp(0.0, 8.0), -0.8]
}

#[test]
fn a_robot_follows_a_walker_past_a_drum_and_stands_while_the_beacon_is_silent() {
    let keys = "stay = true\nperimeter.width_m = 9\n\
                world.drum = [{ at = [1.8, 0], radius_m = 0.3 }]\n\
                [[simulation.thing]]\nshape.drum = [{ at = [1, -0.8], radius_m = 0.2 }]\n\
                moves = [{ at_s = 6, by = [0, 0] }, { at_s = 14, by = [2.4, 0] }]";
    // The beacon is silent from 9 to 13 s.
    let heard = (5..130).map(|nth| f64::from(nth) * 0.2).filter(|at| !(9.0..13.0).contains(at));
    let mut disturbances: Vec<_> = heard.map(|time_s| at(time_s, Beacon(walker(time_s)))).collect();
    disturbances.extend([ask_at(1.2, Follow), ask_at(26.0, EndFollow)]);
    let ran = ran(keys, &disturbances);
    assert_untouched(&ran);
    let [waits, follows] = [12.0, 25.0].map(|time_s| tick_after(&ran, time_s));
    assert!(waits.v.abs() < 0.01, "{waits:?}");
    let [x, y] = walker(25.0);
    let off_m = (follows.x - x).hypot(follows.y - y);
    assert!((0.75..1.6).contains(&off_m), "{off_m} m from the walker");
    let result = ran.finished.unwrap().targets.pop().unwrap();
    assert_eq!(result.outcome, TargetOutcome::Followed, "{result:?}");
    let followed = result.followed.unwrap();
    assert!(followed.lost == 1 && followed.way_m > 1.5, "{result:?}");
}

#[test]
fn a_robot_that_is_held_by_a_thing_that_no_sensor_notices_maps_it_and_goes_another_way() {
    let shape = "[{at=[2,0],size_m=[0.3,0.8],top_m=0.1,echo=0}]";
    for thing in [
        format!("world.box = {shape}"),
        format!("simulation.thing = [{{from_s=3,shape={{box={shape}}}}}]"),
    ] {
        let keys = format!("{SURE}\n{thing}\nsimulation.wheels = {{ contact_slip = 0 }}");
        let ran = ran(&keys, &[]);
        let summary = assert_outcome(&ran, Reached);
        assert!(summary.replans > 0, "{summary:?}");
    }
}

#[test]
fn a_bump_stops_the_robot_and_lets_it_go_on() {
    let keys = format!(
        "{SURE}\nrobot.model = 'kobuki'\nworld.box = [{{at=[2,0],size_m=[0.3,0.8],top_m=0.1}}]"
    );
    let ran = ran(&keys, &[]);
    assert_stopped(&ran, Cause::Felt);
    assert_outcome(&ran, Reached);
}

#[test]
fn an_arduino_that_falls_silent_stands_and_drives_on_when_it_answers_again() {
    let text = include_str!("../../../supervisor/guide/example-arduino/robot.toml");
    let deaf = Quality { lost: 1.0, ..Quality::default() };
    let disturbances = [(4.0, deaf), (8.0, Quality::default())]
        .map(|(time_s, quality)| at(time_s, Wire(Way::ToHost, quality)));
    let ran = ran_text(&format!("{SURE}\n{text}"), &disturbances, &[]);
    assert_stopped(&ran, Cause::RobotLost);
    assert_reached(&ran);
}

#[test]
fn no_mission_ends_before_a_robot_rests_that_ignores_velocity_0_and_obeys_disable() {
    let ran = ran(SURE, &[fault_at(3.0, IgnoresZero)]);
    let outcome = ran.summary.unwrap().outcome;
    assert!(matches!(outcome, Reached | WrongPlace), "{outcome:?}");
    // The simulation goes on for 6 s after the run.
    let end_s = ran.simulated.as_secs_f64() - 6.0;
    let end = ran.truth.iter().rfind(|truth| truth.time_s <= end_s).unwrap();
    assert!(end_s > 8.0 && end.v.abs() < 0.01, "{} m/s at {end_s} s", end.v);
}

#[test]
fn an_operators_stop_holds_to_the_resume_not_beyond_uses_up_no_mission_time_and_is_no_stall() {
    let ran = ran(
        SURE,
        &[
            ask_at(5.0, Stop),
            ask_at(125.0, Resume),
            // Asked before the resume, it does not stop the robot again.
            ask_at(126.0, LateStop),
        ],
    );
    let summary = assert_outcome(&ran, Reached);
    assert_eq!(summary.replans, 0, "{summary:?}");
    let stops = ran.causes.iter().filter(|(_, cause)| *cause == Some(Cause::OperatorStop));
    assert_eq!(stops.count(), 1, "{:?}", ran.causes);
    let held = ran.truth.iter().filter(|truth| (8.0..125.0).contains(&truth.time_s));
    let speeds: Vec<_> = held.map(|truth| truth.v.abs()).collect();
    assert!(speeds.len() > 100 && speeds.iter().all(|&speed| speed < 0.01));
}

#[test]
fn a_wire_that_doubles_every_datagram_starts_no_storm() {
    let doubled = Quality { doubled: 1.0, ..Quality::default() };
    let mut disturbances = vec![ask_at(4.0, Stop), ask_at(6.0, Resume)];
    disturbances.extend([Way::ToRobot, Way::ToHost].map(|way| at(2.0, Wire(way, doubled))));
    let events = ran("", &disturbances).events;
    assert!(events < 40_000, "{events} events");
}

#[test]
fn a_robot_whose_stop_is_lost_at_its_target_drives_back() {
    let mut farthest = 0.0_f64;
    for lost_s in [2.6, 2.8, 3.0, 3.2] {
        let wire = |lost| Wire(Way::ToRobot, Quality { lost, ..Quality::default() });
        let text = format!("target = [1.7, 0]\nsimulation.ignores_time = true\n{SURE}");
        let disturbances = [at(lost_s, wire(1.0)), at(lost_s + 1.2, wire(0.0))];
        let ran = ran_text(&text, &disturbances, &[]);
        assert_reached(&ran);
        let off_m = |x: f64| (x - 1.7).abs();
        assert!(off_m(ran.truth.last().unwrap().x) < 0.3, "{lost_s}");
        farthest = ran.truth.iter().map(|truth| truth.x - 1.7).fold(farthest, f64::max);
    }
    assert!(farthest > 0.4, "no robot rolled on: {farthest} m");
}

/// Answers to all requests other than to resume.
#[derive(Default)]
struct Orders {
    reader: Option<Reader<RequestSample>>,
    answers: Vec<RequestAnswer>,
}

impl Observer for Orders {
    fn on_bus(&mut self, bus: &Bus) {
        self.reader = bus.reader(&topics::ORDERS).ok();
    }

    fn observe(&mut self) {
        while let Some(order) = self.reader.as_mut().and_then(|it| it.next_sample().unwrap()) {
            if order.kind() != RequestKind::Resume {
                self.answers.push(order.answer());
            }
        }
    }
}

/// Returns the answers in a mission to a target 4 m ahead.
fn answers(keys: &str, asked: &[Disturbance]) -> Vec<RequestAnswer> {
    let text = format!("target = [4, 0]\ntimeout_s = 120\nperimeter.width_m = 9\n{keys}");
    let orders = Rc::new(RefCell::new(Orders::default()));
    ran_before(Some(orders.clone()), &text, asked, &[]);
    orders.take().answers
}

#[test]
fn a_robot_is_placed_only_at_rest_while_its_mission_waits() {
    use RequestAnswer::{Moves, Taken};
    let asked = [
        ask_at(2.5, Place),
        // It rolls for a moment after the stop.
        ask_at(3.0, Stop),
        ask_at(3.1, Place),
        ask_at(5.0, Place),
        ask_at(6.0, Resume),
        // At rest for want of readings, it drives on by itself.
        fault_at(7.5, RangeInvalid),
        ask_at(10.0, Place),
        fault_at(11.0, None),
    ];
    assert_eq!(answers("", &asked), [Moves, Taken, Moves, Taken, Moves]);
}

#[test]
fn zones_are_added_and_removed_where_the_robot_is_not() {
    use RequestAnswer::{NotInZone, Taken, ZoneHere};
    let (here, ahead) = ([0.0, 0.0], [2.0, 0.6]);
    let asked = [
        ask_at(1.0, AddZone(here)),
        ask_at(1.1, AddZone(ahead)),
        ask_at(1.2, RemoveZone(here)),
        ask_at(1.3, RemoveZone(ahead)),
        ask_at(1.4, RemoveZone(ahead)),
    ];
    assert_eq!(answers("", &asked), [ZoneHere, Taken, NotInZone, Taken, NotInZone]);
}

#[test]
fn hands_and_beacons_lead_only_a_robot_that_stays() {
    use RequestAnswer::{NotFollowing, NotStaying, Outside, Taken};
    let asked = [
        ask_at(1.0, Hand([1.0, 0.0])),
        ask_at(1.1, Goto([40.0, 0.0])),
        ask_at(1.2, Append([3.0, 0.0])),
        ask_at(1.3, Follow),
        ask_at(1.4, EndFollow),
    ];
    assert_eq!(answers("", &asked), [NotStaying, Outside, Taken, NotStaying, NotFollowing]);
    assert_eq!(answers("stay = true", &asked), [Taken, Outside, Taken, Taken, Taken]);
}
