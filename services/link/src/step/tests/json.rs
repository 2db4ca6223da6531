//! Tests of a robot that speaks JSON.

use super::*;

fn link() -> Link {
    let mut link = in_time(&mission("robot.model = 'kobuki'"));
    link.drive(0);
    link
}

#[test]
fn a_link_goes_on_with_the_odometry_that_the_link_before_it_remembered() {
    let left_counts = |link: &mut Link, x: f64, ms: u64| {
        let line = format!("{{\"odometry\":[{x},0,0],\"speeds\":[0,0]}}\n");
        ticks(&link.hears(line.as_bytes(), ms))[0].2.left_counts
    };
    let mut first = link();
    left_counts(&mut first, 1.0, 0);
    let memory = first.driver_memory().unwrap();
    let mut next = link();
    next.at(Event::Remember(memory), 0);
    let [before, after] = [&mut first, &mut next].map(|link| left_counts(link, 1.1, 100));
    assert_eq!(before, after);
}

#[test]
fn a_robot_whose_program_restarts_while_it_drives_is_greeted_again_before_it_is_silent() {
    let mut link = link();
    let mut greetings = |heard: u64, ms: u64| {
        let line = format!("{{\"heard\":{heard},\"odometry\":[0,0,0],\"speeds\":[0,0]}}\n");
        link.hears(line.as_bytes(), ms).contains(&Effect::Send(link.base.greeting()))
    };
    assert!(greetings(3, 0), "a robot is found");
    assert_eq!(
        [(4, 100), (1, 300), (2, 400), (3, 500)].map(|(n, at)| greetings(n, at)),
        [false, false, true, false]
    );
}

#[test]
fn a_link_that_ends_tells_its_robot_to_stand() {
    let last = velocities(&driving(on_the_wall()).at(Event::End, 1));
    assert_eq!(last, [STAND; STOPS as usize]);
}
