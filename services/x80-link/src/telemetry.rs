//! What the robot's frames carry besides wheels and front sonar, in the units of the topics.

use std::time::Duration;

use common::{
    clock::MissionTime,
    mission::BatteryLimits,
    samples::{InfraredSample, PowerSample, SurroundingsSample},
    wire::{
        CustomSensors, LOGIC_SCALE_V, MOTOR_SCALE_V, MotorSensors, StandardSensors, board_celsius,
        driver_celsius, infrared_m, volts,
    },
};

use crate::failsafe::Charge;

/// A battery that was low is well again this far above its limit, volts: a pack whose motors have just
/// stopped recovers by less.
pub(crate) const RECOVERED_V: f64 = 0.3;
/// The share of the limit below which a battery is empty: 1.0 V a cell where it is low at 1.1 V. A cell that
/// gives less is damaged, and the voltage falls faster than a robot can be fetched.
pub(crate) const EMPTY_SHARE: f64 = 1.0 / 1.1;
/// For so long, mission time: motors that start draw the voltage down for some tenths of a second.
pub(crate) const EMPTY_AFTER: Duration = Duration::from_secs(2);
/// A supply below this is no empty battery but none, volts: the robot could not speak on it.
const FITTED_V: f64 = 1.0;

/// A battery of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pack {
    /// The boards'.
    Board,
    /// The motors'.
    Motor,
    /// The servos'.
    Servo,
}

impl Pack {
    /// For logs.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Board => "board",
            Self::Motor => "motor",
            Self::Servo => "servo",
        }
    }
}

/// A battery became low or empty, or is no longer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatteryChange {
    /// Which.
    pub pack: Pack,
    /// What it gives, volts.
    pub volts: f64,
    /// How it is now.
    pub charge: Charge,
}

/// One battery over time.
#[derive(Clone, Copy, Debug, Default)]
struct Gauge {
    charge: Charge,
    /// Since when it has given less than an empty one does.
    sunk_since: Option<MissionTime>,
}

impl Gauge {
    fn read(&mut self, volts: f64, limit: f64, now: MissionTime) -> Charge {
        let fitted = volts >= FITTED_V;
        let sunk = fitted && volts < limit * EMPTY_SHARE;
        let since = self.sunk_since.unwrap_or(now);
        self.sunk_since = sunk.then_some(since);
        let ends = if self.charge == Charge::Well {
            limit
        } else {
            limit + RECOVERED_V
        };
        self.charge = if self.charge == Charge::Empty || sunk && now.since(since) >= EMPTY_AFTER {
            // Its voltage comes back when the robot stands, but nothing to drive on does.
            Charge::Empty
        } else if fitted && volts < ends {
            Charge::Low
        } else {
            Charge::Well
        };
        self.charge
    }
}

/// Frames in, samples out; it remembers what a sample needs of another frame.
#[derive(Clone, Debug)]
pub struct Telemetry {
    limits: BatteryLimits,
    /// Of the boards', the motors' and the servos' battery.
    gauges: [Gauge; 3],
    currents: [u16; 6],
    /// The first infrared ranger comes in the standard frame, the other six in the custom one.
    first_infrared: Option<u16>,
}

impl Telemetry {
    /// With these limits of the batteries.
    #[must_use]
    pub fn new(limits: BatteryLimits) -> Self {
        Self {
            limits,
            gauges: [Gauge::default(); 3],
            currents: [0; 6],
            first_infrared: None,
        }
    }

    /// A motor frame: its currents go with the next [`PowerSample`].
    pub const fn take_motor(&mut self, motor: &MotorSensors) {
        self.currents = motor.currents;
    }

    /// The worst of the batteries that the robot drives on: without its servos it does.
    #[must_use]
    pub fn charge(&self) -> Charge {
        let [board, motor, _] = self.gauges;
        board.charge.max(motor.charge)
    }

