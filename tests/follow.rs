//! Tests of a robot that follows a beacon or another robot.

use std::{
    process::{Child, Stdio},
    sync::atomic::{AtomicBool, AtomicUsize, Ordering},
    thread,
    time::Duration,
};

use common::{
    bus::Bus,
    ground_truth::GroundTruthTick,
    samples::{BeaconRefusal, BeaconSample, PoseSample, name},
    topics,
    waiter::Waiter,
};
use rustix::process::Signal;
use serde_json::Value;
use tempfile::TempDir;

use crate::support::{
    self, Run, assert_nothing_left, firsthand, operate, records, refused, replayed_in,
    signal_process,
};

/// Speed of the walker with the beacon, m/s.
const WALKS_M_S: f64 = 0.3;
/// Mission time at which the walk begins, seconds.
const WALKS_AT_S: f64 = 6.0;
/// Path between the drums of the obstacle course, and back on the other side of two of them.
const ROUND: [[f64; 2]; 9] = [
    [0.9, 0.0],
    [1.0, -0.7],
    [2.6, -0.7],
    [2.9, 0.3],
    [4.4, 0.3],
    [4.9, -0.6],
    [4.4, -1.6],
    [3.1, -1.7],
    [3.0, -0.6],
];

/// Returns the walker's times at the places of [`ROUND`], mission time in seconds.
fn times() -> Vec<f64> {
    let legs = ROUND.windows(2).scan(WALKS_AT_S, |at, leg| {
        *at += (leg[1][0] - leg[0][0]).hypot(leg[1][1] - leg[0][1]) / WALKS_M_S;
        Some(*at)
    });
    std::iter::once(WALKS_AT_S).chain(legs).collect()
}

fn place(at_s: f64) -> [f64; 2] {
    let times = times();
    let next = times.partition_point(|time| *time <= at_s);
    if next == 0 || next == ROUND.len() {
        return ROUND[next.saturating_sub(1)];
    }
    let share = (at_s - times[next - 1]) / (times[next] - times[next - 1]);
    [0, 1].map(|axis| ROUND[next - 1][axis] + share * (ROUND[next][axis] - ROUND[next - 1][axis]))
}

/// Writes the mission with the walker as an obstacle for the sensors.
fn mission() -> (TempDir, String) {
    let [[x, y], ..] = ROUND;
    let moves: Vec<_> = std::iter::zip(times(), ROUND)
        .map(|(at_s, at)| format!("{{ at_s = {at_s}, by = [{}, {}] }}", at[0] - x, at[1] - y))
        .collect();
    let course = support::printed(&["missions", "obstacle-course"]);
    let (head, rest) = course.split_once("target =").unwrap();
    let (_, rest) = rest.split_once('\n').unwrap();
    let text = format!(
        "{head}stay = true\n{rest}\n[[simulation.thing]]\nshape.drum = [{{ at = [{x}, {y}], radius_m = 0.2 }}]\nmoves = [{}]\n",
        moves.join(", ")
    );
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("follow.toml");
    std::fs::write(&file, text).unwrap();
    let file = file.to_str().unwrap().to_owned();
    (directory, file)
}

/// Publishes a sample per pose of `robot`, and one before the first, until `ends`.
fn publish(
    robot: &str,
    ends: &AtomicBool,
    mut sample: impl FnMut(&PoseSample) -> Option<BeaconSample>,
) {
    let bus = Bus::join(&support::domain(robot), "beacon").unwrap();
    let mut poses = bus.reader(&topics::POSE).unwrap();
    let mut samples = bus.writer(&topics::BEACON, 1).unwrap();
    let mut waiter = Waiter::default();
    waiter.on(bus.wakeup(&topics::POSE).unwrap());
    let mut next = Some(PoseSample::default());
    while !ends.load(Ordering::Relaxed) {
        while let Some(pose) = next.take().or_else(|| poses.next_sample().unwrap()) {
            if let Some(sample) = sample(&pose) {
                samples.publish(pose.stamp.tick, pose.stamp.time(), sample).unwrap();
            }
        }
        waiter.wait(Duration::from_millis(100)).unwrap();
    }
}

fn beacon(pose: &PoseSample, [x_m, y_m]: [f64; 2]) -> BeaconSample {
    BeaconSample {
        capture_ns: pose.stamp.stamp_ns,
        source: name("walker"),
        x_m,
        y_m,
        deviation_m: 0.02,
        ..BeaconSample::default()
    }
}

/// Guard that ends a source on drop, also when a test fails.
struct Ends<'a>(&'a AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Starts `firsthand goto --follow`, which ends on an interrupt.
fn follow(robot: &str, arguments: &[&str]) -> Child {
    let mut command = firsthand(&[&["goto", "--robot", robot, "--follow"], arguments].concat());
    command.stdout(Stdio::piped()).spawn().unwrap()
}

