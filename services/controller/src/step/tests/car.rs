//! A car is limited in speed, and never turns on the spot.

use super::*;

fn car(extra: &str) -> Mission {
    mission(&format!("robot.model = 'car'\n{extra}"))
}

/// Returns the command at the origin, facing x, under guidance at `angle` radians.
fn command(
    mission: &Mission,
    maneuver: Maneuver,
    angle: f64,
    speed_limit_m_s: f64,
) -> CommandSample {
    let (ex, ey) = (angle.cos(), angle.sin());
    let guidance = GuidanceSample { ex, ey, speed_limit_m_s, ..told(maneuver) };
    Controller::new(mission).command(&guidance)
}

fn drives(command: &CommandSample) -> bool {
    command.state() == CommandState::Driving
}

#[test]
fn a_car_is_never_asked_for_what_its_wheels_cannot_do() {
    for method in ["paper", "evidential"] {
        let mission = car(&format!("method = '{method}'"));
        let body = mission.body();
        let (limit, top) =
            (body.steering.unwrap().limit_rad, body.top_speed_m_s / body.wheel_radius_m);
        for degrees in -180..=180 {
            let angle = f64::from(degrees).to_radians();
            let command = command(&mission, Maneuver::Follow, angle, f64::INFINITY);
            assert!(drives(&command), "{degrees}");
            assert!(command.right_rad_s.abs() <= limit, "{degrees}");
            let wheel = command.left_rad_s;
            assert!(wheel > 0.0 && wheel <= top, "{degrees}: {wheel}");
        }
    }
}

#[test]
fn a_car_stands_where_it_would_have_to_turn_on_the_spot() {
    let mission = car("");
    for maneuver in [Maneuver::Turn, Maneuver::Back, Maneuver::Stand] {
        assert!(!drives(&command(&mission, maneuver, 1.0, 0.5)), "{maneuver:?}");
    }
}

#[test]
fn a_car_goes_no_faster_than_guidance_allows_along_the_same_curve() {
    let mission = car("");
    let drive = mission.body().ackermann().unwrap();
    let twist = |limit| {
        let command = command(&mission, Maneuver::Follow, 0.3, limit);
        assert!(drives(&command));
        drive.twist([command.left_rad_s, command.right_rad_s])
    };
    let (free, limited) = (twist(f64::INFINITY), twist(0.1));
    assert!((limited.v - 0.1).abs() < 1e-12, "{limited:?}");
    let curvature = free.omega / free.v;
    assert!((limited.omega / limited.v - curvature).abs() < 1e-12);
    for limit in [0.0, f64::NAN] {
        assert!(!drives(&command(&mission, Maneuver::Follow, 0.3, limit)));
    }
}
