//! Check that a robot's clock runs as fast as mission time. Otherwise the robot seems too slow or
//! too fast.
//!
//! A simulator's clock is slow on a weak machine, and fast if unthrottled.

use common::clock::MissionTime;

/// Duration of a comparison. A frozen process spoils one, so two must agree.
const OVER_NS: u64 = 5_000_000_000;
/// Tolerated relative difference.
const SHARE: f64 = 0.1;
/// Step between stamps that shows a reset clock, nanoseconds.
const SET_ANEW_NS: i64 = 1_000_000_000;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ClockRate {
    newest_ns: i64,
    /// Whether the newest step was one of a reset clock. A second one in a row shows a wrong unit.
    jumped: bool,
    since: Option<(i64, MissionTime)>,
    /// Last comparison, robot seconds per mission second.
    before: Option<f64>,
    told: Option<f64>,
}

impl ClockRate {
    /// Takes a stamp. Returns the robot seconds per mission second if that is off and unreported.
    pub(crate) fn take(&mut self, stamp_ns: i64, now: MissionTime) -> Option<f64> {
        let passed_ns = stamp_ns.saturating_sub(std::mem::replace(&mut self.newest_ns, stamp_ns));
        let jumps = !(0..=SET_ANEW_NS).contains(&passed_ns);
        let is_set_anew = jumps && !self.jumped;
        self.jumped = jumps;
        let Some((from_ns, from)) = self.since.filter(|_| !is_set_anew) else {
            self.since = Some((stamp_ns, now));
            return None;
        };
        let mission_ns = now.0.saturating_sub(from.0);
        if mission_ns < OVER_NS {
            return None;
        }
        self.since = Some((stamp_ns, now));
        let rate = stamp_ns.saturating_sub(from_ns) as f64 / mission_ns as f64;
        let before = self.before.replace(rate)?;
        let off = |rate: f64| if (rate - 1.0).abs() > SHARE { (rate - 1.0).signum() } else { 0.0 };
        let is_off = off(rate) != 0.0 && off(rate) == off(before);
        let is_told = self.told.is_some_and(|told| (rate - told).abs() <= SHARE * told);
        (is_off && !is_told).then(|| *self.told.insert(rate))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_NS: u64 = 50_000_000;

    /// Returns the reports on a clock that runs at each of `rates` for 20 s.
    fn told(rates: &[f64]) -> Vec<f64> {
        let (mut clock, mut stamp_ns, mut now_ns) = (ClockRate::default(), 7e18, 0);
        let mut told = Vec::new();
        for rate in rates {
            for _ in 0..400 {
                (stamp_ns, now_ns) = (stamp_ns + rate * STEP_NS as f64, now_ns + STEP_NS);
                told.extend(clock.take(stamp_ns as i64, MissionTime(now_ns)));
            }
        }
        told
    }

    #[test]
    fn a_clock_that_goes_slower_or_faster_is_told_once_until_it_goes_otherwise() {
        assert!(told(&[1.0, 1.05, 0.95]).is_empty());
        for rate in [0.8, 1.3, 1000.0] {
            let told = told(&[rate, rate]);
            assert!(told.len() == 1 && (told[0] - rate).abs() < 0.01, "{rate}: {told:?}");
        }
        assert_eq!(told(&[0.5, 0.25]).len(), 2);
    }

    #[test]
    fn a_link_that_was_frozen_and_a_clock_that_is_set_anew_say_nothing_of_a_rate() {
        let mut clock = ClockRate::default();
        for step in 0..400_u64 {
            // In one second of 20, only the newest stamp arrives, at its end. The clock is also set
            // back and forth.
            let ms = step * 50;
            let heard_ms = if ms % 20_000 > 7000 && ms % 20_000 < 8000 { 8000 } else { ms };
            let set_s = if step > 200 { -5000 } else { 9_000_000 };
            let stamp_ns = i64::try_from(ms).unwrap() * 1_000_000 + set_s * 1_000_000_000;
            assert_eq!(clock.take(stamp_ns, MissionTime(heard_ms * 1_000_000)), None, "{ms}");
        }
        assert_eq!(clock.take(i64::MIN, MissionTime(0)), None);
        assert_eq!(clock.take(i64::MAX, MissionTime(u64::MAX)), None);
    }
}
