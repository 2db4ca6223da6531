//! Mission time, its pace, and the machine's monotonic clock.
//!
//! Samples carry mission time. Deadlines that detect ended or hung processes use [`monotonic_ns`].

use std::{fmt, ops::Add, str::FromStr, time::Duration};

use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::machine;

/// Nanoseconds since the start of the mission.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct MissionTime(pub u64);

impl MissionTime {
    pub fn seconds(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// Converts seconds; negative values and NaN give zero.
    pub fn from_seconds(seconds: f64) -> Self {
        Self((seconds.max(0.0) * 1e9) as u64)
    }

    /// Returns the time since `earlier`; zero if `earlier` is later.
    pub fn since(self, earlier: Self) -> Duration {
        Duration::from_nanos(self.0.saturating_sub(earlier.0))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Pace {
    /// As fast as possible: each tick waits for the one before, and the run is repeatable.
    Max,
    /// Mission time as a multiple of wall-clock time.
    Rate(f64),
}

#[derive(Debug, Error)]
#[error("pace {0:?} is invalid; give `max`, or a rate from 0.05 to 100 (1 for wall-clock)")]
pub struct PaceError(String);

impl FromStr for Pace {
    type Err = PaceError;

    fn from_str(text: &str) -> Result<Self, PaceError> {
        if text == "max" {
            return Ok(Self::Max);
        }
        match text.parse() {
            Ok(rate) if (0.05..=100.0).contains(&rate) => Ok(Self::Rate(rate)),
            _ => Err(PaceError(text.to_owned())),
        }
    }
}

impl fmt::Display for Pace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Max => f.write_str("max"),
            Self::Rate(rate) => write!(f, "{rate}"),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MissionClock {
    /// Lockstep, a simulated robot at `--pace max`: tick k happens at k periods.
    Ticks { period_ns: u64 },
    /// Real robot, or a simulated one at `--pace R`: wall-clock time since the epoch, multiplied by
    /// a rate.
    Wall { epoch_ns: u64, rate: f64 },
}

impl MissionClock {
    pub fn at(&self, tick: u64, monotonic_ns: u64) -> MissionTime {
        match *self {
            Self::Ticks { period_ns } => MissionTime(tick.saturating_mul(period_ns)),
            Self::Wall { epoch_ns, rate } => {
                MissionTime((monotonic_ns.saturating_sub(epoch_ns) as f64 * rate) as u64)
            }
        }
    }
}

/// Returns CLOCK_MONOTONIC, nanoseconds, which all processes of the machine share. A simulated
/// machine has its own.
pub fn monotonic_ns() -> u64 {
    if let Some(machine) = machine::simulated() {
        return machine.monotonic_ns();
    }
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Instant of [`monotonic_ns`], with the parts of [`std::time::Instant`] that are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Instant(u64);

impl Instant {
    pub fn now() -> Self {
        Self(monotonic_ns())
    }

    pub fn elapsed(self) -> Duration {
        Self::now().saturating_duration_since(self)
    }

    pub const fn saturating_duration_since(self, earlier: Self) -> Duration {
        Duration::from_nanos(self.0.saturating_sub(earlier.0))
    }
}

impl Add<Duration> for Instant {
    type Output = Self;

    fn add(self, after: Duration) -> Self {
        Self(self.0.saturating_add(u64::try_from(after.as_nanos()).unwrap_or(u64::MAX)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wall_time_runs_from_the_epoch_at_its_rate_and_tick_time_does_not_look_at_the_machine() {
        let ticks = MissionClock::Ticks { period_ns: 1_000 };
        let wall = MissionClock::Wall { epoch_ns: 1_000, rate: 2.0 };
        for (clock, tick, now_ns, time_ns) in [
            (ticks, 3, 77, 3_000),
            (ticks, 3, 99_999, 3_000),
            (wall, 9, 1_500, 1_000),
            // Before the epoch.
            (wall, 9, 500, 0),
        ] {
            assert_eq!(clock.at(tick, now_ns), MissionTime(time_ns));
        }
    }

    #[test]
    fn a_pace_is_max_or_a_sane_rate() {
        assert_eq!("max".parse::<Pace>().unwrap(), Pace::Max);
        assert_eq!("4".parse::<Pace>().unwrap(), Pace::Rate(4.0));
        for bad in ["0", "-1", "nan", "inf", "fast", "1e9"] {
            assert!(bad.parse::<Pace>().is_err(), "{bad} was accepted");
        }
    }
}
