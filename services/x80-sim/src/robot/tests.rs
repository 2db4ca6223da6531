use common::wire::{Decoder, Quantity, Request, Stream, Targets, counts_between};

use proptest::prelude::*;

use super::*;
use crate::testing::{ideal, near};

mod realism;

fn robot(text: &str) -> Robot {
    Robot::new(&ideal(text))
}

/// Returns the frame's meaning to the robot, and the answer.
fn hear(robot: &mut Robot, frame: &Frame<'_>) -> (Heard, Vec<u8>) {
    let mut replies = Vec::new();
    (robot.on_frame(frame, &mut replies), replies)
}

fn send_as(robot: &mut Robot, command: Command, addressing: Addressing) -> (Heard, Vec<u8>) {
    let mut bytes = Vec::new();
    command.encode(addressing, &mut bytes);
    let mut decoder = Decoder::default();
    decoder.push(&bytes);
    hear(robot, &decoder.next_frame().unwrap())
}

fn send(robot: &mut Robot, command: Command) -> (Heard, Vec<u8>) {
    send_as(robot, command, Addressing::Numbered)
}

fn forward(counts: i16, limit_ms: impl Into<Option<u16>>) -> Command {
    Command::velocity([Some(-counts), Some(counts)], limit_ms)
}

/// Returns this tick's frames: RIDs and DIDs, and the reports.
fn streamed(robot: &mut Robot) -> (Vec<(u8, u8)>, Vec<Report>) {
    let mut decoder = Decoder::default();
    decoder.push(&robot.stream());
    let (mut ids, mut reports) = (Vec::new(), Vec::new());
    while let Some(frame) = decoder.next_frame() {
        ids.push((frame.rid, frame.did));
        reports.push(Report::parse(&frame).unwrap());
    }
    (ids, reports)
}

fn dids(robot: &mut Robot) -> Vec<u8> {
    streamed(robot).0.into_iter().map(|(_, did)| did).collect()
}

fn motor(robot: &mut Robot) -> MotorSensors {
    let Some(Report::Motor(sensors)) = streamed(robot).1.pop() else { panic!() };
    sensors
}

fn standard(robot: &mut Robot) -> StandardSensors {
    let Report::Standard(sensors) = streamed(robot).1[0] else { panic!() };
    sensors
}

fn after(robot: &mut Robot, ticks: u32) -> GroundTruthTick {
    for _ in 0..ticks {
        robot.advance_to_next_tick();
    }
    robot.ground_truth()
}

#[test]
fn streams_run_from_boot_with_the_motor_frame_last_and_stop_start_and_count() {
    let mut robot = robot("");
    assert_eq!(streamed(&mut robot).0, [(0, 125), (0, 124), (0, 123)]);
    let request = |stream, request| Command::Stream { stream, request };
    send(&mut robot, request(Stream::All, Request::Stop));
    send(&mut robot, request(Stream::Standard, Request::Count(2)));
    assert_eq!([0; 3].map(|_| dids(&mut robot)), [vec![125], vec![125], vec![]]);
    send(&mut robot, request(Stream::Motor, Request::Start));
    assert_eq!(dids(&mut robot), [123]);
}

#[test]
fn everything_to_the_robot_but_an_acknowledgement_is_acknowledged() {
    let mut robot = robot("");
    let ack: &[u8] = &[0x5e, 0x02, 0, 0, 0xff, 1, 1, 0x48, 0x5e, 0x0d];
    assert_eq!(send(&mut robot, Command::System(SystemSignal::Ping)).1, ack);
    let none = send(&mut robot, Command::System(SystemSignal::Ack));
    assert_eq!(none, (Heard::Ack, Vec::new()));
    let unknown = Frame { rid: 8, sn: 0, did: 99, data: &[1] };
    assert_eq!(hear(&mut robot, &unknown), (Heard::Other, ack.to_vec()));
    // The robot ignores a frame that is addressed to a host.
    let reflected = Frame { rid: 0, sn: 0, did: 255, data: &[0] };
    assert_eq!(hear(&mut robot, &reflected), (Heard::Foreign, Vec::new()));
}

