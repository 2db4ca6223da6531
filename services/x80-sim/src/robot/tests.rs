//! Tests of the robot as a state machine.

use std::path::Path;

use common::mission::Realism;
use common::wire::{COUNT_CYCLE, Decoder, Quantity, Request, Stream, Targets, counts_between};

use proptest::prelude::*;

use super::*;

mod realism;

/// Returns a mission with ideal sensors and wheels, unless `text` names a realism.
fn mission(text: &str) -> Mission {
    let mut mission =
        Mission::parse(&format!("target = [3, 0]\n{text}"), Path::new("m.toml")).unwrap();
    if !text.contains("realism") {
        mission.simulation.realism = Realism::Laboratory;
    }
    mission
}

fn robot(text: &str) -> Robot {
    Robot::new(&mission(text))
}

/// Returns the command's meaning to the robot, and the answer.
fn send_as(robot: &mut Robot, command: Command, addressing: Addressing) -> (Heard, Vec<u8>) {
    let mut bytes = Vec::new();
    command.encode(addressing, &mut bytes);
    let mut decoder = Decoder::default();
    decoder.push(&bytes);
    let mut replies = Vec::new();
    let heard = robot.on_frame(&decoder.next_frame().unwrap(), &mut replies);
    (heard, replies)
}

fn send(robot: &mut Robot, command: Command) -> (Heard, Vec<u8>) {
    send_as(robot, command, Addressing::Numbered)
}

fn forward(counts: i16, limit_ms: impl Into<Option<u16>>) -> Command {
    Command::velocity([Some(-counts), Some(counts)], limit_ms)
}

/// Returns this tick's frames: RIDs and DIDs, and the reports.
fn streamed(robot: &mut Robot) -> (Vec<(u8, u8)>, Vec<Report>) {
    let mut bytes = Vec::new();
    robot.stream(&mut bytes);
    let mut decoder = Decoder::default();
    decoder.push(&bytes);
    let (mut ids, mut reports) = (Vec::new(), Vec::new());
    while let Some(frame) = decoder.next_frame() {
        ids.push((frame.rid, frame.did));
        reports.push(Report::parse(&frame).unwrap());
    }
    (ids, reports)
}

fn motor(robot: &mut Robot) -> MotorSensors {
    match streamed(robot).1.last() {
        Some(Report::Motor(sensors)) => *sensors,
        other => panic!("the last frame was {other:?}"),
    }
}

#[test]
fn all_three_streams_run_from_boot_and_the_motor_frame_comes_last() {
    let mut robot = robot("");
    assert_eq!(streamed(&mut robot).0, [(0, 125), (0, 124), (0, 123)]);
}

#[test]
fn streams_stop_start_and_count() {
    let mut robot = robot("");
    let request = |stream, request| Command::Stream { stream, request };
    send(&mut robot, request(Stream::All, Request::Stop));
    send(&mut robot, request(Stream::Standard, Request::Count(2)));
    let dids = |robot: &mut Robot| -> Vec<u8> {
        streamed(robot).0.into_iter().map(|(_, did)| did).collect()
    };
    assert_eq!(dids(&mut robot), [125]);
    assert_eq!(dids(&mut robot), [125]);
    assert!(dids(&mut robot).is_empty());
    send(&mut robot, request(Stream::Motor, Request::Start));
    assert_eq!(dids(&mut robot), [123]);
}

#[test]
fn everything_but_an_acknowledgement_is_acknowledged() {
    let mut robot = robot("");
    let ack: &[u8] = &[0x5e, 0x02, 0, 0, 0xff, 1, 1, 0x48, 0x5e, 0x0d];
    let commands = [
        Command::System(SystemSignal::Ping),
        forward(100, None),
        Command::Enable { on: false, channel: Some(3) },
    ];
    for command in commands {
        assert_eq!(send(&mut robot, command).1, ack, "{command:?}");
    }
    let (heard, replies) = send(&mut robot, Command::System(SystemSignal::Ack));
    assert_eq!((heard, replies.len()), (Heard::Ack, 0));
    let unknown = Frame { rid: 8, sn: 0, did: 99, data: &[1] };
    let mut replies = Vec::new();
    assert_eq!(robot.on_frame(&unknown, &mut replies), Heard::Other);
    assert_eq!(replies, ack);
}

