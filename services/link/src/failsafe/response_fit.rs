//! Whether another response than the stated one explains what the wheels did.
//!
//! The newest commands and counts are compared with what wheels would have rolled that answer after any delay and with any acceleration of
//! a grid. A response explains them if each wheel, and the difference of both, rolled as it says, apart from one factor. Dead, swapped and
//! reversed wheels roll as no response says.

use std::collections::VecDeque;

use common::{
    clock::MissionTime,
    mission::{ModelledSpeed, Response},
};

/// Commands and counts are kept for so long, seconds.
const KEPT_S: f64 = 5.0;
/// Whatever is sent and received, no more is kept.
const MOST_KEPT: usize = 512;
const DELAYS_S: usize = 21;
const DELAY_STEP_S: f64 = 0.05;
/// Speeds grow by so much in a second: the slowest is that of a heavy base that a person pushes in vain.
const ACCELERATIONS_M_S2: [f64; 10] = [0.15, 0.2, 0.3, 0.4, 0.6, 0.9, 1.4, 2.2, 4.0, f64::INFINITY];
/// The least square of the correlation of a wheel's way with that of the response.
const EXPLAINED: f64 = 0.8;
/// The factors that real wheels have.
const FACTORS: std::ops::RangeInclusive<f64> = 0.5..=1.5;
/// A wheel that was to roll less, metres, tells nothing.
const LEAST_M: f64 = 0.1;

/// Left, right, and their difference.
const CHANNELS: usize = 3;

fn channels([left, right]: [f64; 2]) -> [f64; CHANNELS] {
    [left, right, right - left]
}

#[derive(Clone, Debug)]
pub(super) struct ResponseFit {
    counts_per_m: f64,
    /// When they were given, and counts/s.
    commands: VecDeque<(f64, [f64; 2])>,
    /// The end of an interval, and the counts that the wheels turned in it; none where they are not known.
    turned: VecDeque<(f64, Option<[f64; 2]>)>,
}

impl ResponseFit {
    pub(super) const fn new(counts_per_m: f64) -> Self {
        Self { counts_per_m, commands: VecDeque::new(), turned: VecDeque::new() }
    }

    pub(super) fn commanded(&mut self, counts: [f64; 2], now: MissionTime) {
        keep(&mut self.commands, (now.seconds(), counts));
    }

    pub(super) fn turned(&mut self, counts: Option<[f64; 2]>, now: MissionTime) {
        keep(&mut self.turned, (now.seconds(), counts));
    }

    pub(super) fn reset(&mut self) {
        self.commands.clear();
        self.turned.clear();
    }

    /// The response that explains the motion best, with the lag of `stated`; none if none does. Each wheel that does not drive is left
    /// out.
    pub(super) fn explain(&self, stated: Response, steers: bool) -> Option<Response> {
        let delays = (0..DELAYS_S).map(|step| step as f64 * DELAY_STEP_S);
        let candidates = delays.flat_map(|delay_s| {
            ACCELERATIONS_M_S2.into_iter().map(move |acceleration| (delay_s, acceleration))
        });
        let explained = candidates.filter_map(|(delay_s, acceleration_m_s2)| {
            let explained = self.explained(delay_s + stated.lag_s, acceleration_m_s2, steers)?;
            Some((explained, Response { delay_s, acceleration_m_s2, ..stated }))
        });
        let best = explained.max_by(|(one, _), (other, _)| one.total_cmp(other));
        best.filter(|(explained, _)| *explained >= EXPLAINED).map(|(_, response)| response)
    }

