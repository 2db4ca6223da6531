mod car;

use super::*;
use common::{
    kinematics::Pose2,
    samples::{BaseResponseSample, Maneuver, TargetPoint},
};
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, FRAC_PI_3, FRAC_PI_4, PI};

fn mission(text: &str) -> Mission {
    Mission::parse(&format!("target = [3, 0]\n{text}"), "test.toml").unwrap()
}

/// Returns a controller with vd = 0.4, wd = 0.8, Rc = 0.5, target (3, 0), r = 0.1, W = 0.4.
fn controller(extra: &str) -> Controller {
    Controller::new(&mission(&format!(
        "method = 'paper'\narrival_tolerance_m = 0.1\n\
         robot = {{ wheel_radius_m = 0.1, track_m = 0.4 }}\n\
         [controller]\nspeed_m_s = 0.4\nturn_rad_s = 0.8\nslow_radius_m = 0.5\ndead_zone = 0.05\n{extra}"
    )))
}

impl Controller {
    fn at(&mut self, pose: Pose2, guidance: &GuidanceSample) -> CommandSample {
        let Pose2 { position, heading } = pose;
        let (x_m, y_m) = (position.x, position.y);
        self.command(&GuidanceSample { x_m, y_m, heading_rad: heading, ..*guidance })
    }
}

fn first(heading: f64) -> CommandSample {
    controller("").at(facing(heading), &ahead())
}

fn short(short_m: f64) -> Pose2 {
    Pose2 { position: DVec2::new(3.0 - short_m, 0.0), heading: 0.0 }
}

fn facing(heading: f64) -> Pose2 {
    Pose2 { position: DVec2::ZERO, heading }
}

fn ahead() -> GuidanceSample {
    GuidanceSample {
        ex: 1.0,
        speed_limit_m_s: f64::INFINITY,
        status: GuidanceStatus::Along.into(),
        maneuver: Maneuver::Follow.into(),
        target_number: 1,
        target: TargetPoint::at(DVec2::new(3.0, 0.0)),
        ..GuidanceSample::default()
    }
}

fn close(got: f64, want: f64) {
    assert!((got - want).abs() < 1e-12, "got {got}, want {want}");
}

#[test]
fn equation_14_by_hand() {
    // Facing 45 degrees, guidance along x lies 45 degrees to the right.
    let alignment = Alignment::of(facing(FRAC_PI_4).axis(), DVec2::X);
    close(alignment.cosine, FRAC_1_SQRT_2);
    close(alignment.sine, -FRAC_1_SQRT_2);
}

#[test]
fn equation_15_by_hand() {
    // Ahead it is proportional to the sine, behind full towards the guidance.
    for (heading, omega) in [(-FRAC_PI_3, 0.8 * 3_f64.sqrt() / 2.0), (-2.0, 0.8), (2.0, -0.8)] {
        close(first(heading).omega_rad_s, omega);
    }
    // At the antipode it turns left first, and then keeps its side.
    let mut controller = controller("");
    for (heading, omega) in [(PI - 0.01, 0.8), (2.0, -0.8), (-PI + 0.01, -0.8)] {
        close(controller.at(facing(heading), &ahead()).omega_rad_s, omega);
    }
}

#[test]
fn equations_16_and_17_by_hand() {
    // vc is vd aligned, 1 - sin 60 / 2 of it 60 degrees off, and 0 antipodal.
    let off = 0.4 * (1.0 - 3_f64.sqrt() / 4.0);
    for (heading, v) in [(0.0, 0.4), (FRAC_PI_3, off), (PI, 0.0)] {
        close(first(heading).v_m_s, v);
    }
    // Its cases meet.
    let [ahead_m_s, behind_m_s] = [-1e-9, 1e-9].map(|aside| first(FRAC_PI_2 + aside).v_m_s);
    assert!((ahead_m_s - behind_m_s).abs() < 1e-8 && (ahead_m_s - 0.2).abs() < 1e-8);
    // At 0.25 m with Rc = 0.5, vc is half of the aligned speed.
    let pose = Pose2 { position: DVec2::new(2.75, 0.0), heading: FRAC_PI_3 };
    close(controller("").at(pose, &ahead()).v_m_s, off / 2.0);
    // Without modulation the speed is constant up to Rc.
    close(controller("modulated = false").at(facing(PI), &ahead()).v_m_s, 0.4);
    // vc = 0.4 and wc = 0 turn both wheels at 4 rad/s.
    let command = first(0.0);
    close(command.left_rad_s, 4.0);
    close(command.right_rad_s, 4.0);
}

fn evidential() -> Controller {
    Controller::new(&mission(
        "robot = { wheel_radius_m = 0.1, track_m = 0.4 }\n\
         controller = { speed_m_s = 0.4, turn_rad_s = 0.8, look_rad_s = 1.4, slow_radius_m = 0.5 }",
    ))
}

fn limited(speed_limit_m_s: f64) -> GuidanceSample {
    GuidanceSample { speed_limit_m_s, ..ahead() }
}

fn told(maneuver: Maneuver) -> GuidanceSample {
    GuidanceSample { maneuver: maneuver.into(), ..ahead() }
}

