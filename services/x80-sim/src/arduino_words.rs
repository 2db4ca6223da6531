//! ROSArduinoBridge protocol: requests become commands of simulated X80 boards, their readings
//! answers. Sonar readings are the newest tick's.

use common::{
    mission::{ArduinoBoard, Mission, RobotConfig},
    wire::{Command, Echo, StandardSensors},
};

use crate::{
    drivetrain::{OnChannel, velocity},
    motor::Motor,
};

/// Deaf time of a restarted board: its boot loader waits for a program.
const BOOTS_S: f64 = 1.5;
/// Since the last command.
const STOPS_AFTER_MS: u16 = 2000;
const LONGEST: usize = 64;

#[derive(Clone, Copy)]
pub enum Request {
    /// `e`: the encoder counts.
    Counts,
    /// `r`: count from 0.
    Reset,
    /// `m`: left and right, counts per run of the speed loop.
    Speeds([i16; 2]),
    /// `p`: the sonar on this pin.
    Range(i16),
    Baud,
    Unknown,
}

impl Request {
    /// Parses a line without carriage return. A missing or invalid number is 0, as in the firmware.
    fn parse(line: &[u8]) -> Self {
        let text = String::from_utf8_lossy(line);
        let mut words = text.split(' ');
        let name = words.next().unwrap_or_default();
        let mut number = || words.next().and_then(|word| word.parse().ok()).unwrap_or(0);
        match name {
            "e" => Self::Counts,
            "r" => Self::Reset,
            "m" => Self::Speeds([number(), number()]),
            "p" => Self::Range(number()),
            "b" => Self::Baud,
            _ => Self::Unknown,
        }
    }
}

#[derive(Default)]
pub struct Requests {
    held: Vec<u8>,
}

impl Requests {
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Request> {
        let mut complete = Vec::new();
        for byte in bytes {
            if *byte == b'\r' {
                complete.push(Request::parse(&std::mem::take(&mut self.held)));
            } else if self.held.len() < LONGEST {
                self.held.push(*byte);
            }
        }
        complete
    }
}

pub struct ArduinoWords {
    board: ArduinoBoard,
    wheels: [OnChannel; 2],
    sonars: Vec<(i16, usize)>,
    /// Counts that the board calls 0.
    zero: [f64; 2],
    /// Mission time in seconds; none after boot.
    boots_until: Option<f64>,
}

impl ArduinoWords {
    pub fn new(mission: &Mission) -> Self {
        let pins = &mission.robot.arduino.sonars;
        let table = mission.sensor_table().into_iter();
        let pin = |name: &String| pins.get(name).copied().map(i16::from);
        let sonars = table.filter_map(|row| Some((pin(&row.name)?, usize::from(row.channel))));
        Self {
            board: mission.robot.arduino.clone(),
            // The firmware assumes the usual wiring; the mission's is the real one.
            wheels: OnChannel::left_and_right(&RobotConfig::default()),
            sonars: sonars.collect(),
            zero: [0.0; 2],
            boots_until: None,
        }
    }

    pub fn boot(&mut self, now: f64) {
        self.boots_until = Some(now + BOOTS_S);
    }

    /// Returns whether the board is up; a rebooted one counts from 0.
    pub fn hears(&mut self, now: f64, motors: &[Motor; 6]) -> bool {
        if self.boots_until.is_some_and(|until| now < until) {
            return false;
        }
        if self.boots_until.take().is_some() {
            self.zero = self.turned(motors);
        }
        true
    }

    pub fn answer(
        &mut self,
        request: Request,
        sensors: &StandardSensors,
        motors: &[Motor; 6],
        gyro: Option<f64>,
    ) -> (String, Option<Command>) {
        let mut command = None;
        let text = match request {
            Request::Counts => {
                let [left, right] = self.counts(motors);
                let gyro = gyro.map_or_else(String::new, |rad| format!(" {}", (rad * 1e4) as i32));
                format!("{left} {right}{gyro}")
            }
            Request::Reset => {
                self.zero = self.turned(motors);
                "OK".to_owned()
            }
            Request::Speeds(speeds) => {
                let counts = speeds.map(|speed| f64::from(speed) * self.board.pid_rate_hz);
                command = Some(velocity(self.wheels, counts, STOPS_AFTER_MS));
                "OK".to_owned()
            }
            Request::Range(pin) => {
                let channel = self.sonars.iter().find(|sonar| sonar.0 == pin);
                let byte = channel.and_then(|(_, channel)| sensors.ultrasonic.get(*channel));
                let metres = byte.and_then(|byte| Echo::from_byte(*byte)?.metres());
                format!("{}", (metres.unwrap_or_default() * 100.0).round() as i32)
            }
            Request::Baud => format!(" {}", self.board.baud),
            Request::Unknown => "Invalid Command".to_owned(),
        };
        (text + "\r\n", command)
    }

    pub fn counts(&self, motors: &[Motor; 6]) -> [i32; 2] {
        let turned = self.turned(motors);
        [0, 1].map(|wheel| (turned[wheel] - self.zero[wheel]).round() as i64 as i32)
    }

    fn turned(&self, motors: &[Motor; 6]) -> [f64; 2] {
        self.wheels.map(|wheel| wheel.turned(motors))
    }
}