#[test]
fn the_multimedia_board_acknowledges_and_moves_nothing() {
    let mut robot = robot("");
    let mut velocity = Vec::new();
    Command::velocity([Some(400), Some(400)], None).encode(Addressing::Numbered, &mut velocity);
    let frame = Frame { rid: 8, sn: 0, did: velocity[4], data: &velocity[6..18] };
    let mut replies = Vec::new();
    assert_eq!(robot.on_frame(&frame, &mut replies), Heard::Other);
    assert_eq!(replies.len(), 10, "an acknowledgement");
    robot.advance_to(1.0);
    assert_eq!(robot.motors[0].turned, 0.0);
    let frame = Frame { rid: 1, ..frame };
    assert_eq!(robot.on_frame(&frame, &mut replies), Heard::Motion);
    robot.advance_to(2.0);
    assert!(robot.motors[0].turned > 0.0);
}

#[test]
fn one_is_answered_in_the_form_one_is_addressed_in() {
    let mut robot = robot("");
    let ping = Command::System(SystemSignal::Ping);
    let (_, replies) = send_as(&mut robot, ping, Addressing::Lettered);
    assert_eq!(replies[2], 0xb8);
    assert_eq!(streamed(&mut robot).0[0].0, 0xb8);
    send(&mut robot, ping);
    assert_eq!(streamed(&mut robot).0[0].0, 0x00);
}

#[test]
fn frames_that_speak_to_a_host_are_none_of_its_business() {
    let mut robot = robot("");
    let mut replies = Vec::new();
    let reflected = Frame { rid: 0, sn: 0, did: 255, data: &[0] };
    assert_eq!(robot.on_frame(&reflected, &mut replies), Heard::Foreign);
    assert!(replies.is_empty());
}

#[test]
fn counts_come_from_real_motion_on_the_wired_channels_and_wrap() {
    let mut robot = robot("[simulation.wheels]\nlag_s = 0\n[perimeter]\nwidth_m = 100");
    send(&mut robot, forward(1000, None));
    for _ in 0..7 {
        robot.advance_to_next_tick();
    }
    // In one second the wheels turn 1000 counts of 2 pi 0.085 / 1200 m. Channel 0 is reversed and
    // wraps below 0.
    let sensors = motor(&mut robot);
    assert_eq!(sensors.encoders.map(|e| e.position), [32_768 - 1000, 1000]);
    assert_eq!(sensors.encoders.map(|e| e.velocity()), [-1000, 1000]);
    let ground_truth = robot.ground_truth();
    assert_eq!((ground_truth.left_counts, ground_truth.right_counts), (1000, 1000));
    assert!((ground_truth.x - 0.445_059).abs() < 1e-6, "{}", ground_truth.x);
    for _ in 0..7 * 32 {
        robot.advance_to_next_tick();
    }
    assert_eq!(robot.ground_truth().left_counts, 33_000 - 32_768);
}

#[test]
fn wheels_may_be_wired_the_other_way_round() {
    let mut robot = robot(
        "[robot]\nleft = { channel = 1, reversed = false }\nright = { channel = 0, reversed = true }\n[simulation.wheels]\nlag_s = 0",
    );
    send(&mut robot, Command::velocity([Some(-500), None], None));
    robot.advance_to_next_tick();
    let ground_truth = robot.ground_truth();
    assert!(ground_truth.heading > 0.0 && ground_truth.omega > 0.0);
    assert_eq!((ground_truth.left_counts, ground_truth.right_counts), (0, 71));
}

#[test]
fn a_timed_command_ends_inside_the_period_and_not_where_time_is_ignored() {
    let moved = |text: &str| {
        let mut robot = robot(text);
        send(&mut robot, forward(700, 100));
        robot.advance_to_next_tick();
        robot.advance_to_next_tick();
        robot.ground_truth().right_counts
    };
    assert_eq!(moved("[simulation.wheels]\nlag_s = 0"), 70);
    assert_eq!(moved("[simulation]\nignores_time = true\n[simulation.wheels]\nlag_s = 0"), 200);
}

