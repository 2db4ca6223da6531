//! Tests of a robot that speaks JSON.

use super::*;

fn link() -> Link {
    let text = "target = [3, 0]\nrobot.model = 'kobuki'";
    let mut link = Link::new(&Mission::parse(text, Path::new("test.toml")).unwrap());
    link.restore(State { pace: Pace::Rate(1.0), next_tick: 0 });
    link.at(Event::Order(Order::Drive, HoldReason::None), 0);
    link
}

fn counts_at(link: &mut Link, x: f64, machine_ns: u64) -> WheelSample {
    let line = format!("{{\"odometry\":[{x},0,0],\"speeds\":[0,0]}}\n");
    ticks(&link.at(Event::Datagram(line.as_bytes()), machine_ns))[0].2
}

#[test]
fn a_link_goes_on_with_the_odometry_that_the_link_before_it_remembered() {
    let mut first = link();
    counts_at(&mut first, 1.0, 0);
    let memory = first.driver_memory().unwrap();
    let (mut next, mut forgetful) = (link(), link());
    next.at(Event::Remember(memory), 0);
    let [before, after, without] =
        [&mut first, &mut next, &mut forgetful].map(|link| counts_at(link, 1.1, 100 * MS));
    assert_eq!(after.left_counts, before.left_counts);
    assert_ne!(without.left_counts, before.left_counts);
}

#[test]
fn a_robot_whose_program_restarts_while_it_drives_is_greeted_again_before_it_is_silent() {
    let mut link = link();
    let mut greetings = |heard: u64, at_ms: u64| {
        let line = format!("{{\"heard\":{heard},\"odometry\":[0,0,0],\"speeds\":[0,0]}}\n");
        let effects = link.at(Event::Datagram(line.as_bytes()), at_ms * MS);
        let is_greeting = |effect: &&Effect| matches!(effect, Effect::Send(bytes) if bytes.starts_with(b"{\"hello\""));
        effects.iter().filter(is_greeting).count()
    };
    assert_eq!(greetings(3, 0), 1, "a robot is found");
    assert_eq!(
        [(4, 100), (1, 300), (2, 400), (3, 500)].map(|(n, at)| greetings(n, at)),
        [0, 0, 1, 0]
    );
}

#[test]
fn a_link_that_ends_tells_its_robot_to_stand() {
    let mut link = driving(on_the_wall());
    let last = velocities(&link.at(Event::End, MS));
    assert_eq!(last, [[Some(0); 2]; STOPS as usize]);
}