#[test]
fn the_multimedia_board_acknowledges_and_moves_nothing() {
    let mut robot = robot("");
    let mut velocity = Vec::new();
    forward(400, None).encode(Addressing::Numbered, &mut velocity);
    for (rid, heard, moves) in [(8, Heard::Other, false), (1, Heard::Motion, true)] {
        let frame = Frame { rid, sn: 0, did: velocity[4], data: &velocity[6..18] };
        let (was, acknowledgement) = hear(&mut robot, &frame);
        assert_eq!((was, acknowledgement.len()), (heard, 10));
        robot.advance_to(robot.time + 1.0);
        assert_eq!(robot.motors[1].turned > 0.0, moves);
    }
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
fn wheels_may_be_wired_the_other_way_round() {
    let mut robot = robot(
        "[robot]\nleft = { channel = 1, reversed = false }\nright = { channel = 0, reversed = true }\n[simulation.wheels]\nlag_s = 0",
    );
    send(&mut robot, Command::velocity([Some(-500), None], None));
    let ground_truth = after(&mut robot, 1);
    assert!(ground_truth.heading > 0.0 && ground_truth.omega > 0.0);
    assert_eq!((ground_truth.left_counts, ground_truth.right_counts), (0, 71));
}

#[test]
fn the_steering_takes_its_time_ends_at_its_stop_and_turns_no_standing_car() {
    let mut car = robot("robot.model = 'car'\nsimulation.wheels.lag_s = 0");
    // 120 degrees/s are 1200 counts/s, the limit of any request; 30 degrees are 300 counts.
    for (steering, ticks, counts) in [(5000, 1, 171), (5000, 14, 300), (-5000, 14, -300)] {
        send(&mut car, Command::velocity([Some(0), Some(steering)], None));
        let truth = after(&mut car, ticks);
        assert!((counts_between(0, truth.right_counts) - counts).abs() <= 1, "{truth:?}");
        assert_eq!((truth.x, truth.y, truth.heading), (0.0, 0.0, 0.0));
    }
}

#[test]
fn a_timed_command_ends_inside_the_period_and_not_where_time_is_ignored() {
    let moved = |text: &str| {
        let mut robot = robot(text);
        send(&mut robot, forward(700, 100));
        after(&mut robot, 2).right_counts
    };
    assert_eq!(moved("[simulation.wheels]\nlag_s = 0"), 70);
    assert_eq!(moved("[simulation]\nignores_time = true\n[simulation.wheels]\nlag_s = 0"), 200);
}

#[test]
fn a_silent_host_stops_the_motors_only_where_the_mission_says_so_and_the_truth_says_how_late() {
    // A speed loop of 60 ms falls from 250 mm/s to 10 mm/s, which counts as rest, in 3.2 time
    // constants.
    let coasting = 0.06 * 25_f64.ln();
    let stopping_time = |text: &str| {
        let mut robot = robot(text);
        for _ in 0..5 {
            send(&mut robot, forward(562, 250));
            robot.advance_to_next_tick();
        }
        after(&mut robot, 30).stopping_time_s
    };
    let obeyed = stopping_time("");
    near(obeyed - 0.25, coasting, 0.02);
    let own_limit = "simulation = { ignores_time = true, stops_when_silent_s = 0.2 }";
    let ignored = stopping_time(own_limit);
    near(ignored - 0.2, coasting, 0.02);
    assert!(stopping_time("simulation = { ignores_time = true }") > 4.0);
}

#[test]
fn enabling_and_a_speed_reach_their_channel() {
    let mut robot = robot("");
    // It boots suspended.
    assert!(!robot.motors[5].enabled);
    send(&mut robot, Command::Enable { on: true, channel: None });
    assert!(robot.motors[5].enabled);
    let other = Motion {
        quantity: Quantity::Velocity,
        targets: Targets::One { channel: 4, value: 100 },
        limit_ms: None,
    };
    send(&mut robot, Command::Motion(other));
    // Channel 4 drives no wheel.
    assert_eq!(after(&mut robot, 1).v, 0.0);
}

#[test]
fn a_line_of_truth_has_the_names_that_its_readers_know() {
    let line = serde_json::to_string(&robot("").ground_truth()).unwrap();
    let names: Vec<&str> = line.split('"').skip(1).step_by(2).collect();
    assert_eq!(
        names.join(" "),
        "tick time_s x y heading v omega clearance_m contacts left_counts right_counts sonar_cm stopping_time_s"
    );
}

#[test]
fn the_front_ranger_and_its_neighbours_fill_the_bytes_the_mission_says_and_hear_each_other() {
    let sonar = "[simulation.sonar]\nnoise_m = 0\nnoise_per_m = 0\n";
    let mut robot = robot(&format!(
        "[sonar]\nindex = 3\n{sonar}[[world.wall]]\npoints = [[1, -1], [1, 1]]\n[[world.drum]]\nat = [0, 1]\nradius_m = 0.5"
    ));
    // A wall is 1 - 0.1915 m ahead. The drum is 45 degrees off the left ranger, which hears its
    // flank or nothing. The right ranger meets only the wall's end.
    let [first, second, _, front, left, right] = standard(&mut robot).ultrasonic;
    assert_eq!([first, second, front, right], [255, 255, 81, 255]);
    assert_ne!(left, 255);
    assert_eq!(robot.ground_truth().sonar_cm, 81);
    // Only the left ranger, at 45 degrees, has an obstacle in its cone: a drum 1 m from the centre.
    let crosstalk = self::robot(&format!(
        "{sonar}crosstalk_share = 1\n[[world.drum]]\nat = [1, 1]\nradius_m = 0.414213562"
    ));
    assert_eq!(standard(&mut { crosstalk }).ultrasonic[..3], [81, 81, 255]);
}

#[test]
fn batteries_drain_as_the_mission_says() {
    let mut robot = robot("[simulation.battery]\nstart_v = 8\ndrain_v_per_min = 1");
    for want in [8.0, 7.0] {
        let volts = common::wire::volts(standard(&mut robot).board_battery, 9.0);
        near(volts, want, 0.01);
        after(&mut robot, 7 * 60);
    }
}

#[test]
fn a_shove_moves_the_robot_without_its_wheels_and_without_a_contact_and_slip_takes_their_way() {
    let shove = |rest: &str| format!("simulation.shove = [{{ until_s = 1, {rest} }}]\n");
    let wall = "world.wall = [{ points = [[-1, 0.6], [1, 0.6]] }]\n";
    let aside = shove("velocity_m_s = [0, 1], turn_deg_s = 90");
    let mut shoved = robot(&format!("{wall}{aside}"));
    let GroundTruthTick { x, y, heading, contacts, left_counts, .. } = after(&mut shoved, 20);
    assert!(x.abs() < 1e-9 && (0.3..0.6).contains(&y), "{x} {y}");
    assert!((0.1..1.5).contains(&heading), "{heading}");
    assert_eq!((contacts, left_counts), (0, 0));
    let went = |text: &str| {
        let mut slips = robot(text);
        send(&mut slips, forward(1000, None));
        after(&mut slips, 5).x
    };
    near(went(&shove("slip = 0.25")), 0.75 * went(""), 1e-3);
}

#[test]
fn a_thing_that_moves_into_the_robot_pushes_it_and_is_a_contact() {
    let mut robot = robot(
        "[[simulation.thing]]\nshape.drum = [{ at = [2, 0], radius_m = 0.3 }]\nmoves = [{ at_s = 0, by = [0, 0] }, { at_s = 2, by = [-2, 0] }]",
    );
    let ground_truth = after(&mut robot, 21);
    near(ground_truth.x, -0.49, 0.01);
    assert_eq!(ground_truth.contacts, 1);
    let back = 0.49 / (std::f64::consts::TAU * 0.085 / 1200.0);
    let counted = 32_768.0 - f64::from(ground_truth.left_counts);
    near(counted, back, 25.0);
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
            let (heard, replies) = hear(&mut robot, &frame);
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
    let mut next = Robot::restored(&ideal("simulation.realism = 'measured'"), &saved);
    assert_eq!(next.saved_state(), saved);
    let stands = next.ground_truth();
    assert!(stands.x > driving.x + 0.05, "it rolled on: {stands:?}");
    assert_eq!(stands.v, 0.0);
    let later = after(&mut next, 1);
    // It stands.
    assert_eq!((later.x, later.y), (stands.x, stands.y));
    assert!(later.time_s > driving.time_s && later.tick > driving.tick);
    // Restarted counts would show zero.
    let rolled = counts_between(driving.left_counts, later.left_counts);
    assert!((50..600).contains(&rolled), "{rolled} counts");
}

/// Drives a Kobuki for 20 ticks at these speeds, rad/s. Returns what it says of each.
fn kobuki(world: &str, wheels: [f64; 2]) -> Vec<common::json_wire::Report> {
    let mut robot = robot(&format!("robot.model = 'kobuki'\n{world}"));
    robot.on_order(&Order::Hello { rate_hz: 7.0 }, &mut Vec::new());
    let said = |_| {
        let drive = Order::Drive { wheels, twist: [0.0; 2], for_s: 0.5 };
        robot.on_order(&drive, &mut Vec::new());
        robot.advance_to_next_tick();
        common::json_wire::parse(&robot.stream()).unwrap()
    };
    (0..20).map(said).collect()
}

#[test]
fn a_robot_that_speaks_lines_of_json_says_that_its_wheels_are_held_before_a_wall_and_not_as_they_roll()
 {
    // 16 rad/s are 0.56 m/s.
    let said = kobuki("world.wall = [{ points = [[1, -2], [1, 2]] }]", [16.0; 2]);
    let held = |tick: usize| said[tick].held;
    // It rolls.
    assert!((1..8).all(|tick| held(tick) == Some([false; 2])));
    // It stands before the wall.
    assert_eq!(held(19), Some([true; 2]));
}

#[test]
fn a_bumper_feels_what_the_body_touches_on_its_side_and_a_cliff_sensor_where_there_is_no_floor() {
    let board = "world.box = [{ at = [0.5, 0], size_m = [0.2, 2], top_m = 0.1 }]";
    let post = "world.drum = [{ at = [0.4, 0.17], radius_m = 0.05 }]";
    let hole = "simulation.hole = [{ at = [0.4, 0], size_m = [0.4, 0.1] }]";
    for (world, speed, felt) in [
        (board, 8.0, "bumper-center"),
        (board, 0.0, ""),
        (post, 8.0, "bumper-left"),
        (hole, 2.0, "cliff-center"),
    ] {
        let touched = kobuki(world, [speed; 2]).swap_remove(13).touched.into_iter();
        let names: Vec<_> = touched.filter(|(_, feels)| *feels).map(|(name, _)| name).collect();
        assert_eq!(names.join(" "), felt, "{world}");
    }
}