#[test]
fn the_truth_says_how_long_a_wheel_turns_after_the_last_command() {
    // A speed loop of 60 ms falls from 250 mm/s to 10 mm/s, which counts as rest, in 3.2 time
    // constants.
    let coasting = 0.06 * 25_f64.ln();
    let stopping_time = |text: &str| {
        let mut robot = robot(text);
        for _ in 0..5 {
            send(&mut robot, forward(562, 250));
            robot.advance_to_next_tick();
        }
        for _ in 0..30 {
            robot.advance_to_next_tick();
        }
        robot.ground_truth().stopping_time_s
    };
    let obeyed = stopping_time("");
    assert!((obeyed - 0.25 - coasting).abs() < 0.02, "{obeyed}");
    let own_limit = "simulation = { ignores_time = true, stops_when_silent_s = 0.2 }";
    let ignored = stopping_time(own_limit);
    assert!((ignored - 0.2 - coasting).abs() < 0.02, "{ignored}");
    assert!(stopping_time("simulation = { ignores_time = true }") > 4.0);
}

#[test]
fn a_silent_host_stops_the_motors_only_where_the_mission_says_so() {
    let speed = |text: &str| {
        let mut robot = robot(text);
        send(&mut robot, forward(500, None));
        robot.advance_to(3.0);
        motor_speed(&robot)
    };
    assert!(speed("") > 499.0, "it keeps going");
    assert_eq!(speed("[simulation]\nstops_when_silent_s = 1.5"), 0.0);
}

fn motor_speed(robot: &Robot) -> f64 {
    robot.motors[1].speed
}

#[test]
fn enabling_and_a_speed_reach_their_channel() {
    let mut robot = robot("");
    assert!(!robot.motors[5].enabled, "it boots suspended");
    send(&mut robot, Command::Enable { on: true, channel: None });
    assert!(robot.motors[5].enabled);
    let other = Motion {
        quantity: Quantity::Velocity,
        targets: Targets::One { channel: 4, value: 100 },
        limit_ms: None,
    };
    send(&mut robot, Command::Motion(other));
    robot.advance_to_next_tick();
    assert_eq!(robot.ground_truth().v, 0.0, "channel 4 drives no wheel");
}

#[test]
fn the_truth_has_the_least_clearance_since_the_last_tick_and_counts_contacts() {
    let mut robot = robot("world.wall = [{ points = [[0.5, -1], [0.5, 1]] }]");
    assert!((robot.ground_truth().clearance_m - 0.31).abs() < 1e-12);
    send(&mut robot, forward(2000, None));
    robot.advance_to_next_tick();
    let first = robot.ground_truth();
    assert!(first.clearance_m < 0.31 && first.contacts == 0);
    for _ in 0..7 {
        robot.advance_to_next_tick();
    }
    let ground_truth = robot.ground_truth();
    assert_eq!(ground_truth.contacts, 1);
    assert!((0.0..1e-6).contains(&ground_truth.clearance_m), "{ground_truth:?}");
    assert_eq!(ground_truth.v, 0.0, "the wall holds it");
}

#[test]
fn a_line_of_truth_has_the_names_that_its_readers_know() {
    let line = serde_json::to_string(&robot("").ground_truth()).unwrap();
    let names: Vec<&str> = line.split('"').skip(1).step_by(2).collect();
    let known = "tick time_s x y heading v omega clearance_m contacts left_counts right_counts sonar_cm stopping_time_s";
    assert_eq!(names, known.split(' ').collect::<Vec<_>>());
}

#[test]
fn the_front_ranger_and_its_neighbours_fill_the_bytes_the_mission_says() {
    let mut robot = robot(
        "[sonar]\nindex = 3\n[simulation.sonar]\nnoise_m = 0\nnoise_per_m = 0\n[[world.wall]]\npoints = [[1, -1], [1, 1]]\n[[world.drum]]\nat = [0, 1]\nradius_m = 0.5",
    );
    let Some(Report::Standard(sensors)) = streamed(&mut robot).1.first().copied() else {
        panic!("no standard frame");
    };
    // A wall is 1 - 0.1915 m ahead. The drum is 45 degrees off the left ranger, which hears its
    // flank or nothing. The right ranger meets only the wall's end.
    assert_eq!(sensors.ultrasonic[3], 81);
    assert_eq!(sensors.ultrasonic[0], 255);
    assert_eq!(sensors.ultrasonic[1], 255);
    assert_eq!(sensors.ultrasonic[5], 255);
    assert_ne!(sensors.ultrasonic[4], 255);
    assert_eq!(robot.ground_truth().sonar_cm, 81);
}

