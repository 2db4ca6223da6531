//! One channel of the motor board, and the speed loop of the wheel on it. Everything is in the channel's
//! own positive direction, in encoder counts and counts per second.

use std::collections::VecDeque;

use common::{
    mission::WheelPhysics,
    wire::{COUNT_CYCLE, Feedback, Gains, Mode, Parameter, Quantity},
};

use crate::noise::Noise;

/// Pulse width at which a wheel stands.
const PWM_STOP: f64 = 16_383.5;
/// Speed per count of position error, 1/s: a position is reached in about a second.
const POSITION_GAIN: f64 = 4.0;
/// Below this friction holds a wheel that is told to stand, counts per second (2 mm/s).
const STANDSTILL: f64 = 5.0;
/// Changes of the target under way through the delay. At 5 ms a step this is more than the longest
/// delay holds; a host that sends faster overwrites its newest.
const MOST_PENDING: usize = 1024;

/// PID gains of one loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PidGains {
    /// Proportional.
    pub kp: u16,
    /// Derivative.
    pub kd: u16,
    /// Integral, times 100.
    pub ki_x100: u16,
}

impl PidGains {
    /// What a board boots with.
    const BOOT: Self = Self {
        kp: 50,
        kd: 5,
        ki_x100: 0,
    };

    fn set(&mut self, gains: Gains) {
        self.kp = gains.kp.unwrap_or(self.kp);
        self.kd = gains.kd.unwrap_or(self.kd);
        self.ki_x100 = gains.ki_x100.unwrap_or(self.ki_x100);
    }
}

/// What a channel has been told and how far its wheel has turned.
#[derive(Clone, Debug)]
pub struct Motor {
    physics: WheelPhysics,
    /// The most the wheel can do, counts per second.
    top_speed: f64,
    enabled: bool,
    mode: Mode,
    feedback: Feedback,
    position_pid: PidGains,
    velocity_pid: PidGains,
    order: Option<Order>,
    /// When the target became what, before the delay.
    pending: VecDeque<(f64, f64)>,
    /// The target that the loop follows.
    target: f64,
    speed: f64,
    turned: f64,
}

/// A motion command that still holds.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Order {
    quantity: Quantity,
    value: i16,
    /// Mission time at which it ends.
    until: Option<f64>,
}

impl Motor {
    /// A channel as it boots: suspended, PWM mode, one potentiometer as feedback.
    #[must_use]
    pub fn new(physics: WheelPhysics, top_speed: f64) -> Self {
        Self {
            physics,
            top_speed,
            enabled: false,
            mode: Mode::Pwm,
            feedback: Feedback::OnePot,
            position_pid: PidGains::BOOT,
            velocity_pid: PidGains::BOOT,
            order: None,
            pending: VecDeque::new(),
            target: 0.0,
            speed: 0.0,
            turned: 0.0,
        }
    }

    /// Whether it may run.
    #[must_use]
    pub fn enabled(&self) -> bool {
        self.enabled
    }

    /// What its loop controls.
    #[must_use]
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// What its loop measures itself by.
    #[must_use]
    pub fn feedback(&self) -> Feedback {
        self.feedback
    }

    /// Gains of the position loop and of the velocity loop. They are kept and reported; the simulated
    /// loop is the one that was measured, whatever its gains.
    #[must_use]
    pub fn gains(&self) -> (PidGains, PidGains) {
        (self.position_pid, self.velocity_pid)
    }

    /// Counts per second.
    #[must_use]
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Counts since boot.
    #[must_use]
    pub fn turned(&self) -> f64 {
        self.turned
    }

    /// Obey a motion command until mission time `until`. It brings its mode along and lets the motor run.
    pub fn order(&mut self, quantity: Quantity, value: i16, until: Option<f64>) {
        self.enabled = true;
        self.mode = match quantity {
            Quantity::Position => Mode::Position,
            Quantity::Pwm => Mode::Pwm,
            Quantity::Velocity => Mode::Velocity,
        };
        self.order = Some(Order {
            quantity,
            value,
            until,
        });
    }

    /// Let it run, or suspend it. A suspended motor forgets its order.
    pub fn enable(&mut self, on: bool) {
        self.enabled = on;
        if !on {
            self.order = None;
        }
    }

    /// Forget the order: stand.
    pub fn halt(&mut self) {
        self.order = None;
    }

