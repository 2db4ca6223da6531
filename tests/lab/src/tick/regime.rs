//! How ticks follow each other. Their cost depends on it: caches are warm or cold, cores awake or asleep.

use std::{fmt, time::Duration};

use common::clock::Pace;

/// Ticks a second; none if they follow each other at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regime(Option<f64>);

/// Trips of a round that follow each other without a pause.
const TRIPS: u64 = 2000;
/// Trips of a round with the pause of a tick between them.
const PACED_TRIPS: u64 = 50;

impl Regime {
    /// The regimes to measure a mission in that has `rate_hz` ticks in a mission second: the one that is asked for, or back to back
    /// and at the robot's rate.
    pub fn all(asked_hz: Option<f64>, pace: Option<Pace>, rate_hz: f64) -> Vec<Self> {
        match (asked_hz, pace) {
            (Some(_), _) => vec![Self(asked_hz)],
            (None, Some(Pace::Max)) => vec![Self(None)],
            (None, Some(Pace::Rate(rate))) => vec![Self(Some(rate * rate_hz))],
            (None, None) => vec![Self(None), Self(Some(rate_hz))],
        }
    }

    /// The pace that gives a mission with `rate_hz` ticks in a mission second this regime.
    pub fn pace(self, rate_hz: f64) -> Pace {
        self.0.map_or(Pace::Max, |hz| Pace::Rate(hz / rate_hz))
    }

    /// Time from tick to tick; none if they follow at once.
    pub fn period(self) -> Option<Duration> {
        Some(Duration::from_secs_f64(1.0 / self.0?))
    }

    /// Trips of the bare hops in a round.
    pub const fn trips(self) -> u64 {
        if self.0.is_some() { PACED_TRIPS } else { TRIPS }
    }
}

impl fmt::Display for Regime {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            None => to.write_str("back to back"),
            Some(hz) => write!(to, "at {hz} Hz"),
        }
    }
}

/// Ticks a second, as the command line gives them.
pub fn parse_hz(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(hz) if (SLOWEST_HZ..=FASTEST_HZ).contains(&hz) => Ok(hz),
        _ => Err(format!("{text} is no rate; give ticks a second, {SLOWEST_HZ} to {FASTEST_HZ}")),
    }
}

const SLOWEST_HZ: f64 = 0.1;
/// A tick takes up to a millisecond, so faster is back to back.
const FASTEST_HZ: f64 = 1000.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_asked_for_is_a_pace_of_the_mission_and_a_period_of_the_hops() {
        let regimes = Regime::all(Some(7.0), None, 3.5);
        let [regime] = regimes[..] else {
            panic!("{regimes:?}");
        };
        assert_eq!(regime.pace(3.5), Pace::Rate(2.0));
        assert_eq!(regime.period(), Some(Duration::from_secs_f64(1.0 / 7.0)));
        assert_eq!(regime.to_string(), "at 7 Hz");
        assert_eq!(Regime::all(None, Some(Pace::Rate(2.0)), 3.5), [regime]);
        let at_once = Regime(None);
        assert_eq!(Regime::all(None, Some(Pace::Max), 7.0), [at_once]);
        assert_eq!(Regime::all(None, None, 7.0), [at_once, regime]);
        assert_eq!((at_once.pace(7.0), at_once.period()), (Pace::Max, None));
        assert_eq!(at_once.to_string(), "back to back");
    }

    #[test]
    fn a_rate_that_is_none_is_refused() {
        for text in ["0", "-7", "nan", "inf", "1e9", "seven", ""] {
            assert!(parse_hz(text).is_err(), "{text}");
        }
        assert_eq!(parse_hz("7"), Ok(7.0));
    }
}