#[test]
fn with_crosstalk_a_ranger_hears_its_neighbours_answer() {
    let sonar = "[simulation.sonar]\nnoise_m = 0\nnoise_per_m = 0\ncrosstalk_share = 1";
    // Only the left ranger, at 45 degrees, has an obstacle in its cone: a drum 1 m from the centre.
    let mut robot = robot(&format!("{sonar}\n[[world.drum]]\nat = [1, 1]\nradius_m = 0.414213562"));
    let Some(Report::Standard(sensors)) = streamed(&mut robot).1.first().copied() else {
        panic!("no standard frame");
    };
    assert_eq!(sensors.ultrasonic[..3], [81, 81, 255]);
}

#[test]
fn reading_the_frames_again_draws_nothing() {
    let mut robot = robot("world.wall = [{ points = [[1, -1], [1, 1]] }]");
    let (mut first, mut again) = (Vec::new(), Vec::new());
    robot.repeat(&mut first);
    robot.repeat(&mut again);
    assert_eq!(first, again);
    let mut streamed = Vec::new();
    robot.stream(&mut streamed);
    assert_eq!(first, streamed);
}

#[test]
fn batteries_drain_as_the_mission_says() {
    let mut robot = robot("[simulation.battery]\nstart_v = 8\ndrain_v_per_min = 1");
    let volts = |robot: &mut Robot| match streamed(robot).1.first() {
        Some(Report::Standard(sensors)) => common::wire::volts(sensors.board_battery, 9.0),
        other => panic!("{other:?}"),
    };
    assert!((volts(&mut robot) - 8.0).abs() < 0.01);
    for _ in 0..7 * 60 {
        robot.advance_to_next_tick();
    }
    assert!((volts(&mut robot) - 7.0).abs() < 0.01);
}

#[test]
fn a_thing_that_moves_into_the_robot_pushes_it_and_is_a_contact() {
    let mut robot = robot(
        "[[simulation.thing]]\nshape.drum = [{ at = [2, 0], radius_m = 0.3 }]\nmoves = [{ at_s = 0, by = [0, 0] }, { at_s = 2, by = [-2, 0] }]",
    );
    for _ in 0..21 {
        robot.advance_to_next_tick();
    }
    let ground_truth = robot.ground_truth();
    assert!((ground_truth.x + 0.49).abs() < 0.01, "{ground_truth:?}");
    assert_eq!(ground_truth.contacts, 1);
    let back = 0.49 / (std::f64::consts::TAU * 0.085 / 1200.0);
    let counted = 32_768.0 - f64::from(ground_truth.left_counts);
    assert!((counted - back).abs() < 25.0, "{counted} counts for {back}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn whatever_a_host_sends_the_robot_stays_out_of_walls_and_answers(
        frames in prop::collection::vec(
            (prop::sample::select(vec![3_u8, 4, 5, 6, 7, 26, 27, 30, 123, 124, 125, 127, 255, 9]),
             prop::collection::vec(any::<u8>(), 0..16)),
            1..40,
        ),
        measured in any::<bool>(),
    ) {
        let realism = if measured { "measured" } else { "laboratory" };
        let mut robot = robot(&format!(
            "[simulation]\nrealism = '{realism}'\n[[world.box]]\nat = [0.6, 0]\nsize_m = [0.2, 2]\n[[world.drum]]\nat = [-0.5, 0.3]\nradius_m = 0.2"
        ));
        for (did, data) in &frames {
            let frame = Frame { rid: 1, sn: 0, did: *did, data };
            let mut replies = Vec::new();
            let heard = robot.on_frame(&frame, &mut replies);
            prop_assert_eq!(replies.is_empty(), heard == Heard::Ack);
            let due = robot.next_tick_s();
            robot.advance_to_next_tick();
            prop_assert_eq!(robot.time, due);
            let ground_truth = robot.ground_truth();
            prop_assert!(ground_truth.clearance_m >= -1e-9, "{:?}", ground_truth);
            prop_assert!(ground_truth.x.is_finite() && ground_truth.y.is_finite() && ground_truth.heading.is_finite());
            prop_assert!(ground_truth.v.abs() <= 1.1, "{:?}", ground_truth);
            prop_assert!(ground_truth.sonar_cm >= 4);
            for report in streamed(&mut robot).1 {
                if let Report::Motor(sensors) = report {
                    prop_assert!(sensors.encoders.iter().all(|e| e.position < COUNT_CYCLE));
                }
            }
        }
    }
}

