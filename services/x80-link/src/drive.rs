//! The two wheels of the robot, or a car's driven wheel and steering: counts of motor frames in, timed commands out, each with the
//! channels and signs of the mission.

use std::time::Duration;

use common::{
    mission::{Body, Channel, Mission, RobotConfig},
    samples::{CommandSample, WheelSample},
    wire::{
        Addressing, CHANNELS, COUNT_CYCLE, Command, Encoder, Feedback, Mode, Motion, MotorSensors,
        Parameter, Quantity, Request, Stream, Targets, counts_between,
    },
};

/// The share of the remaining angle that the steering turns in a tick. It is below 1 so that the delay of the speed loop does not
/// make the steering oscillate.
const STEERING_GAIN: f64 = 0.6;

/// The pulse width at which a wheel does not turn.
const PWM_STANDS: i16 = 16_384;

/// Converts between samples and the robot's frames for its wheels.
#[derive(Clone, Debug)]
pub struct Drive {
    robot: RobotConfig,
    body: Body,
    limit: Duration,
}

impl Drive {
    /// The drive of `mission`'s robot.
    pub fn new(mission: &Mission) -> Self {
        Self {
            robot: mission.robot.clone(),
            body: mission.body(),
            limit: Duration::from_secs_f64(mission.robot.command_limit_s),
        }
    }

    /// Commands for encoders as feedback, velocity mode, enabled motors and running streams.
    pub fn greeting(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut say = |command: Command| command.encode(Addressing::default(), &mut bytes);
        for channel in [self.robot.left.channel, self.robot.right.channel] {
            for parameter in
                [Parameter::Feedback(Feedback::Encoder), Parameter::Mode(Mode::Velocity)]
            {
                say(Command::Parameter { channel, parameter });
            }
            say(Command::Enable { on: true, channel: Some(channel) });
        }
        bytes.extend(self.streams());
        bytes
    }

    /// Commands for running streams.
    pub fn streams(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        for stream in [Stream::Motor, Stream::Custom, Stream::Standard] {
            let request = Request::Start;
            Command::Stream { stream, request }.encode(Addressing::default(), &mut bytes);
        }
        bytes
    }

    /// The counts of a motor frame, growing forward.
    pub fn wheels(&self, sensors: &MotorSensors) -> WheelSample {
        let left = self.wheel(sensors, self.robot.left);
        let right = self.wheel(sensors, self.robot.right);
        WheelSample {
            left_counts: left.position,
            right_counts: right.position,
            left_counts_per_s: left.velocity(),
            right_counts_per_s: right.velocity(),
            ..WheelSample::default()
        }
    }

    /// The motor currents of the left and the right wheel, AD counts.
    pub fn currents(&self, sensors: &MotorSensors) -> [u16; 2] {
        let channels = [self.robot.left, self.robot.right];
        channels.map(|wheel| sensors.currents[usize::from(wheel.channel.min(1))])
    }

    /// A channel's encoder, turned so that it grows forward.
    fn wheel(&self, sensors: &MotorSensors, channel: Channel) -> Encoder {
        let encoder = sensors.encoders[usize::from(channel.channel.min(1))];
        if !channel.reversed {
            return encoder;
        }
        Encoder {
            position: (COUNT_CYCLE - encoder.position % COUNT_CYCLE) % COUNT_CYCLE,
            positive: !encoder.positive,
            ..encoder
        }
    }

    /// The speeds of the two channels for `command` at `share` of its speed, counts/s; `wheels` are the present encoder counts. A car's
    /// steering is a channel with a speed loop like a wheel's and is driven towards its angle, so its motion ends with a timed
    /// command too.
    pub fn counts(&self, command: &CommandSample, share: f64, wheels: &WheelSample) -> [i16; 2] {
        let driven = self.counts_per_second(share * command.left_rad_s);
        let Some(steering) = self.body.steering else {
            return [driven, self.counts_per_second(share * command.right_rad_s)];
        };
        let angle = command.right_rad_s.clamp(-steering.limit_rad, steering.limit_rad);
        let left = steering.counts(angle) - f64::from(counts_between(0, wheels.right_counts));
        let top = steering.counts(steering.rate_rad_s);
        let rate = (left * STEERING_GAIN * self.robot.rate_hz).clamp(-top, top);
        [driven, on_the_wire(rate)]
    }

