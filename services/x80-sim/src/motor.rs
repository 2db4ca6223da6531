//! A channel of the motor board and the speed loop of its wheel. Values are encoder counts and counts per second in
//! the channel's positive direction.

use std::collections::VecDeque;

use common::{
    mission::WheelPhysics,
    wire::{COUNT_CYCLE, Mode, Parameter, Quantity},
};

use crate::noise::Noise;

/// A wheel stands at this pulse width.
const PWM_STOP: f64 = 16_383.5;
/// Pulse widths this near to [`PWM_STOP`] turn no wheel: a client that drives by them adds as much.
const PWM_DEAD_BAND: f64 = 8000.0;
/// 1/s: a position is reached in about a second.
const POSITION_GAIN: f64 = 4.0;
/// A wheel has reached its position within this, counts.
const POSITION_REACHED: f64 = 0.5;
/// Friction holds a wheel below it that is ordered to stand, counts per second (2 mm/s); the dead band of starting is
/// friction too, where it is wider.
const STANDSTILL: f64 = 5.0;
/// The share of the stall torque at which a tyre slips: half the robot's weight of 34 N with a friction of 0.6, over
/// the 26 N of a stalled motor at the rim.
const SLIPS_AT: f64 = 0.4;
/// Delayed changes of the target. At a change every 5 ms this is more than the longest delay needs. A host that sends
/// faster overwrites the newest one.
const MOST_PENDING: usize = 1024;

#[derive(Clone, Debug)]
pub struct Motor {
    physics: WheelPhysics,
    /// Counts per second.
    top_speed: f64,
    /// Counts per second in a second.
    acceleration: f64,
    enabled: bool,
    mode: Mode,
    order: Option<Order>,
    /// Changes of the target with their times, before the delay.
    pending: VecDeque<(f64, f64)>,
    target: f64,
    speed: f64,
    turned: f64,
    load: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Order {
    quantity: Quantity,
    value: i16,
    until: Option<f64>,
}

impl Motor {
    /// A booted channel is suspended, in PWM mode.
    pub fn new(physics: WheelPhysics, top_speed: f64) -> Self {
        Self {
            physics,
            top_speed,
            acceleration: f64::INFINITY,
            enabled: false,
            mode: Mode::Pwm,
            order: None,
            pending: VecDeque::new(),
            target: 0.0,
            speed: 0.0,
            turned: 0.0,
            load: 0.0,
        }
    }

    /// A motor that gains and loses speed so fast, counts per second in a second.
    #[must_use]
    pub fn accelerating(self, acceleration: f64) -> Self {
        Self { acceleration, ..self }
    }

    pub fn enabled(&self) -> bool {
        self.enabled
    }

    /// Counts per second.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    pub fn turned(&self) -> f64 {
        self.turned
    }

    /// The share of its stall torque that the motor gives against something that holds its wheel or the body.
    pub fn load(&self) -> f64 {
        self.load
    }

    /// The wheel stands at the counts of an earlier process.
    pub(crate) fn restore(&mut self, turned: f64) {
        self.turned = turned;
    }

    /// Sets the mode and lets the motor run until mission time `until`.
    pub fn order(&mut self, quantity: Quantity, value: i16, until: Option<f64>) {
        self.enabled = true;
        self.mode = match quantity {
            Quantity::Position => Mode::Position,
            Quantity::Pwm => Mode::Pwm,
            Quantity::Velocity => Mode::Velocity,
        };
        self.order = Some(Order { quantity, value, until });
    }

    /// A suspended motor forgets its order.
    pub fn enable(&mut self, on: bool) {
        self.enabled = on;
        if !on {
            self.order = None;
        }
    }

    pub fn halt(&mut self) {
        self.order = None;
    }

    /// The simulated loop is the measured one with any gains and feedback.
    pub fn configure(&mut self, parameter: Parameter) {
        if let Parameter::Mode(mode) = parameter {
            if mode != self.mode {
                self.order = None;
            }
            self.mode = mode;
        }
    }