/// Returns the output of an interrupted `firsthand goto --follow`.
fn interrupt(follow: Child) -> String {
    signal_process(follow.id(), Signal::INT);
    let output = follow.wait_with_output().unwrap();
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}

const WAITS: &str = "waiting for a target";

const LOST: &str = "lost what it follows";

/// Follows the walker for the whole round in lockstep. Returns the ground truth to the end of the
/// walk, the summary, and the directory.
fn follows_round(robot: &str) -> (Vec<GroundTruthTick>, Value, TempDir) {
    let (_mission, file) = mission();
    let mut run = Run::at_own_speed(robot, &file, &["--seed", "3"]);
    run.wait_until("it waits", |status| status["order"] == WAITS);
    let over_s = times()[ROUND.len() - 1] + 5.0;
    let ends = AtomicBool::new(false);
    thread::scope(|scope| {
        let source = Ends(&ends);
        scope.spawn(|| {
            publish(robot, &ends, |pose| {
                let at_s = pose.stamp.seconds();
                (at_s < over_s).then(|| beacon(pose, place(at_s)))
            });
        });
        let command = follow(robot, &[]);
        run.wait_until("the walk is over", |status| {
            status["mission_time_s"].as_f64() >= Some(over_s)
        });
        drop(source);
        let said = interrupt(command);
        assert!(said.starts_with("followed ") && said.ends_with(", never lost\n"), "{said}");
    });
    run.signal(Signal::INT);
    let (code, summary, directory) = run.finish_in();
    assert_eq!((code, &summary["outcome"]), (Some(0), &"waited".into()), "{summary}");
    let lines = records(&directory.path().join("run/ground_truth.jsonl"));
    let ticks = lines.into_iter().filter_map(|line| serde_json::from_value(line).ok());
    let walk = ticks.filter(|tick: &GroundTruthTick| tick.time_s < over_s).collect();
    assert_nothing_left(robot);
    (walk, summary, directory)
}

#[test]
fn a_robot_follows_a_walker_round_the_obstacle_course_without_a_touch_and_repeats_and_replays_it() {
    let (walk, summary, directory) = follows_round("follow-round");
    assert_eq!(summary["collisions"], 0, "{summary}");
    for tick in &walk {
        let [x, y] = place(tick.time_s);
        let off_m = (tick.x - x).hypot(tick.y - y);
        assert!((0.75..1.6).contains(&off_m), "{off_m} m from the walker: {tick:?}");
    }
    let result = &summary["targets"][0];
    assert_eq!((&result["outcome"], &result["followed"]["lost"]), (&"followed".into(), &0.into()));
    assert!(result["followed"]["way_m"].as_f64() > Some(5.0), "{result}");
    replayed_in(&directory);
    // A waiting robot in lockstep sends frames until it is ordered. Only walks after equally many
    // frames are the same.
    let frames = |walk: &[GroundTruthTick]| walk.iter().filter(|tick| tick.tick == 0).count();
    let mut walks = vec![walk];
    let (walk, again) = loop {
        let (again, ..) = follows_round("follow-again");
        match walks.iter().find(|walk| frames(walk) == frames(&again)) {
            Some(walk) => break (walk, again),
            None => walks.push(again),
        }
    };
    let differs = std::iter::zip(walk, &again).find(|(one, other)| one != other);
    assert_eq!((differs, walk.len()), (None, again.len()), "another run has another way");
}