    /// The least share of a channel's motion that the response explains; none if a channel moved by no factor of it, or none was to.
    fn explained(&self, dead_time_s: f64, acceleration: f64, steers: bool) -> Option<f64> {
        let change = acceleration * self.counts_per_m;
        let mut wheels = [(); 2].map(|()| ModelledSpeed::new(dead_time_s, change));
        let first = self.turned.front()?.0;
        for (wheel, speed) in wheels.iter_mut().enumerate() {
            speed.go_on(self.commands.front()?.0.min(first));
            self.commands.iter().for_each(|(at, counts)| speed.command(*at, counts[wheel]));
        }
        let mut sums = [[0.0; 4]; CHANNELS];
        for &(until, turned) in &self.turned {
            let modelled = channels(wheels.each_mut().map(|wheel| wheel.go_on(until)));
            let Some(turned) = turned else {
                continue;
            };
            for ((sums, model), turned) in sums.iter_mut().zip(modelled).zip(channels(turned)) {
                let terms = [model.abs(), model * model, model * turned, turned * turned];
                sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
            }
        }
        let channels = if steers { 1 } else { CHANNELS };
        let tells = |way: f64| way >= LEAST_M * self.counts_per_m;
        let told = sums[..channels].iter().filter(|[way, ..]| tells(*way));
        told.map(|&[_, model, both, turned]| {
            let factor = both / model;
            (FACTORS.contains(&factor) && turned > 0.0).then(|| both * both / (model * turned))
        })
        .reduce(|one, other| Some(one?.min(other?)))
        .flatten()
    }
}

fn keep<T>(kept: &mut VecDeque<(f64, T)>, new: (f64, T)) {
    let now = new.0;
    kept.push_back(new);
    while kept.len() > MOST_KEPT || kept.front().is_some_and(|(at, _)| now - at > KEPT_S) {
        kept.pop_front();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 0.1;

    /// Drives a base with a track of 0.3 m as a controller does: on, to the left, on, to the right; its wheels turn by `model`, seen
    /// through `encoders`.
    fn explained(
        [delay_s, acceleration]: [f64; 2],
        encoders: impl Fn([f64; 2]) -> [f64; 2],
    ) -> Option<Response> {
        let mut fit = ResponseFit::new(1000.0);
        let mut wheels = [(); 2].map(|()| ModelledSpeed::new(delay_s, acceleration * 1000.0));
        for tick in 0..45 {
            let now = f64::from(tick) * PERIOD_S;
            let turned = wheels.each_mut().map(|wheel| wheel.go_on(now));
            fit.turned((tick > 0).then(|| encoders(turned)), MissionTime::from_seconds(now));
            let command = match tick / 8 % 4 {
                0 | 2 => [300.0, 300.0],
                1 => [100.0, 300.0],
                _ => [300.0, 50.0],
            };
            fit.commanded(command, MissionTime::from_seconds(now));
            for (wheel, speed) in wheels.iter_mut().zip(command) {
                wheel.command(now, speed);
            }
        }
        fit.explain(Response::X80, false)
    }

    #[test]
    fn a_slow_and_a_late_base_are_found_out() {
        for (delay_s, acceleration) in [(0.1, 0.3), (0.4, 0.6), (0.3, f64::INFINITY), (0.1, 5.0)] {
            let found = explained([delay_s, acceleration], |turned| turned).unwrap();
            let dead = found.dead_time_s();
            assert!((dead - delay_s).abs() < 0.06, "{delay_s} {acceleration}: {found:?}");
            if acceleration < 1.0 {
                let share = found.acceleration_m_s2 / acceleration;
                assert!((0.7..=1.4).contains(&share), "{delay_s} {acceleration}: {found:?}");
            }
        }
        let slips = explained([0.2, 0.6], |turned| turned.map(|counts| 0.8 * counts));
        assert!(slips.is_some());
    }

    #[test]
    fn no_response_explains_dead_swapped_and_reversed_wheels() {
        assert_eq!(explained([0.1, 0.6], |[_, right]| [0.0, right]), None);
        assert_eq!(explained([0.1, 0.6], |[left, right]| [right, left]), None);
        assert_eq!(explained([0.1, 0.6], |[left, right]| [-left, right]), None);
        assert_eq!(explained([0.1, 0.6], |_| [0.0; 2]), None);
    }
}
