use common::mission::Mission;

use super::*;

const NODES: usize = 36;

fn rplidar(set: &str) -> Rplidar {
    let text = format!(
        "target = [3, 0]\nrobot.counts_per_turn = 1320\nrobot.protocol = 'arduino'\n[[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nmodel = 'rplidar-a1'\nforward_m = 0\nbearing_deg = 0\nbeams = 36\n{set}"
    );
    let mission = Mission::parse(&text, "m.toml").unwrap();
    let (row, sensor, product) = mission.rplidars().remove(0);
    Rplidar::new(row, sensor, product)
}

/// Returns a node at `degrees` clockwise; 0 metres is no reading.
fn node(degrees: u16, metres: f32) -> Vec<u8> {
    let quality = if metres > 0.0 { 20 } else { 0 };
    let distance_q2 = (metres * 4000.0) as u16;
    let angle_q6 = degrees * 64;
    Node { is_first: degrees == 0, quality, angle_q6, distance_q2 }.encode().to_vec()
}

/// Returns a turn by 10 degrees, with `range(degrees)` metres.
fn turn(range: impl Fn(u16) -> f32) -> Vec<u8> {
    (0..NODES as u16).flat_map(|beam| node(10 * beam, range(10 * beam))).collect()
}

fn next() -> Vec<u8> {
    [node(0, 1.0), node(10, 1.0)].concat()
}

fn at(scan: &LaserScan, degrees: usize) -> f32 {
    scan.beams[(degrees / 10 + 18) % NODES]
}

fn scanning(set: &str) -> Rplidar {
    let mut driver = rplidar(set);
    assert_eq!(driver.hear(&Answer::Scan.encode()), Heard::default());
    driver
}

/// Returns the scans of a turn at `metres` and the next one's beginning.
fn hears(driver: &mut Rplidar, metres: f32) -> Vec<LaserScan> {
    driver.hear(&[turn(|_| metres), next()].concat()).scans
}

#[test]
fn a_turn_is_a_scan_counter_clockwise_and_no_quality_no_range_and_one_too_short_are_no_reading() {
    let range = |degrees| match degrees {
        0 => 0.1,
        90 => 1.0,
        180 => 0.0,
        270 => 3.0,
        _ => 2.0,
    };
    let seen = |set: &str, nodes: Vec<u8>| {
        scanning(set).hear(&[nodes, next()].concat()).scans.pop().unwrap()
    };
    let scan = seen("", turn(range));
    // 90 degrees clockwise is on the right.
    assert_eq!([at(&scan, 270), at(&scan, 90), at(&scan, 30)], [1.0, 3.0, 2.0]);
    assert!(at(&scan, 0).is_nan() && at(&scan, 180).is_nan());
    let turned = seen("roll_deg = 180", turn(range));
    assert_eq!([at(&turned, 270), at(&turned, 90)], [3.0, 1.0]);
    assert_eq!(turned.sweep, Sweep { beam_ns: -scan.sweep.beam_ns, ..scan.sweep });
    let open = |degrees| if degrees > 180 { 0.0 } else { 2.0 };
    let scan = seen("", turn(open));
    // Nothing is in reach on the left, except beside ended beams.
    assert!(at(&scan, 90) == f32::INFINITY && at(&scan, 10).is_nan() && at(&scan, 170).is_nan());
    let silent = Node { is_first: false, quality: 0, angle_q6: 64, distance_q2: 400 }.encode();
    let scan = seen("", [&node(0, 0.0), &silent[..]].concat());
    assert!(scan.beams.iter().all(|beam| !beam.is_finite()));
}

#[test]
fn a_beam_is_as_old_as_the_measurements_that_came_after_it_by_the_sensors_own_rate() {
    let mut driver = scanning("");
    let bytes = [turn(|_| 1.0), turn(|_| 1.0)[..5 * 5].to_vec()].concat();
    let scan = driver.hear(&bytes).scans.pop().unwrap();
    // The middle beam, ahead, was first; 35 of its turn and five of the next followed.
    let want = Sweep { first_beam_ns: -40 * 508_000, beam_ns: -508_000, first_beam: 18 };
    assert_eq!(scan.sweep, want);
    let rate = Answer::SampleRate { standard_us: 250, express_us: 125 }.encode();
    let mut slow = rplidar("");
    slow.hear(&[rate, Answer::Scan.encode()].concat());
    assert_eq!(hears(&mut slow, 1.0)[0].sweep.beam_ns, -250_000);
}

#[test]
fn after_garbage_a_cut_off_measurement_or_a_restart_the_next_whole_turn_is_heard() {
    let cut = turn(|_| 1.0)[..5 * 20 + 3].to_vec();
    let restart = [b"RP LIDAR System.\r\n".to_vec(), Answer::Scan.encode()].concat();
    let mut inverted = turn(|_| 1.0);
    inverted[5 * 10] ^= 1;
    let gap = [&turn(|_| 1.0)[..5 * 10], &turn(|_| 1.0)[5 * 20..]].concat();
    for bad in [vec![0xa5; 50], vec![0; 333], cut, restart, inverted, gap] {
        let bytes = [turn(|_| 3.0), bad.clone(), turn(|_| 2.0), next()].concat();
        let said = scanning("").hear(&bytes).scans;
        assert!(said.iter().all(|scan| at(scan, 0) != 1.0), "{bad:?}: {said:?}");
        let newest = said.last().unwrap_or_else(|| panic!("nothing after {bad:?}"));
        assert!(newest.beams.iter().all(|beam| *beam == 2.0), "{bad:?}: {newest:?}");
    }
}

#[test]
fn a_turn_comes_in_any_pieces_and_nothing_is_heard_before_it_begins() {
    let mut driver = scanning("");
    let bytes = [turn(|_| 1.0)[25..].to_vec(), turn(|_| 2.0), next()].concat();
    let scans = Vec::from_iter(bytes.iter().flat_map(|byte| driver.hear(&[*byte]).scans));
    assert_eq!((scans.len(), at(&scans[0], 90)), (1, 2.0));
    driver.reset();
    assert!(hears(&mut driver, 1.0).is_empty(), "the next connection must be greeted");
}

#[test]
fn the_greeting_stops_asks_for_health_and_scans_and_an_error_of_health_is_named() {
    let mut driver = rplidar("");
    let mut requests = rplidar_protocol::Requests::default();
    let want = [Request::Stop, Request::Health, Request::SampleRate, Request::Scan];
    assert_eq!(requests.push(&driver.greeting()), want);
    let healthy = driver.hear(&Answer::Health { status: 0, code: 0 }.encode());
    assert_eq!(healthy.refused, None);
    let ill = driver.hear(&Answer::Health { status: 2, code: 0x8002 }.encode());
    assert!(ill.refused.is_some_and(
        |why| why.to_string().contains("\"laser\"") && why.to_string().contains("0x8002")
    ));
}

#[test]
fn a_turn_without_an_end_is_given_up() {
    let mut driver = scanning("");
    driver.hear(&node(0, 1.0));
    driver.hear(&node(1, 1.0).repeat(5000));
    assert!(driver.turn.is_none());
}