#[test]
fn a_robot_stands_and_says_so_while_its_beacon_is_silent_and_goes_on_when_it_is_heard() {
    let robot = "follow-lost";
    let follow_refused = |words: &[&'static str], code: &str| {
        refused(&[&["goto", "--robot", robot, "--follow"], words].concat(), code, &[]);
    };
    let moves = Run::under_way(robot, "open-room", &["--pace", "2"], 0.5);
    follow_refused(&[], "not-staying");
    drop(moves);
    let mut run = Run::start(robot, "open-room", &["--stay", "--pace", "2"]);
    run.wait_until_driving();
    follow_refused(&["--distance", "0.2"], "too-near");
    follow_refused(&["--distance", "nan"], "too-near");
    let (ends, silent, back) =
        (AtomicBool::new(false), AtomicBool::new(true), AtomicBool::new(false));
    thread::scope(|scope| {
        let source = Ends(&ends);
        scope.spawn(|| {
            publish(robot, &ends, |pose| {
                let place = if back.load(Ordering::Relaxed) { [-1.6, 0.0] } else { [2.6, 0.4] };
                (!silent.load(Ordering::Relaxed)).then(|| beacon(pose, place))
            });
        });
        let command = follow(robot, &[]);
        let status = run.wait_until("it has not heard the beacon yet", |status| {
            status["order"] == LOST && status["link"]["at_rest"] == true
        });
        assert!(status["following"]["seen_ago_s"].is_null(), "{status}");
        silent.store(false, Ordering::Relaxed);
        let x = |status: &Value| status["pose"]["x_m"].as_f64().unwrap();
        run.wait_until("it drives to the beacon", |status| {
            status["order"] == "driving" && x(status) > 0.5
        });
        silent.store(true, Ordering::Relaxed);
        let status = run.wait_until("it stands without the beacon", |status| {
            status["order"] == LOST && status["link"]["at_rest"] == true
        });
        let (stands, since) = (x(&status), status["mission_time_s"].as_f64().unwrap());
        // The status counts until its pose, which is older than the decision to stand.
        assert!(status["following"]["seen_ago_s"].as_f64() > Some(0.8), "{status}");
        let status = run.wait_until("it has stood for a while", |status| {
            status["mission_time_s"].as_f64() > Some(since + 3.0)
        });
        assert!((x(&status) - stands).abs() < 0.02 && status["order"] == LOST, "{status}");
        back.store(true, Ordering::Relaxed);
        silent.store(false, Ordering::Relaxed);
        run.wait_until("it drives back to the beacon", |status| x(status) < 0.0);
        run.kill_and_await_successor("planner", Signal::KILL);
        run.wait_until("it stands beside the beacon", |status| {
            x(status) < -0.4 && status["link"]["at_rest"] == true && status["order"] == "driving"
        });
        let said = interrupt(command);
        assert!(said.ends_with(", lost once\n"), "{said}");
        run.wait_until("it waits", |status| status["order"] == WAITS);
        drop(source);
    });
    run.signal(Signal::INT);
    let (code, summary, directory) = run.finish_in();
    assert_eq!(code, Some(0), "{summary}");
    assert_eq!(summary["targets"][0]["outcome"], "replaced", "{summary}");
    assert_eq!(summary["targets"][1]["outcome"], "followed", "{summary}");
    replayed_in(&directory);
    assert_nothing_left(robot);
}

#[test]
fn a_robot_follows_the_pose_of_another_robot_until_that_ends() {
    let (first, second) = ("follow-first", "follow-second");
    let mission = ["--stay", "--pace", "2"];
    let mut leads = Run::start(first, "open-room", &mission);
    let mut follows = Run::start(second, "open-room", &mission);
    leads.wait_until_driving();
    follows.wait_until_driving();
    // The first robot's mission frame is 1 m ahead of the second's, turned to its left.
    operate(first, &["goto", "1.2", "0"]);
    let command = follow(second, &[first, "--frame", "1", "0", "90", "--distance", "0.8"]);
    let off_m = |status: &Value| {
        let at = |key: &str| status["pose"][key].as_f64().unwrap_or(9.0);
        (at("x_m") - 1.0).hypot(at("y_m") - 1.2)
    };
    let status = follows.wait_until("it is beside the first robot", |status| {
        off_m(status) < 1.2 && status["order"] == "driving" && status["link"]["at_rest"] == true
    });
    assert!(off_m(&status) > 0.6, "{status}");
    leads.stop();
    follows.wait_until("it lost the first robot", |status| status["order"] == LOST);
    operate(second, &["goto", "0", "0"]);
    let output = command.wait_with_output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && said.ends_with(", lost once\n"), "{said}");
    refused(&["goto", "--robot", second, "--follow", second], "follows-itself", &[]);
    follows.wait_until_driving();
    follows.signal(Signal::INT);
    follows.finish();
    assert_nothing_left(second);
}

#[test]
fn hostile_samples_of_a_beacon_are_refused_with_the_reason_and_move_no_robot() {
    let robot = "follow-hostile";
    let mission = ["--stay", "--pace", "2"];
    let mut run = Run::start(robot, "open-room", &mission);
    run.wait_until_driving();
    type Change = fn(&mut BeaconSample);
    let changes: [(Change, BeaconRefusal); 5] = [
        (|it| it.x_m = f64::NAN, BeaconRefusal::NotFinite),
        (|it| it.capture_ns = u64::MAX, BeaconRefusal::Future),
        (|it| it.y_m = 1e9, BeaconRefusal::Outside),
        (|it| it.capture_ns = 0, BeaconRefusal::Late),
        (|it| it.deviation_m = 3.0, BeaconRefusal::Doubtful),
    ];
    let (ends, nth) = (AtomicBool::new(false), AtomicUsize::new(0));
    thread::scope(|scope| {
        let source = Ends(&ends);
        scope.spawn(|| {
            publish(robot, &ends, |pose| {
                let mut sample = beacon(pose, [2.0, 0.0]);
                changes[nth.load(Ordering::Relaxed)].0(&mut sample);
                Some(sample)
            });
        });
        let command = follow(robot, &[]);
        for (kind, (_, refusal)) in changes.iter().enumerate() {
            nth.store(kind, Ordering::Relaxed);
            let status = run.wait_until("the sample is refused", |status| {
                status["following"]["refusal"] == refusal.words()
            });
            assert_eq!((&status["order"], &status["following"]["used"]), (&LOST.into(), &0.into()));
        }
        interrupt(command);
        drop(source);
    });
    run.stop();
}
