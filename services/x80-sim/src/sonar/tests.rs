//! Tests with hand-computed ranges, in the laboratory and with smooth walls.

use common::mission::Realism;

use super::*;
use crate::noise::Source;
use crate::testing::{mission, near};

fn heard_in(text: &str, physics: &SonarPhysics, heading_deg: i32) -> f64 {
    let heading = f64::from(heading_deg).to_radians();
    let pose = Pose2 { position: DVec2::ZERO, heading };
    let mut noise = Noise::new(1, Source::Sonar);
    listen(&World::new(&mission(text)), pose.position, pose, physics, &mut noise)
}

/// Asserts the range in the laboratory.
#[track_caller]
fn laboratory(text: &str, heading_deg: i32, want: f64) {
    close(heard_in(text, &SonarPhysics::preset(Realism::Laboratory), heading_deg), want);
}

/// Measured reflections, and no random errors.
fn reflections() -> SonarPhysics {
    SonarPhysics {
        edge_share: 0.0,
        multipath_share: 0.0,
        dropout_share: 0.0,
        weak_dropout_share: 0.0,
        false_echo_share: 0.0,
        ..SonarPhysics::preset(Realism::Measured)
    }
}

fn smooth(text: &str, heading_deg: i32) -> f64 {
    heard_in(text, &reflections(), heading_deg)
}

#[track_caller]
fn close(got: f64, want: f64) {
    assert!(got == want || (got - want).abs() < 1e-9, "heard {got} m, want {want} m");
}

const WALL: &str = "world.wall = [{ points = [[1.5, -3], [1.5, 3]] }]";
const DRUM: &str = "world.drum = [{ at = [2, 0], radius_m = 0.5 }]";

const NOTHING: f64 = f64::INFINITY;

#[test]
fn the_nearest_point_in_the_cone_and_in_reach_answers_and_hides_what_is_behind_it_unless_it_is_low()
{
    laboratory(WALL, 0, 1.5);
    // The axis is 40 degrees off the normal; the cone's near edge meets the wall at 25 degrees.
    laboratory(WALL, 40, 1.5 / 25_f64.to_radians().cos());
    laboratory(DRUM, 14, 1.5);
    laboratory(DRUM, 32, NOTHING);
    // The cone's edge passes 5 degrees beside a centre at 20 degrees: 2 cos 5 - sqrt(.25 - (2 sin
    // 5)^2).
    let (sin, cos) = 5_f64.to_radians().sin_cos();
    laboratory(DRUM, 20, 2.0 * cos - (0.25 - 4.0 * sin * sin).sqrt());
    let post = format!("{WALL}\nworld.drum = [{{ at = [1, 0], radius_m = 0.1 }}]");
    laboratory(&post, 0, 0.9);
    let end_of_wall = DVec2::new(1.0, 0.1).length();
    laboratory("world.wall = [{ points = [[1, 0.1], [1, 3]] }]", 0, end_of_wall);
    laboratory("world.wall = [{ points = [[2.56, -1], [2.56, 1]] }]", 0, NOTHING);
    // A hard thing thicker than a post is heard as far as the ranger reaches.
    laboratory("world.drum = [{ at = [2.564, 0], radius_m = 0.015 }]", 0, 2.549);
    // The cone meets an object 0.05 m high from 0.13 m / tan(15 degrees) = 0.49 m on.
    let low =
        format!("{WALL}\nworld.box = [{{ at = [0.35, 0], size_m = [0.1, 2], top_m = 0.05 }}]");
    laboratory(&low, 0, 1.5);
}

#[test]
fn a_smooth_wall_answers_square_on_and_not_when_oblique_though_it_hides_what_stands_behind_it() {
    let near_wall = "world.wall = [{ points = [[0.5, -3], [0.5, 3]] }]";
    let behind = "world.wall = [{ points = [[0, -1], [2, 1]] }]\nworld.drum = [{ at = [2, 0], radius_m = 0.5 }]";
    close(smooth(WALL, 0), 1.5);
    close(smooth(near_wall, 20), 0.5);
    for (oblique, heading_deg) in [(WALL, 24), (WALL, 45), (behind, 0), (near_wall, 24)] {
        close(smooth(oblique, heading_deg), NOTHING);
    }
    // A drum answers over a wider angle.
    assert!(smooth("world.drum = [{ at = [0.7, 0], radius_m = 0.2 }]", 24) < 0.55);
    // The beam goes on: 1 m to a wall at 45 degrees ahead, then 0.8 m to a wall on the left.
    let thrown =
        "world.wall = [{ points = [[0.9, -0.1], [1.3, 0.3]] }, { points = [[0, 0.8], [3, 0.8]] }]";
    let physics = SonarPhysics { multipath_share: 1.0, ..reflections() };
    close(heard_in(thrown, &physics, 0), 1.8);
}

