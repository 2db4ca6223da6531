use super::*;
use crate::testing::*;

fn batteries() -> Batteries {
    let limits = BatteryLimits { board: 6.6, motor: 11.0, servo: 0.0 };
    Batteries { limits, ..Batteries::new(&mission("")) }
}

impl Batteries {
    fn at(&mut self, seconds: f64, volts: [f64; 3]) -> ([bool; 3], Vec<(&'static str, Charge)>) {
        self.read(volts, at(seconds));
        let changes = self.changes.drain(..).map(|change| (change.pack, change.charge)).collect();
        (self.low(), changes)
    }
}

#[test]
fn a_low_battery_is_said_once_and_gives_enough_again_only_clearly_above_its_limit() {
    let mut batteries = batteries();
    // At 6.8 V it recovers while nothing turns.
    for (board, is_low, said) in [
        (6.6, false, None),
        (6.5, true, Some(Charge::Low)),
        (6.4, true, None),
        (6.8, true, None),
        (7.0, false, Some(Charge::Enough)),
    ] {
        let ([low, ..], changes) = batteries.at(0.0, [board, 12.0, 1.2]);
        let expected = Vec::from_iter(said.map(|charge| ("board", charge)));
        assert_eq!((low, changes), (is_low, expected), "{board}");
    }
}

#[test]
fn each_battery_has_its_own_limit_and_one_that_is_not_there_is_not_low() {
    let mut batteries = batteries();
    for (motor, is_low) in [(10.9, true), (0.2, false)] {
        assert_eq!(batteries.at(0.0, [7.2, motor, 1.2]).0, [false, is_low, false]);
    }
}

#[test]
fn a_battery_that_stays_sunk_is_empty_for_good_and_one_that_dips_is_only_low() {
    let mut batteries = batteries();
    // Low below 11 V, empty below 10 V; a dip, and recovery at rest.
    for (seconds, motor, charge) in [
        (0.0, 12.0, Charge::Enough),
        (1.0, 9.9, Charge::Low),
        (2.9, 10.0, Charge::Low),
        (3.0, 9.9, Charge::Low),
        (4.9, 9.9, Charge::Low),
        (5.0, 9.9, Charge::Empty),
        (6.0, 12.0, Charge::Empty),
    ] {
        batteries.at(seconds, [7.2, motor, 1.2]);
        assert_eq!(batteries.charge(), charge, "{seconds}");
    }
}

#[test]
fn a_robot_drives_on_without_its_servos() {
    let mut batteries = Batteries::new(&mission(""));
    for seconds in [0.0, 5.0] {
        let (low, _) = batteries.at(seconds, [7.2, 7.2, 5.0]);
        assert_eq!((low, batteries.charge()), ([false, false, true], Charge::Enough));
    }
}
