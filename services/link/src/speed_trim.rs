//! Speed trim: compensates wheels slower than commanded.
//!
//! The speed loop of an X80 may reach only 0.75 to 0.8 of a command. The link estimates that share
//! from commands and encoders, and divides commands by it. Both wheels share it, so commands keep
//! their curve. Speeds not yet reached are no evidence.

use common::{
    driver::counts::WheelCounts,
    mission::{Mission, ModelledSpeed},
};

use crate::failsafe::modelled_wheels::{Axle, ModelledWheels};

/// Agreeing commands of a steady wheel. Delay and lag take 0.15 s, a period at 7 Hz.
const STEADY: usize = 3;
/// Least ratio of agreeing commands.
const AGREE: f64 = 0.8;
/// Least speed that is evidence, counts/s: dead band and noise dominate slower ones.
const LEAST_COUNTS_S: f64 = 250.0;
const WEIGHT: f64 = 0.1;
/// Plausible shares; others show slip, a held wheel or a faulty encoder.
const SHARES: std::ops::RangeInclusive<f64> = 0.6..=1.15;
const LEAST_SHARE: f64 = 0.7;

#[derive(Clone, Debug)]
pub(crate) struct SpeedTrim {
    wheels: ModelledWheels,
    /// A car's second channel steers.
    driving: usize,
    /// Oldest first, counts/s.
    told: [[f64; 2]; STEADY],
    /// Newest tick's counts, and mission seconds.
    tick: Option<(WheelCounts, f64)>,
    longest_gap_s: f64,
    share: f64,
}

impl SpeedTrim {
    pub(crate) fn new(mission: &Mission) -> Self {
        let axle = Axle::from(&mission.body());
        let response = mission.trusted_response();
        Self {
            wheels: ModelledWheels::new(axle, response.dead_time_s(), &response),
            driving: if axle.track_m.is_some() { 2 } else { 1 },
            told: [[0.0; 2]; STEADY],
            tick: None,
            longest_gap_s: 2.0 / mission.robot.rate_hz,
            share: 1.0,
        }
    }

    pub(crate) const fn share(&self) -> f64 {
        self.share
    }

    /// Takes counts/s.
    pub(crate) fn told(&mut self, counts: [i16; 2]) {
        self.told.rotate_left(1);
        self.told[STEADY - 1] = counts.map(f64::from);
        if let Some((_, now_s)) = self.tick {
            self.wheels.command(now_s, counts.map(f64::from));
        }
    }

    pub(crate) fn rolled(&mut self, counts: WheelCounts, time_s: f64) {
        let Some((before, then_s)) = self.tick.replace((counts, time_s)) else {
            return;
        };
        let gap_s = time_s - then_s;
        if gap_s <= 0.0 || gap_s > self.longest_gap_s {
            return;
        }
        let turned = counts.since(before);
        self.wheels.go_on(time_s);
        for (wheel, speed) in
            self.wheels.each(ModelledSpeed::speed).into_iter().enumerate().take(self.driving)
        {
            let told = self.told.map(|told| told[wheel]);
            let newest = told[STEADY - 1];
            let along = told.map(|counts_s| counts_s * newest.signum());
            let least = along.into_iter().fold(speed * newest.signum(), f64::min);
            let greatest = along.into_iter().fold(0.0, f64::max);
            if least < LEAST_COUNTS_S.max(AGREE * greatest) {
                continue;
            }
            let rolled = turned[wheel] / gap_s;
            let share = rolled * newest.signum() / ((along[STEADY - 2] + along[STEADY - 1]) / 2.0);
            if SHARES.contains(&share) {
                self.share += WEIGHT * (share - self.share);
                self.share = self.share.clamp(LEAST_SHARE, 1.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::*;

    fn found(reached: f64, ticks: usize, command: impl Fn(usize) -> [f64; 2]) -> f64 {
        let mut trim = SpeedTrim::new(&mission(""));
        let mut rolled = [0.0; 2];
        for tick in 0..ticks {
            trim.rolled(rolled.map(on_wire).into(), tick as f64 * PERIOD_S);
            let told = command(tick).map(|counts| counts / trim.share());
            trim.told(told.map(|counts| counts as i16));
            for (rolled, told) in rolled.iter_mut().zip(told) {
                *rolled += told * reached * PERIOD_S;
            }
        }
        trim.share()
    }

    #[test]
    fn slow_wheels_are_made_good_within_seconds_forward_and_on_the_spot() {
        near(found(0.78, 28, |_| [600.0; 2]), 0.78, 0.02);
        near(found(0.78, 28, |_| [-600.0, 600.0]), 0.78, 0.02);
        near(found(1.0, 28, |_| [600.0; 2]), 1.0, 0.01);
        // No command grows by more than a seventh over the least share.
        assert!(found(0.62, 200, |_| [600.0; 2]) >= LEAST_SHARE);
    }

    #[test]
    fn wheels_that_are_held_or_race_or_change_their_speed_change_nothing() {
        for (reached, [even, odd]) in [
            (0.0, [600.0; 2]),
            (-0.8, [600.0; 2]),
            (1.6, [600.0; 2]),
            (0.78, [100.0; 2]),
            (0.78, [600.0, 300.0]),
        ] {
            let found = found(reached, 50, |tick| [if tick % 2 == 0 { even } else { odd }; 2]);
            assert_eq!(found, 1.0, "{reached} {even} {odd}");
        }
    }
}