#[test]
fn the_edge_of_what_is_low_is_heard_at_middle_ranges_only() {
    let physics = SonarPhysics { edge_share: 1.0, ..reflections() };
    // Beyond 1.2 m it is too weak. Below 0.08 m / tan(15 degrees) = 0.3 m the beam passes above it.
    for (ahead_m, is_heard) in [(0.2, false), (0.4, true), (1.1, true), (1.3, false)] {
        let low =
            format!("world.wall = [{{ points = [[{ahead_m}, -1], [{ahead_m}, 1]], top_m = 0.1 }}]");
        assert_eq!(heard_in(&low, &physics, 0).is_finite(), is_heard, "{ahead_m}");
    }
}

#[test]
fn answers_are_lost_and_invented_as_often_as_the_mission_says() {
    let physics = SonarPhysics {
        dropout_share: 0.1,
        false_echo_share: 0.05,
        ..SonarPhysics::preset(Realism::Laboratory)
    };
    let world = World::new(&mission(WALL));
    let mut noise = Noise::new(2, Source::Sonar);
    let pings = 20_000;
    let heard: Vec<f64> = (0..pings)
        .map(|_| listen(&world, DVec2::ZERO, Pose2::default(), &physics, &mut noise))
        .collect();
    let share = |want: fn(f64) -> bool| {
        heard.iter().filter(|range| want(**range)).count() as f64 / f64::from(pings)
    };
    let lost = share(|range| range > REACH_M);
    near(lost, 0.1 * 0.95, 0.01);
    let short = share(|range| range < 1.499);
    // The range that replaces a lost echo may be beyond the wall.
    assert!((0.04..=0.055).contains(&short), "{short} were short");
}

/// Returns the reach of a smooth disc of `radius_m` and `echo` straight ahead, metres.
fn reach_of(radius_m: f64, echo: f64) -> f64 {
    let is_heard = |centimetres: &u16| {
        let at = f64::from(*centimetres) / 100.0 + radius_m;
        let scene = format!(
            "world.drum = [{{ at = [{at}, 0], radius_m = {radius_m}, echo = {echo} }}]\nrobot.radius_m = 0.01"
        );
        smooth(&scene, 0).is_finite()
    };
    f64::from((5..=255).rev().find(is_heard).unwrap_or(0)) / 100.0
}

#[test]
fn a_thin_post_is_heard_less_far_than_a_drum_and_a_soft_one_less_far_still() {
    close(reach_of(0.015, 1.0), 2.0);
    let leg = reach_of(0.0125, 1.0);
    assert!((1.8..1.95).contains(&leg), "{leg} m");
    close(reach_of(0.12, 1.0), 2.55);
    let soft = reach_of(0.12, 0.2);
    assert!((1.2..1.7).contains(&soft), "{soft} m");
}

#[test]
fn a_sensor_at_or_within_the_bodys_edge_never_looks_through_a_wall_that_the_body_touches() {
    // A body of 0.19 m with its centre at x = 1 touches the wall at x = 1.19; another wall is 2.33
    // m behind.
    let world = World::new(&mission(
        "world.wall = [{ points = [[1.19, -3], [1.19, 3]] }, { points = [[3.52, -3], [3.52, 3]] }]",
    ));
    let mut noise = Noise::new(1, Source::Sonar);
    for realism in [Realism::Laboratory, Realism::Measured] {
        let physics = SonarPhysics::preset(realism);
        for (forward_m, want) in [(0.19, 0.0), (0.1915, 0.0), (0.2, 0.0), (0.1, 0.09)] {
            let pose = Pose2 { position: DVec2::new(1.0 + forward_m, 0.0), heading: 0.0 };
            close(listen(&world, DVec2::X, pose, &physics, &mut noise), want);
        }
    }
}