    /// Set a parameter.
    pub fn configure(&mut self, parameter: Parameter) {
        match parameter {
            Parameter::PositionPid(gains) => self.position_pid.set(gains),
            Parameter::VelocityPid(gains) => self.velocity_pid.set(gains),
            Parameter::Feedback(feedback) => self.feedback = feedback,
            Parameter::Mode(mode) => {
                if mode != self.mode {
                    self.order = None;
                }
                self.mode = mode;
            }
            Parameter::Other { .. } => {}
        }
    }

    /// When the order ends, mission time: no step may reach across it.
    #[must_use]
    pub fn ends_at(&self) -> Option<f64> {
        self.order.and_then(|order| order.until)
    }

    /// Follow the order from mission time `now` for `dt` seconds. Returns the counts the loop asks of the
    /// wheel.
    pub fn step(&mut self, now: f64, dt: f64, noise: &mut Noise) -> f64 {
        if self.ends_at().is_some_and(|end| now >= end) {
            self.order = None;
        }
        let wanted = self.wanted(now);
        if self.pending.back().map_or(self.target, |last| last.1) != wanted {
            if self.pending.len() >= MOST_PENDING {
                self.pending.pop_back();
            }
            self.pending.push_back((now, wanted));
        }
        while let Some(&(since, target)) = self.pending.front() {
            if since + self.physics.delay_s > now + dt / 2.0 {
                break;
            }
            self.target = target;
            self.pending.pop_front();
        }
        let decay = if self.physics.lag_s > 0.0 {
            (-dt / self.physics.lag_s).exp()
        } else {
            0.0
        };
        // The way of an exponential approach is its integral, not its end times dt.
        let behind = self.speed - self.target;
        let counts = self.target * dt + behind * self.physics.lag_s * (1.0 - decay);
        self.speed = self.target + behind * decay;
        let mut jitter = 0.0;
        if self.target != 0.0 {
            let sd = self.physics.noise_counts * (1.0 - decay * decay).sqrt();
            jitter = noise.normal(sd);
            self.speed += jitter;
        } else if self.speed.abs() < STANDSTILL {
            self.speed = 0.0;
        }
        counts + jitter * dt
    }

    /// The wheel has really turned by `counts` in `dt` seconds. One whose body is `held` loses the speed
    /// it could not turn with; a push gives it none.
    pub fn turn(&mut self, counts: f64, dt: f64, held: bool) {
        self.turned += counts;
        if held && dt > 0.0 {
            let real = counts / dt;
            self.speed = real.clamp(self.speed.min(0.0), self.speed.max(0.0));
        }
    }