#[test]
fn a_robot_left_driving_comes_to_rest_and_its_next_process_goes_on_there_with_its_counts() {
    let mut first = robot("simulation.realism = 'measured'");
    for _ in 0..20 {
        send(&mut first, forward(800, 250));
        first.advance_to_next_tick();
    }
    let driving = first.ground_truth();
    assert!(driving.v > 0.2, "{driving:?}");
    first.come_to_rest(|_| ());
    let saved = first.saved_state();
    let mission = mission("simulation.realism = 'measured'");
    let mut next = Robot::restored(&mission, &saved);
    assert_eq!(next.saved_state(), saved);
    let stands = next.ground_truth();
    assert!(stands.x > driving.x + 0.05, "it rolled on: {stands:?}");
    assert_eq!(stands.v, 0.0);
    next.advance_to_next_tick();
    let later = next.ground_truth();
    assert_eq!((later.x, later.y), (stands.x, stands.y), "it stands");
    assert!(later.time_s > driving.time_s && later.tick > driving.tick);
    // Restarted counts would show zero.
    let rolled = counts_between(driving.left_counts, later.left_counts);
    assert!((50..600).contains(&rolled), "{rolled} counts");
}

#[test]
fn a_robot_that_speaks_lines_of_json_says_that_its_wheels_are_held_before_a_wall_and_not_as_they_roll()
 {
    use common::json_wire::{Report, parse};
    let wall = "robot.model = 'kobuki'\nworld.wall = [{ points = [[1, -2], [1, 2]] }]";
    let mut robot = robot(wall);
    robot.on_order(&Order::Hello { rate_hz: 7.0 }, &mut Vec::new());
    let mut held = Vec::new();
    for _ in 0..20 {
        // 16 rad/s are 0.56 m/s.
        let drive = Order::Drive { wheels: [16.0; 2], twist: [0.56, 0.0], for_s: 0.25 };
        robot.on_order(&drive, &mut Vec::new());
        robot.advance_to_next_tick();
        let mut line = Vec::new();
        robot.stream(&mut line);
        held.push(parse::<Report>(&line).unwrap().held);
    }
    assert_eq!(held[1..8], [Some([false; 2]); 7], "it rolls");
    assert_eq!(held[19], Some([true; 2]), "it stands before the wall");
}

#[test]
fn a_bumper_feels_what_the_body_touches_on_its_side_and_a_cliff_sensor_where_there_is_no_floor() {
    let felt = |world: &str, wheels: [f64; 2]| {
        let text = format!("target = [0, -5]\nrobot.model = 'kobuki'\n{world}");
        let mut robot = Robot::new(&Mission::parse(&text, Path::new("m.toml")).unwrap());
        let mut said = Vec::new();
        robot.on_order(&Order::Hello { rate_hz: 7.0 }, &mut said);
        for _ in 0..14 {
            let drive = Order::Drive { wheels, twist: [0.0; 2], for_s: 0.5 };
            robot.on_order(&drive, &mut said);
            robot.advance_to_next_tick();
        }
        said.clear();
        robot.stream(&mut said);
        let report: common::json_wire::Report = common::json_wire::parse(&said).unwrap();
        let names = report.touched.into_iter().filter(|(_, feels)| *feels).map(|(name, _)| name);
        names.collect::<Vec<_>>().join(" ")
    };
    let board = "world.box = [{ at = [0.5, 0], size_m = [0.2, 2], top_m = 0.1 }]";
    assert_eq!(felt(board, [8.0, 8.0]), "bumper-center");
    assert_eq!(felt(board, [0.0, 0.0]), "");
    let post = "world.drum = [{ at = [0.4, 0.17], radius_m = 0.05 }]";
    assert_eq!(felt(post, [8.0, 8.0]), "bumper-left");
    let hole = "simulation.hole = [{ at = [0.4, 0], size_m = [0.4, 0.1] }]";
    assert_eq!(felt(hole, [2.0, 2.0]), "cliff-center");
}
