//! Battery monitor.

use std::time::Duration;

use common::{
    clock::MissionTime,
    mission::{BatteryLimits, Mission},
    samples::Cause,
};

use super::monitor::{Condition, Moment, Monitor, Observation};

/// Margin above the limit to count as charged, volts. Stopping motors raise the voltage by less.
pub(crate) const RECOVERED_V: f64 = 0.3;
/// Share of the limit at which a battery is empty: 1.0 V per cell for a limit of 1.1 V. Lower
/// voltages damage cells, and then fall faster than a robot can be fetched.
pub(crate) const EMPTY_SHARE: f64 = 1.0 / 1.1;
/// Mission time below the empty voltage until a battery is empty. Starting motors lower it for some
/// tenths of a second.
pub(crate) const EMPTY_AFTER: Duration = Duration::from_secs(2);
/// Least voltage of a fitted battery, volts. A robot could send no frames on less.
const FITTED_V: f64 = 1.0;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Charge {
    #[default]
    Enough,
    Low,
    Empty,
}

const PACKS: [&str; 3] = ["board", "motor", "servo"];

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatteryChange {
    pub pack: &'static str,
    pub volts: f64,
    pub charge: Charge,
}

#[derive(Clone, Copy, Debug, Default)]
struct Gauge {
    charge: Charge,
    sunk_since: Option<MissionTime>,
}

impl Gauge {
    fn read(&mut self, volts: f64, limit: f64, now: MissionTime) -> Charge {
        let fitted = volts >= FITTED_V;
        let sunk = fitted && volts < limit * EMPTY_SHARE;
        let since = self.sunk_since.unwrap_or(now);
        self.sunk_since = sunk.then_some(since);
        let ends = if self.charge == Charge::Enough { limit } else { limit + RECOVERED_V };
        self.charge = if self.charge == Charge::Empty || sunk && now.since(since) >= EMPTY_AFTER {
            // The voltage of an empty battery rises when the robot stands.
            Charge::Empty
        } else if fitted && volts < ends {
            Charge::Low
        } else {
            Charge::Enough
        };
        self.charge
    }
}

#[derive(Clone, Debug)]
pub struct Batteries {
    limits: BatteryLimits,
    /// Ordered as [`PACKS`].
    gauges: [Gauge; 3],
    pub(crate) changes: Vec<BatteryChange>,
}

impl Batteries {
    /// Returns which batteries are low or empty: boards, motors, servos.
    pub fn low(&self) -> [bool; 3] {
        self.gauges.map(|gauge| gauge.charge > Charge::Enough)
    }

    /// Returns the worst charge. The robot drives without servos.
    fn charge(&self) -> Charge {
        let [board, motor, _] = self.gauges;
        board.charge.max(motor.charge)
    }

    fn read(&mut self, volts: [f64; 3], now: MissionTime) {
        let BatteryLimits { board, motor, servo } = self.limits;
        let readings = volts.into_iter().zip([board, motor, servo]);
        for ((gauge, pack), (volts, limit)) in self.gauges.iter_mut().zip(PACKS).zip(readings) {
            let before = gauge.charge;
            let charge = gauge.read(volts, limit, now);
            assert!(
                before != Charge::Empty || charge == Charge::Empty,
                "an empty pack stays empty"
            );
            if charge != before {
                self.changes.push(BatteryChange { pack, volts, charge });
            }
        }
    }
}

impl Monitor for Batteries {
    fn new(mission: &Mission) -> Self {
        Self {
            limits: mission.robot.low_battery_v,
            gauges: [Gauge::default(); 3],
            changes: Vec::new(),
        }
    }

    fn observe(&mut self, what: &Observation<'_>, now: Moment) {
        if let Observation::Batteries(volts) = what {
            self.read(*volts, now.time);
        }
    }

    fn condition(&self, cause: Cause, _: Moment) -> Condition {
        let charge = if cause == Cause::BatteryEmpty { Charge::Empty } else { Charge::Low };
        (self.charge() == charge).into()
    }

    fn judges_frames(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests;
