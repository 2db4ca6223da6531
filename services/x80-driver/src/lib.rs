//! Driver of the X80.
//!
//! | module | holds |
//! |---|---|
//! | [`drive`] | motor frames in, timed commands out |
//! | `rangers` | readings of a tick |
//! | [`telemetry`] | other sensors, in the units of the topics |

pub mod drive;
mod rangers;
pub mod telemetry;

use std::time::Duration;

use common::{
    driver::{Base, Driver, Heard, Motion, StopMethod, WireTally},
    mission::Mission,
    wire::{Command, Decoder, Report, SystemSignal},
};

use self::{
    drive::{Drive, encoded},
    rangers::Rangers,
    telemetry::Telemetry,
};

#[derive(Debug)]
pub struct X80 {
    drive: Drive,
    decoder: Decoder,
    rangers: Rangers,
    telemetry: Telemetry,
}

impl X80 {
    pub fn new(mission: &Mission) -> Self {
        Self {
            drive: Drive::new(mission),
            decoder: Decoder::default(),
            rangers: Rangers::new(mission),
            telemetry: Telemetry::default(),
        }
    }
}

impl Driver for X80 {
    fn hear(&mut self, bytes: &[u8]) -> Heard {
        self.decoder.push(bytes);
        let mut heard = Heard::default();
        let (mut motor, mut standard, mut custom) = (None, None, None);
        while let Some(frame) = self.decoder.next_frame() {
            match Report::parse(&frame) {
                Ok(Report::Standard(sensors)) => standard = Some(sensors),
                Ok(Report::Custom(sensors)) => custom = Some(sensors),
                Ok(Report::Motor(sensors)) => motor = Some(sensors),
                Ok(Report::System(SystemSignal::Ping)) => heard.pinged = true,
                Ok(Report::System(SystemSignal::Ack)) => heard.acknowledged += 1,
                // Any other frame only shows that the robot answers.
                Err(_) => {}
            }
            heard.anything = true;
        }
        if let Some(motor) = motor {
            self.telemetry.take_motor(&motor);
            let (wheels, currents) = (self.drive.wheels(&motor), self.drive.currents(&motor));
            heard.motion = Some(Motion { wheels, endless: None, stamp_ns: None, currents });
        }
        if let Some(standard) = standard {
            heard.readings = self.rangers.take_standard(&standard);
            heard.power = Some(self.telemetry.power(&standard));
            heard.surroundings = Some(telemetry::surroundings(&standard));
        }
        if let Some((infrared, readings)) =
            custom.and_then(|custom| self.rangers.take_custom(&custom))
        {
            heard.infrared = Some(infrared);
            heard.readings.extend(readings);
        }
        heard
    }

    fn reset(&mut self) {
        self.decoder.reset();
    }

    fn tally(&self) -> WireTally {
        let tally = self.decoder.tally();
        WireTally { messages: tally.frames, bytes_dropped: tally.noise_bytes + tally.dropped_bytes }
    }

    fn greeting(&self) -> Vec<u8> {
        self.drive.greeting()
    }
}

impl Base for X80 {
    fn ask_for_sensors(&self) -> Vec<u8> {
        self.drive.streams()
    }

    fn ping(&self) -> Vec<u8> {
        encoded(Command::System(SystemSignal::Ping))
    }

    fn acknowledge(&self) -> Vec<u8> {
        encoded(Command::System(SystemSignal::Ack))
    }

    fn owed(&self, sent: &[u8]) -> usize {
        let mut decoder = Decoder::default();
        decoder.push(sent);
        std::iter::from_fn(|| decoder.next_frame().map(drop)).count()
    }

    fn velocity(&self, counts: [i16; 2], limit: Duration) -> Vec<u8> {
        self.drive.velocity(counts, limit)
    }

    fn other_stops(&self) -> Vec<StopMethod> {
        let suspend = encoded(Command::Enable { on: false, channel: None });
        vec![
            StopMethod { name: "disable", bytes: self.drive.disable() },
            StopMethod { name: "pulse width 0", bytes: self.drive.still_pulses() },
            StopMethod { name: "suspend", bytes: suspend },
        ]
    }
}