    /// A standard frame, which came at `now`.
    pub fn take_standard(
        &mut self,
        standard: &StandardSensors,
        now: MissionTime,
    ) -> (PowerSample, SurroundingsSample, Vec<BatteryChange>) {
        self.first_infrared = Some(standard.infrared);
        let board_v = volts(standard.board_battery, LOGIC_SCALE_V);
        let motor_v = volts(standard.motor_battery, MOTOR_SCALE_V);
        let servo_v = volts(standard.servo_battery, LOGIC_SCALE_V);
        let packs = [
            (Pack::Board, board_v, self.limits.board),
            (Pack::Motor, motor_v, self.limits.motor),
            (Pack::Servo, servo_v, self.limits.servo),
        ];
        let changes = self.judge(packs, now);
        let low = |gauge: Gauge| u8::from(gauge.charge > Charge::Well);
        let [board_low, motor_low, servo_low] = self.gauges.map(low);
        let power = PowerSample {
            board_v,
            motor_v,
            servo_v,
            driver_c: standard.overheat.map(driver_celsius),
            current_ad: self.currents,
            board_low,
            motor_low,
            servo_low,
            ..PowerSample::default()
        };
        let [alarm_1, motion_1, alarm_2, motion_2] = standard.human;
        let surroundings = SurroundingsSample {
            temperature_c: board_celsius(standard.temperature),
            human_alarm_ad: [alarm_1, alarm_2],
            human_motion_ad: [motion_1, motion_2],
            tilt_ad: standard.tilt,
            ..SurroundingsSample::default()
        };
        (power, surroundings, changes)
    }

    /// A custom frame; none before the first ranger was heard in a standard one.
    #[must_use]
    pub fn take_custom(&self, custom: &CustomSensors) -> Option<InfraredSample> {
        let [_, _, second, third, fourth, fifth, sixth, seventh] = custom.ad;
        let first = self.first_infrared?;
        let raw_ad = [first, second, third, fourth, fifth, sixth, seventh];
        Some(InfraredSample {
            range_m: raw_ad.map(infrared_m),
            raw_ad,
            ..InfraredSample::default()
        })
    }

