use super::*;
use std::path::Path;

const LIMITS: BatteryLimits = BatteryLimits { board: 6.6, motor: 11.0, servo: 0.0 };

fn batteries(limits: BatteryLimits) -> Batteries {
    let mut mission = Mission::parse("target = [3, 0]", Path::new("test.toml")).unwrap();
    mission.robot.low_battery_v = limits;
    Batteries::new(&mission)
}

impl Batteries {
    fn at(&mut self, seconds: f64, volts: [f64; 3]) -> ([bool; 3], Vec<(&'static str, Charge)>) {
        self.read(volts, MissionTime::from_seconds(seconds));
        let changes = std::mem::take(&mut self.changes).into_iter();
        let changes = changes.map(|change| (change.pack, change.charge));
        (self.low(), changes.collect())
    }
}

#[test]
fn a_low_battery_is_said_once_and_gives_enough_again_only_clearly_above_its_limit() {
    let mut batteries = batteries(LIMITS);
    let mut at = |board| {
        let ([low, ..], changes) = batteries.at(0.0, [board, 12.0, 1.2]);
        (low, changes)
    };
    assert_eq!(at(6.7), (false, vec![]));
    assert_eq!(at(6.5), (true, vec![("board", Charge::Low)]));
    assert_eq!(at(6.4), (true, vec![]));
    assert_eq!(at(6.8), (true, vec![]), "it recovers while nothing turns");
    assert_eq!(at(7.0), (false, vec![("board", Charge::Enough)]));
}

#[test]
fn each_battery_has_its_own_limit_and_one_that_is_not_there_is_not_low() {
    let mut batteries = batteries(LIMITS);
    let (low, _) = batteries.at(0.0, [7.2, 10.9, 1.2]);
    assert_eq!(low, [false, true, false]);
    let (low, _) = batteries.at(0.0, [7.2, 0.2, 1.2]);
    assert_eq!(low, [false; 3]);
}

#[test]
fn a_battery_that_stays_sunk_is_empty_for_good_and_one_that_dips_is_only_low() {
    let mut batteries = batteries(LIMITS);
    let mut at = |seconds, motor| {
        batteries.at(seconds, [7.2, motor, 1.2]);
        batteries.charge()
    };
    // Low below 11 V, empty below 10 V.
    assert_eq!(at(0.0, 12.0), Charge::Enough);
    assert_eq!(at(1.0, 9.9), Charge::Low);
    assert_eq!(at(2.9, 10.1), Charge::Low, "a dip");
    assert_eq!(at(3.0, 9.9), Charge::Low);
    assert_eq!(at(4.9, 9.9), Charge::Low);
    assert_eq!(at(5.0, 9.9), Charge::Empty);
    assert_eq!(at(6.0, 12.0), Charge::Empty, "it recovers at rest");
}

#[test]
fn a_robot_drives_on_without_its_servos() {
    let mut batteries = batteries(BatteryLimits::default());
    for seconds in [0.0, 5.0] {
        let (low, _) = batteries.at(seconds, [7.2, 7.2, 5.0]);
        assert_eq!((low, batteries.charge()), ([false, false, true], Charge::Enough));
    }
}
