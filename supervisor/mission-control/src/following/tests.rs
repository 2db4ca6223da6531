use common::grid::Part;

use super::*;
use crate::testing;
use glam::dvec2;

const HERE: DVec2 = DVec2::ZERO;

fn mission() -> Mission {
    testing::mission("stay = true\nperimeter = { width_m = 8, cells = 160 }")
}

fn map(is_hazard: impl Fn(DVec2) -> bool) -> Replica<u8> {
    let frame = mission().grid_frame();
    let cells = frame.whole().cells();
    let cells = cells.map(|cell| u8::from(frame.is_rim(cell) || is_hazard(frame.centre_of(cell))));
    let mut map = Replica::default();
    map.apply(&Part::whole(frame, 1), &cells.collect::<Vec<_>>());
    map
}

fn beacon(x_m: f64, y_m: f64) -> BeaconSample {
    BeaconSample { x_m, y_m, capture_ns: 10_000_000_000, ..BeaconSample::default() }
}

const NOW: MissionTime = MissionTime(10_000_000_000);

fn follows(x_m: f64, y_m: f64) -> Following {
    let mut following = Following::new(1.0, NOW, None);
    following.take(&beacon(x_m, y_m), NOW, &mission()).unwrap();
    following
}

#[test]
fn the_robot_goes_to_the_nearest_place_at_its_distance_and_not_into_what_stands_at_the_beacon() {
    let body = dvec2(2.5, 0.0);
    let map = map(|at| at.distance(body) < 0.55);
    let next = follows(2.5, 0.0).next_place(&map, &mission(), (HERE, None), false).unwrap();
    assert!(next.distance(dvec2(1.5, 0.0)) < 0.08, "{next}");
    let stands = follows(0.9, 0.0).next_place(&map, &mission(), (HERE, Some(HERE)), true);
    assert_eq!(stands, None, "it is near enough");
}

#[test]
fn the_robot_goes_round_a_wall_to_see_the_beacon_and_where_no_way_leads_as_near_as_it_can() {
    let wall = |at: DVec2| (at.x - 0.8).abs() < 0.12;
    let mission = mission();
    let around = map(|at| wall(at) && at.y < 1.0);
    let next = follows(1.5, 0.0).next_place(&around, &mission, (HERE, Some(HERE)), true).unwrap();
    assert!(next.x > 0.9 && next.distance(dvec2(1.5, 0.0)) <= 1.0, "{next}");
    let closed = map(wall);
    let next = follows(3.0, 0.5).next_place(&closed, &mission, (HERE, None), false).unwrap();
    assert!(next.distance(dvec2(0.65, 0.5)) < 0.1, "{next}");
}

#[test]
fn a_target_goes_on_until_the_beacon_leaves_it_or_comes_to_the_robot() {
    let (map, mission) = (map(|_| false), mission());
    let goes_on = |x_m: f64, rest: f64| {
        let place = (dvec2(rest, 0.0), Some(dvec2(1.0, 0.0)));
        follows(x_m, 0.0).next_place(&map, &mission, place, false)
    };
    assert_eq!(goes_on(2.0, 0.0), None, "it is at its distance from the beacon");
    assert_eq!(goes_on(1.8, 0.0), None, "the beacon came a little nearer");
    assert!(goes_on(2.08, 0.0).unwrap().distance(dvec2(1.08, 0.0)) < 0.05);
    assert!(goes_on(1.2, 0.3).unwrap().distance(dvec2(0.3, 0.0)) < 0.05, "it stands");
}

#[test]
fn a_sample_that_cannot_be_used_is_refused_for_its_reason_and_leaves_the_place_as_it_was() {
    use BeaconRefusal::{Doubtful, Future, Late, NotFinite, Outside};
    type Change = fn(&mut BeaconSample);
    #[rustfmt::skip]
    let rows: [(BeaconRefusal, Change); 10] = [
        (NotFinite, |it| it.x_m = f64::NAN), (NotFinite, |it| it.y_m = f64::INFINITY),
        (NotFinite, |it| it.deviation_m = f64::NAN), (NotFinite, |it| it.deviation_m = -0.1),
        (Doubtful, |it| it.deviation_m = 0.26), (Outside, |it| it.x_m = 4.1),
        (Outside, |it| it.y_m = 1e300), (Future, |it| it.capture_ns = u64::MAX),
        (Future, |it| it.capture_ns += 200_000_000), (Late, |it| it.capture_ns -= 1),
    ];
    let mut following = follows(1.0, 0.0);
    for (nth, (refusal, change)) in (1..).zip(rows) {
        let mut sample = beacon(2.0, 0.0);
        change(&mut sample);
        assert_eq!(following.take(&sample, NOW, &mission()), Err(refusal), "{sample:?}");
        let told = following.sample(NOW, None);
        assert_eq!((told.used, told.refused, told.refusal), (1, nth, refusal.into()));
        assert_eq!((told.x_m, told.y_m), (1.0, 0.0));
    }
    let old = BeaconSample { capture_ns: NOW.0 - 1_000_000_001, ..beacon(1.0, 0.0) };
    let mut following = Following::new(1.0, NOW, None);
    assert_eq!(following.take(&old, NOW, &mission()), Err(Late));
}

#[test]
fn a_beacon_is_lost_once_for_each_silence_and_the_result_counts_it() {
    let mut following = Following::new(1.0, NOW, None);
    assert!(following.is_lost && !following.loses(NOW), "it was not heard yet");
    for silence in 1..=3 {
        let heard = MissionTime(NOW.0 * silence);
        let sample = BeaconSample { capture_ns: heard.0, ..beacon(1.0, 0.0) };
        following.take(&sample, heard, &mission()).unwrap();
        assert!(!following.loses(MissionTime(heard.0 + 1_000_000_000)));
        assert!(following.loses(MissionTime(heard.0 + 1_000_000_001)), "{silence}");
        assert!(!following.loses(MissionTime(heard.0 + 2_000_000_000)) && following.is_lost);
    }
    let pose = PoseSample { travelled_m: 84.2, ..PoseSample::default() };
    let told = following.sample(MissionTime(NOW.0 + 130_000_000_000), Some(&pose));
    assert_eq!(told.result(), "followed 84 m for 130 s, lost 3 times");
}

#[test]
fn the_distance_leaves_room_between_the_bodies() {
    let mission = mission();
    let radius_m = mission.body().radius_m;
    assert_eq!(kept_m(0.0, &mission), Some(0.8 + radius_m));
    for (asked_m, kept) in [(0.3, false), (0.31 + radius_m, true), (10.0, true), (10.1, false)] {
        assert_eq!(kept_m(asked_m, &mission), Some(asked_m).filter(|_| kept));
    }
    assert_eq!((kept_m(f64::NAN, &mission), kept_m(-1.0, &mission)), (None, None));
}
