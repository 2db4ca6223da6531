//! What the robot's frames carry besides wheels and front sonar, in the units of the topics.

use common::{
    mission::BatteryLimits,
    samples::{InfraredSample, PowerSample, SurroundingsSample},
    wire::{
        CustomSensors, LOGIC_SCALE_V, MOTOR_SCALE_V, MotorSensors, StandardSensors, board_celsius,
        driver_celsius, infrared_m, volts,
    },
};

/// A battery that was low is well again this far above its limit, volts: a pack whose motors have just
/// stopped recovers by less.
const RECOVERED_V: f64 = 0.3;
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

/// A battery became low, or is no longer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatteryChange {
    /// Which.
    pub pack: Pack,
    /// What it gives, volts.
    pub volts: f64,
    /// Whether it is low now.
    pub low: bool,
}

/// Frames in, samples out; it remembers what a sample needs of another frame.
#[derive(Clone, Debug)]
pub struct Telemetry {
    limits: BatteryLimits,
    low: [bool; 3],
    currents: [u16; 6],
    /// The first infrared ranger comes in the standard frame, the other six in the custom one.
    first_infrared: Option<u16>,
}

impl Telemetry {
    /// With these limits of the batteries.
    #[must_use]
    pub const fn new(limits: BatteryLimits) -> Self {
        Self {
            limits,
            low: [false; 3],
            currents: [0; 6],
            first_infrared: None,
        }
    }

    /// A motor frame: its currents go with the next [`PowerSample`].
    pub const fn take_motor(&mut self, motor: &MotorSensors) {
        self.currents = motor.currents;
    }

    /// A standard frame.
    pub fn take_standard(
        &mut self,
        standard: &StandardSensors,
    ) -> (PowerSample, SurroundingsSample, Vec<BatteryChange>) {
        self.first_infrared = Some(standard.infrared);
        let board_v = volts(standard.board_battery, LOGIC_SCALE_V);
        let motor_v = volts(standard.motor_battery, MOTOR_SCALE_V);
        let servo_v = volts(standard.servo_battery, LOGIC_SCALE_V);
        let changes = self.judge([
            (Pack::Board, board_v, self.limits.board),
            (Pack::Motor, motor_v, self.limits.motor),
            (Pack::Servo, servo_v, self.limits.servo),
        ]);
        let [board_low, motor_low, servo_low] = self.low.map(u8::from);
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

    fn judge(&mut self, packs: [(Pack, f64, f64); 3]) -> Vec<BatteryChange> {
        let mut changes = Vec::new();
        for (was_low, (pack, volts, limit)) in self.low.iter_mut().zip(packs) {
            let ends = if *was_low { limit + RECOVERED_V } else { limit };
            let low = volts >= FITTED_V && volts < ends;
            if low != *was_low {
                *was_low = low;
                changes.push(BatteryChange { pack, volts, low });
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
        let (power, surroundings, _) = telemetry.take_standard(&standard);
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
        telemetry.take_standard(&StandardSensors {
            infrared: 1000,
            ..StandardSensors::default()
        });
        let infrared = telemetry.take_custom(&custom).unwrap();
        assert_eq!(infrared.raw_ad, [1000, 1000, 0, 4095, 0, 0, 0]);
        assert_eq!(infrared.range_m[2..4], [0.81, 0.09]);
        assert!((infrared.range_m[0] - 0.375_79).abs() < 1e-5);
    }

    #[test]
    fn a_low_battery_is_said_once_and_is_well_again_only_clearly_above_its_limit() {
        let mut telemetry = telemetry();
        let mut changes = |board_v| {
            let (power, _, changes) = telemetry.take_standard(&batteries(board_v, 12.0));
            let said: Vec<_> = changes
                .iter()
                .map(|change| (change.pack, change.low))
                .collect();
            (power.board_low, said)
        };
        assert_eq!(changes(6.7), (0, vec![]));
        assert_eq!(changes(6.5), (1, vec![(Pack::Board, true)]));
        assert_eq!(changes(6.4), (1, vec![]));
        assert_eq!(changes(6.8), (1, vec![]), "it recovers while nothing turns");
        assert_eq!(changes(7.0), (0, vec![(Pack::Board, false)]));
    }

    #[test]
    fn each_battery_has_its_own_limit_and_one_that_is_not_there_is_not_low() {
        let mut telemetry = telemetry();
        let (power, _, _) = telemetry.take_standard(&batteries(7.2, 10.9));
        assert_eq!(
            (power.board_low, power.motor_low, power.servo_low),
            (0, 1, 0)
        );
        let (power, _, changes) = telemetry.take_standard(&batteries(7.2, 0.2));
        assert_eq!(power.motor_low, 0, "{changes:?}");
    }
}
