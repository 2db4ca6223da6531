//! Tests of two simulated robots in one world.

use std::{
    net::UdpSocket,
    path::Path,
    time::{Duration, Instant},
};

use common::{clock::Pace, ground_truth::GroundTruthTick};

use crate::support::{Sim, forward, receive};

const DIAMETER_M: f64 = 0.38;

/// Starts two robots facing each other, 2 m apart, in lockstep, with their sockets in `folder`.
fn pair(folder: &Path, text: &str) -> [(Sim, UdpSocket); 2] {
    let sockets = ["one", "two"].map(|robot| folder.join(robot));
    [("start = [0, 0, 0]", [0, 1]), ("start = [2, 0, 180]", [1, 0])].map(|(start, order)| {
        let meeting = order.map(|at| sockets[at].clone());
        let text = format!("{start}\n{text}");
        let sim = Sim::start_with(&text, Pace::Max, Some(meeting));
        let host = sim.host();
        (sim, host)
    })
}

fn tick((sim, host): &mut (Sim, UdpSocket), counts: i16) -> GroundTruthTick {
    host.send(&forward(counts, 250)).unwrap();
    receive(host);
    sim.next_truth()
}

fn meet(text: &str) -> Vec<[GroundTruthTick; 2]> {
    let folder = tempfile::tempdir().unwrap();
    let mut pair = pair(folder.path(), text);
    let first = pair.each_mut().map(|(sim, _)| sim.next_truth());
    let mut truths = vec![first];
    while truths.len() < 40 && truths.last().unwrap().iter().any(|truth| truth.contacts == 0) {
        truths.push(pair.each_mut().map(|robot| tick(robot, 1000)));
    }
    truths
}

#[test]
fn two_robots_see_and_touch_each_other_and_the_pair_repeats_to_the_bit() {
    let truths = meet("simulation.realism = 'measured'");
    for robot in [0, 1] {
        let heard = truths.iter().filter(|truth| truth[robot].sonar_cm < 200).count();
        assert!(heard > 5, "the sonar heard the other in {heard} ticks");
    }
    let [one, two] = truths.last().unwrap();
    assert_eq!((one.contacts, two.contacts), (1, 1));
    assert!(one.x > 0.5 && two.x < 1.5, "both drove: {one:?} {two:?}");
    let gap_m = two.x - one.x - DIAMETER_M;
    assert!((0.0..0.1).contains(&gap_m), "{gap_m} m apart");
    assert_eq!(truths, meet("simulation.realism = 'measured'"));
}

#[test]
fn bodies_with_corners_touch_by_their_corners() {
    let footprint = "robot.footprint = [[-0.1, -0.1], [0.3, -0.1], [0.3, 0.1], [-0.1, 0.1]]";
    let truths = meet(footprint);
    let [one, two] = truths.last().unwrap();
    let gap_m = two.x - one.x - 0.6;
    assert!((0.0..0.1).contains(&gap_m), "{gap_m} m apart");
}

#[test]
fn a_robot_that_ended_stays_where_it_is_and_the_other_does_not_wait_for_it() {
    let folder = tempfile::tempdir().unwrap();
    let [mut one, mut two] = pair(folder.path(), "");
    one.0.next_truth();
    two.0.next_truth();
    let mut last = GroundTruthTick::default();
    for _ in 0..4 {
        tick(&mut one, 0);
        last = tick(&mut two, 1000);
    }
    two.0.finish();
    let began = Instant::now();
    let touched = (0..60).map(|_| tick(&mut one, 1000)).find(|truth| truth.contacts > 0).unwrap();
    assert!(began.elapsed() < Duration::from_secs(8), "it waited {:?}", began.elapsed());
    let other = touched.x + DIAMETER_M;
    assert!((last.x - 0.2..last.x + 0.01).contains(&other), "{other} {last:?}");
}