    /// Convert rad/s to counts/s, limited to the wheel's top speed; NaN gives 0.
    fn counts_per_second(&self, speed: f64) -> i16 {
        let per_radian = self.body.counts_per_turn / std::f64::consts::TAU;
        let top = self.body.top_speed_m_s / self.body.metres_per_count();
        on_the_wire((speed * per_radian).clamp(-top, top))
    }

    /// A velocity command with a time limit. A robot that respects the limit stops by itself when the link has ended.
    pub fn velocity(&self, [left, right]: [i16; 2], limit: Duration) -> Vec<u8> {
        let mut channels = [None; 2];
        for (channel, counts) in [(self.robot.left, left), (self.robot.right, right)] {
            let signed = if channel.reversed { -counts } else { counts };
            channels[usize::from(channel.channel.min(1))] = Some(signed);
        }
        let limit_ms = limit.as_millis().min(u128::from(u16::MAX)) as u16;
        encoded(Command::velocity(channels, limit_ms))
    }

    /// A command that holds the wheels at rest.
    pub fn stand(&self) -> Vec<u8> {
        self.velocity([0, 0], self.limit)
    }

    /// Commands that disable the motors of both wheels.
    pub fn disable(&self) -> Vec<u8> {
        let channels = [self.robot.left.channel, self.robot.right.channel].map(Some);
        channels.map(|channel| encoded(Command::Enable { on: false, channel })).concat()
    }

    /// A command that gives both wheels the pulse width at which they do not turn.
    pub fn still_pulses(&self) -> Vec<u8> {
        let mut targets = [None; CHANNELS];
        for wheel in [self.robot.left.channel, self.robot.right.channel] {
            targets[usize::from(wheel.min(1))] = Some(PWM_STANDS);
        }
        encoded(Command::Motion(Motion {
            quantity: Quantity::Pwm,
            targets: Targets::All(targets),
            limit_ms: None,
        }))
    }
}

/// Round counts/s to a command's integers; NaN gives 0.
fn on_the_wire(counts: f64) -> i16 {
    // -32768 and -32767 mean that the channel is not changed.
    counts.round().clamp(-32_766.0, 32_766.0) as i16
}

/// The frame of a command.
pub fn encoded(command: Command) -> Vec<u8> {
    let mut bytes = Vec::new();
    command.encode(Addressing::default(), &mut bytes);
    bytes
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// The speeds for a car whose steering encoder reads `counts`, at 7 Hz with 3600 counts a turn.
    fn counts(left_rad_s: f64, angle: f64, share: f64, counts: u16) -> [i16; 2] {
        let text = "target = [3, 0]\nrobot.model = 'car'";
        let drive = Drive::new(&Mission::parse(text, Path::new("m.toml")).unwrap());
        let command = CommandSample { left_rad_s, right_rad_s: angle, ..CommandSample::default() };
        let wheels = WheelSample { right_counts: counts, ..WheelSample::default() };
        drive.counts(&command, share, &wheels)
    }

    #[test]
    fn a_cars_steering_is_driven_towards_its_angle() {
        // 5 degrees are 50 counts; a tick turns 0.6 of the remaining angle.
        let five = 5_f64.to_radians();
        assert_eq!(counts(0.0, five, 1.0, 0), [0, 210]);
        assert_eq!(counts(0.0, five, 1.0, 50), [0, 0]);
        assert_eq!(counts(0.0, -five, 1.0, COUNT_CYCLE - 25), [0, -105]);
    }

    #[test]
    fn a_cars_steering_is_limited_in_angle_and_rate_and_no_number_holds_it() {
        // 1200 counts a second at most; 30 degrees are 300 counts.
        assert_eq!(counts(0.0, 1.5, 1.0, 0), [0, 1200]);
        assert_eq!(counts(0.0, 1.5, 1.0, 300), [0, 0]);
        assert_eq!(counts(f64::NAN, f64::NAN, 1.0, 7), [0, 0]);
    }

    #[test]
    fn a_slowed_car_keeps_its_curve() {
        let five = 5_f64.to_radians();
        let tau = std::f64::consts::TAU;
        assert_eq!(counts(tau, five, 1.0, 0), [600, 210]);
        assert_eq!(counts(tau, five, 0.5, 0), [300, 210]);
    }
}