    /// Mission time that no step may reach across.
    pub fn ends_at(&self) -> Option<f64> {
        self.order.and_then(|order| order.until)
    }

    /// From mission time `now` for `dt` seconds. Returns the counts that the loop asks of the wheel.
    pub fn step(&mut self, now: f64, dt: f64, noise: &mut Noise) -> f64 {
        self.load = 0.0;
        if self.ends_at().is_some_and(|end| now >= end) {
            // The time limit of a position is the duration of the motion; the wheel goes on to its last count.
            self.order = self
                .order
                .filter(|order| order.quantity == Quantity::Position)
                .map(|order| Order { until: None, ..order });
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
        let decay = if self.physics.lag_s > 0.0 { (-dt / self.physics.lag_s).exp() } else { 0.0 };
        // The distance of an exponential approach is its integral, not its end times dt.
        let behind = self.speed - self.target;
        let (before, most) = (self.speed, self.acceleration * dt);
        let mut counts = self.target * dt + behind * self.physics.lag_s * (1.0 - decay);
        self.speed = self.target + behind * decay;
        if (self.speed - before).abs() > most {
            self.speed = before + most.copysign(self.speed - before);
            counts = (before + self.speed) / 2.0 * dt;
        }
        let mut jitter = 0.0;
        if self.target != 0.0 {
            let sd = self.physics.noise_counts * (1.0 - decay * decay).sqrt();
            jitter = noise.normal(sd);
            self.speed += jitter;
        } else if self.speed.abs() < STANDSTILL.max(self.physics.dead_band_counts) {
            self.speed = 0.0;
        }
        counts + jitter * dt
    }

    pub fn turn(&mut self, counts: f64) {
        self.turned += counts;
    }

    /// The ground lets the wheel go at `speed` counts per second only. `grip` is the share of its own speed that the
    /// wheel loses by that, 0 if it slips freely. A push adds no speed. Its loop raises the torque until the wheel
    /// stalls or slips.
    pub fn hold(&mut self, speed: f64, grip: f64) {
        let held = speed.clamp(self.speed.min(0.0), self.speed.max(0.0));
        if self.target != 0.0 {
            let lost = (1.0 - held / self.target).clamp(0.0, 1.0);
            self.load = lost * (grip + (1.0 - grip) * SLIPS_AT);
        }
        self.speed = held * grip + self.speed * (1.0 - grip);
    }

    /// Counts per second at mission time `now`, with gain, dead band and limit.
    fn wanted(&self, now: f64) -> f64 {
        let Some(order) = self.order.filter(|_| self.enabled) else {
            return 0.0;
        };
        let value = f64::from(order.value);
        let asked = match order.quantity {
            Quantity::Velocity => value * self.physics.gain,
            Quantity::Pwm => {
                let duty = value - PWM_STOP;
                let beyond = (duty.abs() - PWM_DEAD_BAND).max(0.0);
                (beyond / (PWM_STOP - PWM_DEAD_BAND) * self.top_speed).copysign(duty)
            }
            Quantity::Position => {
                let cycle = f64::from(COUNT_CYCLE);
                let way = (value - self.turned).rem_euclid(cycle);
                let way = if way > cycle / 2.0 { way - cycle } else { way };
                let left = order.until.map_or(0.0, |end| end - now);
                let asked = way / left.max(1.0 / POSITION_GAIN);
                // The loop pushes until the wheel is there, so no dead band remains.
                let least = self.physics.dead_band_counts;
                let there = way.abs() < POSITION_REACHED;
                if there { 0.0 } else { asked.abs().max(least).copysign(way) }
            }
        };
        if asked.abs() < self.physics.dead_band_counts {
            return 0.0;
        }
        asked.clamp(-self.top_speed, self.top_speed)
    }
}

#[cfg(test)]
mod tests;