    /// The speed that the order asks for at mission time `now`, gain, dead band and limit applied.
    fn wanted(&self, now: f64) -> f64 {
        let Some(order) = self.order.filter(|_| self.enabled) else {
            return 0.0;
        };
        let value = f64::from(order.value);
        let asked = match order.quantity {
            Quantity::Velocity => value * self.physics.gain,
            Quantity::Pwm => {
                let duty = value - PWM_STOP;
                if duty.abs() < 1.0 {
                    0.0
                } else {
                    duty / PWM_STOP * self.top_speed
                }
            }
            Quantity::Position => {
                let cycle = f64::from(COUNT_CYCLE);
                let way = (value - self.turned).rem_euclid(cycle);
                let way = if way > cycle / 2.0 { way - cycle } else { way };
                match order.until {
                    Some(end) => way / (end - now).max(1.0 / POSITION_GAIN),
                    None => way * POSITION_GAIN,
                }
            }
        };
        if asked.abs() < self.physics.dead_band_counts {
            return 0.0;
        }
        asked.clamp(-self.top_speed, self.top_speed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Source;
    use common::mission::Realism;

    const DT: f64 = 0.005;

    fn ideal() -> WheelPhysics {
        WheelPhysics {
            lag_s: 0.0,
            ..WheelPhysics::preset(Realism::Laboratory)
        }
    }

    /// Run for `seconds` from mission time `from`; the speed at every step.
    fn run(motor: &mut Motor, from: f64, seconds: f64) -> Vec<f64> {
        let mut noise = Noise::new(1, Source::Wheels);
        let steps = (seconds / DT).round() as usize;
        (0..steps)
            .map(|step| {
                let counts = motor.step(from + step as f64 * DT, DT, &mut noise);
                motor.turn(counts, DT, false);
                motor.speed()
            })
            .collect()
    }

    #[test]
    fn it_boots_suspended_in_pwm_mode_on_one_pot_with_50_5_0() {
        let motor = Motor::new(ideal(), 2000.0);
        assert!(!motor.enabled());
        assert_eq!(
            (motor.mode(), motor.feedback()),
            (Mode::Pwm, Feedback::OnePot)
        );
        let boot = PidGains {
            kp: 50,
            kd: 5,
            ki_x100: 0,
        };
        assert_eq!(motor.gains(), (boot, boot));
    }

    #[test]
    fn a_velocity_command_alone_turns_the_wheel_and_ends_in_time() {
        let mut motor = Motor::new(ideal(), 2000.0);
        motor.order(Quantity::Velocity, 400, Some(0.5));
        run(&mut motor, 0.0, 2.0);
        assert!((motor.turned() - 200.0).abs() < 1e-6, "{}", motor.turned());
        assert_eq!(motor.speed(), 0.0);
    }

    #[test]
    fn the_measured_loop_has_its_gain_and_answers_late() {
        let physics = WheelPhysics {
            noise_counts: 0.0,
            ..WheelPhysics::preset(Realism::Measured)
        };
        let mut motor = Motor::new(physics, 2000.0);
        motor.order(Quantity::Velocity, 500, None);
        let speeds = run(&mut motor, 0.0, 2.0);
        let steady = 500.0 * physics.gain;
        assert!((speeds[399] - steady).abs() < 0.01);
        let late = speeds.iter().position(|s| *s > 0.63 * steady).unwrap() as f64 * DT;
        assert!((0.14..=0.16).contains(&late), "delay and lag are {late} s");
        motor.order(Quantity::Velocity, 25, None);
        assert_eq!(
            run(&mut motor, 2.0, 2.0)[399],
            0.0,
            "25 * 0.78 lies in the dead band"
        );
    }

    #[test]
    fn a_turning_wheel_jitters_as_much_as_measured_and_a_standing_one_not_at_all() {
        let mut motor = Motor::new(WheelPhysics::preset(Realism::Measured), 2000.0);
        motor.order(Quantity::Velocity, 500, Some(100.0));
        let speeds = run(&mut motor, 0.0, 100.0);
        let settled = &speeds[200..];
        let mean = settled.iter().sum::<f64>() / settled.len() as f64;
        let variance =
            settled.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / settled.len() as f64;
        assert!((variance.sqrt() - 12.0).abs() < 1.0, "{}", variance.sqrt());
        let standing = run(&mut motor, 100.0, 4.0);
        assert_eq!(standing[799], 0.0);
    }

    #[test]
    fn a_position_is_reached_the_shorter_way_round_and_held() {
        let mut motor = Motor::new(ideal(), 2000.0);
        motor.order(Quantity::Position, 32_700, None);
        run(&mut motor, 0.0, 4.0);
        assert!((motor.turned() + 68.0).abs() < 0.5, "{}", motor.turned());
    }

    #[test]
    fn half_a_pulse_width_stands_and_a_full_one_is_top_speed() {
        let mut motor = Motor::new(ideal(), 2000.0);
        motor.order(Quantity::Pwm, 16_383, None);
        assert_eq!(run(&mut motor, 0.0, 0.1)[19], 0.0);
        motor.order(Quantity::Pwm, 32_767, None);
        assert!((run(&mut motor, 0.1, 0.1)[19] - 2000.0).abs() < 1e-6);
        motor.order(Quantity::Pwm, 0, None);
        assert_eq!(run(&mut motor, 0.2, 0.1)[19], -2000.0);
    }

    #[test]
    fn suspending_stops_and_resuming_does_not_start() {
        let mut motor = Motor::new(ideal(), 2000.0);
        motor.order(Quantity::Velocity, 400, None);
        motor.enable(false);
        motor.enable(true);
        run(&mut motor, 0.0, 1.0);
        assert_eq!(motor.turned(), 0.0);
    }

    #[test]
    fn speed_is_limited_by_what_the_wheel_can_do() {
        let mut motor = Motor::new(ideal(), 1500.0);
        motor.order(Quantity::Velocity, i16::MAX, None);
        assert_eq!(run(&mut motor, 0.0, 1.0)[199], 1500.0);
    }
}