#[test]
fn an_evidential_robot_goes_no_faster_than_its_guidance_allows_however_well_it_faces_its_way() {
    for (limit, v) in
        [(0.0, 0.0), (f64::NAN, 0.0), (0.01, 0.0), (0.039, 0.0), (0.04, 0.04), (0.1, 0.1)]
    {
        let command = evidential().at(facing(0.0), &limited(limit));
        close(command.v_m_s, v);
        assert_eq!(command.state() == CommandState::Halt, v == 0.0, "{limit}");
        let wheels = [command.left_rad_s, command.right_rad_s];
        assert_eq!(wheels == [0.0; 2], v == 0.0, "{limit}");
        let turning = evidential().at(facing(0.4), &limited(limit));
        assert!(turning.omega_rad_s < 0.0 && (v > 0.0 || turning.v_m_s == 0.0), "{limit}");
    }
}

#[test]
fn without_guidance_the_robot_stands() {
    let nan = GuidanceSample { ex: f64::NAN, ..ahead() };
    for guidance in [GuidanceSample::default(), told(Maneuver::Stand), nan] {
        for mut controller in [controller(""), evidential()] {
            let command = controller.at(facing(0.4), &guidance);
            assert_eq!(command.state(), CommandState::Halt);
            close(command.v_m_s, 0.0);
            close(command.left_rad_s, 0.0);
        }
    }
}

#[test]
fn an_arrival_holds_for_its_target_alone_until_the_robot_has_rolled_on() {
    let mut controller = controller("");
    let (arrived, driving) = (CommandState::Arrived, CommandState::Driving);
    for (short_m, state) in
        [(0.05, arrived), (0.19, arrived), (0.21, driving), (0.11, driving), (0.09, arrived)]
    {
        let command = controller.at(short(short_m), &ahead());
        assert_eq!((command.state(), command.target_number), (state, 1), "{short_m}");
        assert_eq!(command.v_m_s > 0.0, state == driving);
    }
    let target = TargetPoint::at(DVec2::new(9.0, 0.0));
    let next = GuidanceSample { target_number: 2, target, ..ahead() };
    let command = controller.at(short(0.05), &next);
    assert_eq!((command.state(), command.target_number), (CommandState::Driving, 2));
    close(command.distance_m, 6.05);
    let none = GuidanceSample { target_number: 0, ..ahead() };
    assert_eq!(controller.at(short(0.05), &none).state(), CommandState::Halt);
}

#[test]
fn a_robot_has_arrived_once_it_is_there_and_faces_the_heading_and_follows_the_planner_until_then() {
    let mut guidance = told(Maneuver::Turn);
    (guidance.target.heading_rad, guidance.target.has_heading) = (2.0 + 2.0 * PI, 1);
    for (short_m, heading, state) in [
        (0.05, 2.0, CommandState::Arrived),
        (0.05, 2.0 + 4_f64.to_radians(), CommandState::Arrived),
        (0.05, 2.0 - 6_f64.to_radians(), CommandState::Driving),
        (0.3, 2.0, CommandState::Driving),
    ] {
        let pose = Pose2 { heading, ..short(short_m) };
        assert_eq!(controller("").at(pose, &guidance).state(), state, "{short_m} {heading}");
    }
    let mut controller = controller("");
    let slips = |short_m| Pose2 { heading: 2.0, ..short(short_m) };
    controller.at(short(0.05), &guidance);
    assert_eq!(controller.at(slips(0.15), &guidance).state(), CommandState::Arrived);
    assert_eq!(controller.at(slips(0.25), &guidance).state(), CommandState::Driving);
    let stand = GuidanceSample { maneuver: Maneuver::Stand.into(), ..guidance };
    assert_eq!(controller.at(short(0.05), &stand).state(), CommandState::Halt);
}

#[test]
fn a_robot_has_arrived_beside_a_target_that_is_not_free_if_it_is_within_half_a_metre() {
    let beside = GuidanceSample { status: GuidanceStatus::AtTarget.into(), ..ahead() };
    for (short_m, has_arrived) in [(0.45, true), (0.55, false)] {
        let command = controller("").at(short(short_m), &beside);
        assert_eq!(command.state() == CommandState::Arrived, has_arrived, "{short_m}");
    }
}

#[test]
fn a_controller_goes_by_the_response_that_the_link_found_as_if_it_were_stated() {
    let mission = mission("method = 'evidential'");
    let mut told = Controller::new(&mission);
    let sample =
        BaseResponseSample { dead_time_s: 0.5, acceleration_m_s2: 0.3, ..Default::default() };
    let mut knows = Controller::new(&mission.with_response(0.5, 0.3).unwrap());
    let mut guidance = ahead();
    for tick in 0..40 {
        (guidance.pose_ns, guidance.x_m) = (tick * 100_000_000, 2.4 + 0.01 * tick as f64);
        guidance.heading_rad = 0.3 - 0.01 * tick as f64;
        let found = if tick == 0 { sample.into() } else { FoundResponse::default() };
        let answer = told.answer(&guidance, &found, MissionTime::default());
        assert_eq!(answer.sample, knows.command(&guidance), "{tick}");
    }
    assert!(told.lead.is_some());
    let hostile = BaseResponseSample { dead_time_s: f64::NAN, ..sample };
    let before = told.law.clone();
    told.answer(&guidance, &hostile.into(), MissionTime::default());
    assert_eq!(told.law, before);
}

#[test]
fn a_robot_that_is_to_back_does_so_along_its_axis_and_no_faster_than_the_mission_allows() {
    for (speed_limit_m_s, v) in [(0.1, -0.1), (f64::INFINITY, -2.0), (0.0, 0.0)] {
        let back = GuidanceSample { speed_limit_m_s, ..told(Maneuver::Back) };
        let command = Controller::new(&mission("robot.model = 'jackal'")).at(facing(0.3), &back);
        assert_eq!((command.v_m_s, command.omega_rad_s), (v, 0.0));
    }
}