    fn judge(&mut self, packs: [(Pack, f64, f64); 3], now: MissionTime) -> Vec<BatteryChange> {
        let mut changes = Vec::new();
        for (gauge, (pack, volts, limit)) in self.gauges.iter_mut().zip(packs) {
            let before = gauge.charge;
            let charge = gauge.read(volts, limit, now);
            if charge != before {
                changes.push(BatteryChange {
                    pack,
                    volts,
                    charge,
                });
            }
        }
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn telemetry() -> Telemetry {
        Telemetry::new(BatteryLimits {
            board: 6.6,
            motor: 11.0,
            servo: 0.0,
        })
    }

    /// AD counts of `volts` at a full scale.
    fn ad(volts: f64, scale: f64) -> u16 {
        (volts / scale * 4095.0).round() as u16
    }

    fn batteries(board_v: f64, motor_v: f64) -> StandardSensors {
        StandardSensors {
            board_battery: ad(board_v, 9.0),
            motor_battery: ad(motor_v, 24.0),
            servo_battery: ad(1.2, 9.0),
            ..StandardSensors::default()
        }
    }

    #[test]
    fn a_standard_frame_by_hand() {
        let mut telemetry = telemetry();
        telemetry.take_motor(&MotorSensors {
            currents: [1, 2, 3, 4, 5, 6],
            ..MotorSensors::default()
        });
        let standard = StandardSensors {
            human: [10, 20, 30, 40],
            tilt: [50, 60],
            // 100 - (1444 - 980) / 11.6 = 60; (1952 - 1256) / 34.8 = 20.
            overheat: [1444, 980],
            temperature: 1952,
            board_battery: 3276,
            motor_battery: 2048,
            ..StandardSensors::default()
        };
        let (power, surroundings, _) = telemetry.take_standard(&standard, MissionTime(0));
        assert!((power.board_v - 7.2).abs() < 1e-9);
        assert!((power.motor_v - 12.003).abs() < 1e-3);
        assert_eq!(power.driver_c, [60.0, 100.0]);
        assert_eq!(power.current_ad, [1, 2, 3, 4, 5, 6]);
        assert!((surroundings.temperature_c - 20.0).abs() < 1e-9);
        assert_eq!(surroundings.human_alarm_ad, [10, 30]);
        assert_eq!(surroundings.human_motion_ad, [20, 40]);
        assert_eq!(surroundings.tilt_ad, [50, 60]);
    }

    #[test]
    fn the_seven_infrared_rangers_come_from_two_frames() {
        let mut telemetry = telemetry();
        let custom = CustomSensors {
            ad: [9, 9, 1000, 0, 4095, 0, 0, 0],
            io: 0,
        };
        assert_eq!(telemetry.take_custom(&custom), None, "one is missing");
        telemetry.take_standard(
            &StandardSensors {
                infrared: 1000,
                ..StandardSensors::default()
            },
            MissionTime(0),
        );
        let infrared = telemetry.take_custom(&custom).unwrap();
        assert_eq!(infrared.raw_ad, [1000, 1000, 0, 4095, 0, 0, 0]);
        assert_eq!(infrared.range_m[2..4], [0.81, 0.09]);
        assert!((infrared.range_m[0] - 0.375_79).abs() < 1e-5);
    }

    #[test]
    fn a_low_battery_is_said_once_and_is_well_again_only_clearly_above_its_limit() {
        let mut telemetry = telemetry();
        let mut changes = |board_v| {
            let (power, _, changes) =
                telemetry.take_standard(&batteries(board_v, 12.0), MissionTime(0));
            let said: Vec<_> = changes
                .iter()
                .map(|change| (change.pack, change.charge))
                .collect();
            (power.board_low, said)
        };
        assert_eq!(changes(6.7), (0, vec![]));
        assert_eq!(changes(6.5), (1, vec![(Pack::Board, Charge::Low)]));
        assert_eq!(changes(6.4), (1, vec![]));
        assert_eq!(changes(6.8), (1, vec![]), "it recovers while nothing turns");
        assert_eq!(changes(7.0), (0, vec![(Pack::Board, Charge::Well)]));
    }

    #[test]
    fn each_battery_has_its_own_limit_and_one_that_is_not_there_is_not_low() {
        let mut telemetry = telemetry();
        let (power, _, _) = telemetry.take_standard(&batteries(7.2, 10.9), MissionTime(0));
        assert_eq!(
            (power.board_low, power.motor_low, power.servo_low),
            (0, 1, 0)
        );
        let (power, _, changes) = telemetry.take_standard(&batteries(7.2, 0.2), MissionTime(0));
        assert_eq!(power.motor_low, 0, "{changes:?}");
    }
    #[test]
    fn a_battery_that_stays_sunk_is_empty_for_good_and_one_that_dips_is_only_low() {
        let mut telemetry = telemetry();
        let mut at = |seconds: f64, motor_v| {
            let now = MissionTime::from_seconds(seconds);
            telemetry.take_standard(&batteries(7.2, motor_v), now);
            telemetry.charge()
        };
        // Low below 11 V, empty below 10.
        assert_eq!(at(0.0, 12.0), Charge::Well);
        assert_eq!(at(1.0, 9.9), Charge::Low);
        assert_eq!(at(2.9, 10.1), Charge::Low, "a dip");
        assert_eq!(at(3.0, 9.9), Charge::Low);
        assert_eq!(at(4.9, 9.9), Charge::Low);
        assert_eq!(at(5.0, 9.9), Charge::Empty);
        assert_eq!(at(6.0, 12.0), Charge::Empty, "it recovers at rest");
    }

    #[test]
    fn a_robot_drives_on_without_its_servos() {
        let mut telemetry = Telemetry::new(BatteryLimits::default());
        let servo_battery = ad(5.0, 9.0);
        let standard = StandardSensors {
            servo_battery,
            ..batteries(7.2, 7.2)
        };
        for seconds in [0.0, 5.0] {
            let now = MissionTime::from_seconds(seconds);
            let (power, _, _) = telemetry.take_standard(&standard, now);
            assert_eq!((power.servo_low, telemetry.charge()), (1, Charge::Well));
        }
    }
}
