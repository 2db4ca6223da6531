//! JSON-line protocol: orders become commands of simulated X80 boards, their readings reports.

use std::{collections::BTreeMap, f64::consts::TAU};

use common::{
    json_wire::{Order, Report, Scan, line},
    mission::{Mission, RobotConfig, Sensor, SensorKind},
    wire::{
        Command, CustomSensors, Echo, INFRARED_LIVE_AD, MOTOR_SCALE_V, MotorSensors,
        StandardSensors, infrared_m, volts,
    },
};

use crate::{
    drivetrain::{OnChannel, velocity},
    laser::Laser,
    motor::Motor,
    sensors::STALL_CURRENT,
};

pub struct JsonWords {
    wheels: [OnChannel; 2],
    held_current_ad: f64,
    counts_per_radian: f64,
    table: Vec<Sensor>,
    heard: u64,
}

impl JsonWords {
    pub fn new(mission: &Mission) -> Self {
        Self {
            // The firmware assumes the usual wiring; the mission's is the real one.
            wheels: OnChannel::left_and_right(&RobotConfig::default()),
            held_current_ad: mission.robot.held_current_ad.into(),
            counts_per_radian: mission.body().counts_per_turn / TAU,
            table: mission.sensor_table(),
            heard: 0,
        }
    }

    pub fn commands(&mut self, order: &Order) -> Vec<Command> {
        self.heard += 1;
        let channels = self.wheels.map(|wheel| wheel.channel as u8);
        match *order {
            Order::Hello { .. } => channels.map(Command::drives).concat(),
            Order::Drive { wheels: speeds, for_s, .. } => {
                // A time of 0 would be a command without an end.
                let limit_ms = (for_s * 1000.0).round().clamp(1.0, f64::from(u16::MAX));
                let counts = speeds.map(|speed| speed * self.counts_per_radian);
                vec![velocity(self.wheels, counts, limit_ms as u16)]
            }
            Order::Brake {} => {
                channels.map(|channel| Command::Enable { on: false, channel: Some(channel) }).into()
            }
            Order::Ping {} => Vec::new(),
        }
    }

    pub fn acknowledgement(&self) -> Vec<u8> {
        line(&Report { heard: Some(self.heard), ..Report::default() })
    }

    pub fn report(
        &self,
        (standard, custom, motor): (&StandardSensors, &CustomSensors, &MotorSensors),
        lasers: &[Laser],
        touched: BTreeMap<String, bool>,
        motors: &[Motor; 6],
        gyro: Option<f64>,
    ) -> Vec<u8> {
        let of = |value: &dyn Fn(usize) -> f64| {
            self.wheels
                .map(|OnChannel { channel, sign }| sign * value(channel) / self.counts_per_radian)
        };
        // A rolling motor's current is omitted: it is scaled for an X80's counts, and other robots
        // have more per turn.
        let held = self.wheels.map(|wheel| {
            let motor = &motors[wheel.channel];
            motor.enabled && STALL_CURRENT * motor.load >= self.held_current_ad
        });
        let ranges = self.table.iter().filter_map(|sensor| {
            let channel = usize::from(sensor.channel);
            let range = match sensor.kind {
                SensorKind::Scan => return None,
                SensorKind::Cone => standard.ultrasonic.get(channel).and_then(|byte| heard(*byte)),
                SensorKind::Ray => infrared(standard, custom, channel),
            };
            Some((sensor.name.clone(), range))
        });
        let said = |laser: &Laser| Some((laser.sensor.name.clone(), laser.said()?));
        let mut scans: BTreeMap<_, _> = lasers.iter().filter_map(said).collect();
        let only = if lasers.len() == 1 { scans.pop_first() } else { None };
        let (scan, [scan_age_s, scan_time_s]) = match only {
            Some((_, Scan { ranges, age_s, time_s })) => (Some(ranges), [age_s, time_s]),
            None => (None, [None; 2]),
        };
        line(&Report {
            gyro,
            heard: Some(self.heard),
            wheels: Some(of(&|channel| turned(motor, motors, channel))),
            speeds: Some(of(&|channel| f64::from(motor.encoders[channel].velocity()))),
            held: Some(held),
            ranges: ranges.collect(),
            battery_v: Some(volts(standard.motor_battery, MOTOR_SCALE_V)),
            scan,
            scan_age_s,
            scan_time_s,
            scans,
            touched,
            ..Report::default()
        })
    }
}

fn turned(sensors: &MotorSensors, motors: &[Motor; 6], channel: usize) -> f64 {
    let cycle = f64::from(common::wire::COUNT_CYCLE);
    let (read, true_counts) =
        (f64::from(sensors.encoders[channel].position), motors[channel].turned);
    read + ((true_counts - read) / cycle).round() * cycle
}

/// Returns metres: negative for no reading, `None` for nothing in reach.
fn heard(byte: u8) -> Option<f64> {
    match Echo::from_byte(byte) {
        None => Some(-1.0),
        Some(Echo::Nothing) => None,
        Some(echo) => echo.metres().or(Some(0.0)),
    }
}

fn infrared(standard: &StandardSensors, custom: &CustomSensors, channel: usize) -> Option<f64> {
    let ad = match channel {
        0 => standard.infrared,
        further => custom.ad.get(further + 1).copied().unwrap_or_default(),
    };
    if !INFRARED_LIVE_AD.contains(&ad) {
        return Some(-1.0);
    }
    Some(infrared_m(ad)).filter(|range| *range < infrared_m(0))
}
