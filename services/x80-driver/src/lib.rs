//! Driver of the X80.
//!
//! | module | holds |
//! |---|---|
//! | `drive` | motor frames in, timed commands out |
//! | `rangers` | readings of a tick |
//! | `telemetry` | other sensors, in the units of the topics |

mod drive;
mod rangers;
mod telemetry;

use common::{
    driver::{Base as _, Driver, Heard, Motion, WireTally, counts::wheel_sample},
    mission::{Channel, Mission},
    wire::{Command, Decoder, Report, SystemSignal},
};

use self::{
    drive::{encoded, index, wheel},
    rangers::Rangers,
};

#[derive(Debug)]
pub struct X80 {
    /// Left and right, or a car's wheel and steering.
    channels: [Channel; 2],
    decoder: Decoder,
    rangers: Rangers,
    /// Newest motor currents, for the next power sample.
    currents: [u16; 6],
}

impl X80 {
    pub fn new(mission: &Mission) -> Self {
        Self {
            channels: [mission.robot.left, mission.robot.right],
            decoder: Decoder::default(),
            rangers: Rangers::new(mission),
            currents: [0; 6],
        }
    }
}

impl Driver for X80 {
    fn hear(&mut self, bytes: &[u8]) -> Heard {
        self.decoder.push(bytes);
        let mut heard = Heard::default();
        let mut motor = None;
        let mut standard = None;
        let mut custom = None;
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
            self.currents = motor.currents;
            let both = self.channels.map(|channel| wheel(&motor, channel));
            let speeds = both.map(|encoder| encoder.velocity());
            let wheels = wheel_sample(both.map(|encoder| encoder.position), speeds);
            let currents = self.channels.map(|wheel| motor.currents[index(wheel)]);
            heard.motion = Some(Motion { wheels, currents, ..Motion::default() });
        }
        if let Some(standard) = standard {
            heard.readings = self.rangers.take_standard(&standard);
            heard.power = Some(telemetry::power(&standard, self.currents));
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

    /// Returns the setup: encoder feedback, velocity mode, enabled motors, running streams.
    fn greeting(&self) -> Vec<u8> {
        let settings = self.channels.into_iter().flat_map(|wheel| Command::drives(wheel.channel));
        settings.flat_map(encoded).chain(self.ask_for_sensors()).collect()
    }
}
