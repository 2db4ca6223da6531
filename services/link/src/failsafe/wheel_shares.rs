//! The share of its commanded way that each wheel counts, and the ratio of the two.
//!
//! Speed loops that fall short do so alike, and commands keep their curve ([`crate::speed_trim`]). Where one wheel counts another share
//! than the other, its encoder, its loop or the ground is not as stated, and nothing here tells which: dead reckoning gets the ratio as a
//! doubt of the curve that the robot drove. The shares are least squares of the counted over the modelled way of each tick.

use common::{
    driver::counts::WheelCounts,
    mission::{Body, Mission, ModelledSpeed},
};

/// So much of the sums is left after each wheel's further metre: 4 m are remembered.
const LEFT_AFTER_A_METRE: f64 = 0.78;
/// Each wheel must have been told to roll so far, metres.
const LEAST_M: f64 = 0.6;

/// Sums of the modelled way x and the counted way y of ticks, metres.
#[derive(Clone, Copy, Debug, Default)]
struct Share {
    told_m: f64,
    ticks: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Share {
    fn add(&mut self, x: f64, y: f64) {
        let left = LEFT_AFTER_A_METRE.powf(x.abs());
        let sums = [&mut self.told_m, &mut self.ticks, &mut self.xx, &mut self.xy, &mut self.yy];
        for (sum, term) in sums.into_iter().zip([x.abs(), 1.0, x * x, x * y, y * y]) {
            *sum = *sum * left + term;
        }
    }

    /// The share, and the variance of its relative error.
    fn known(&self) -> Option<(f64, f64)> {
        let share = self.xy / self.xx;
        let rest = (self.yy - share * self.xy).max(0.0) / self.ticks;
        let told = self.told_m >= LEAST_M && share > 0.0;
        told.then(|| (share, rest / self.xx / (share * share)))
    }
}

/// The right wheel's share over the left one's, and its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WheelRatio {
    pub(crate) ratio: f64,
    pub(crate) deviation: f64,
}

impl WheelRatio {
    const UNKNOWN: Self = Self { ratio: 1.0, deviation: 0.0 };
}

#[derive(Clone, Debug)]
pub(crate) struct WheelShares {
    metres_per_count: f64,
    /// None for a car, which has one driven wheel.
    wheels: Option<[ModelledSpeed; 2]>,
    shares: [Share; 2],
    frame: Option<(WheelCounts, f64)>,
    longest_gap_s: f64,
}

impl WheelShares {
    pub(crate) fn new(mission: &Mission) -> Self {
        let Body { response, steering, .. } = mission.body();
        let metres_per_count = mission.body().metres_per_count();
        let wheel = ModelledSpeed::new(
            response.dead_time_s(),
            response.acceleration_m_s2 / metres_per_count,
        );
        Self {
            metres_per_count,
            wheels: steering.is_none().then(|| [wheel.clone(), wheel]),
            shares: [Share::default(); 2],
            frame: None,
            longest_gap_s: 2.0 / mission.robot.rate_hz,
        }
    }

    /// `counts` were sent, counts/s.
    pub(crate) fn told(&mut self, counts: [i16; 2], now_s: f64) {
        for (wheel, counts) in self.wheels.iter_mut().flatten().zip(counts) {
            wheel.command(now_s, counts.into());
        }
    }

    /// The counts may start anew.
    pub(crate) const fn interrupt(&mut self) {
        self.frame = None;
    }

    pub(crate) fn rolled(&mut self, counts: WheelCounts, now_s: f64) {
        let before = self.frame.replace((counts, now_s));
        let Some(wheels) = &mut self.wheels else {
            return;
        };
        let told = wheels.each_mut().map(|wheel| wheel.go_on(now_s));
        if let Some((before, then_s)) = before
            && now_s - then_s <= self.longest_gap_s
        {
            let rolled = counts.since(before);
            for (wheel, share) in self.shares.iter_mut().enumerate() {
                share.add(
                    told[wheel] * self.metres_per_count,
                    rolled[wheel] * self.metres_per_count,
                );
            }
        }
    }

    pub(crate) fn ratio(&self) -> WheelRatio {
        let [left, right] = self.shares.each_ref().map(Share::known);
        match (left, right) {
            (Some((left, of_left)), Some((right, of_right))) => {
                WheelRatio { ratio: right / left, deviation: (of_left + of_right).sqrt() }
            }
            _ => WheelRatio::UNKNOWN,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    const PERIOD_S: f64 = 1.0 / 7.0;

    /// The ratio after 8 s of a robot whose wheels reach `reached` of their speeds and count `counted` of that.
    fn ratio(reached: f64, counted: [f64; 2], told: impl Fn(usize) -> [i16; 2]) -> WheelRatio {
        let mission = Mission::parse("target = [3, 0]", Path::new("m.toml")).unwrap();
        let mut shares = WheelShares::new(&mission);
        let mut rolled = [0.0; 2];
        for tick in 0..56 {
            let now_s = tick as f64 * PERIOD_S;
            shares.rolled(WheelCounts::Endless(rolled.map(f64::round)), now_s);
            let told = told(tick);
            shares.told(told, now_s);
            for wheel in 0..2 {
                rolled[wheel] += f64::from(told[wheel]) * reached * counted[wheel] * PERIOD_S;
            }
        }
        shares.ratio()
    }

    #[test]
    fn a_wheel_that_counts_another_share_than_the_other_is_told_from_wheels_that_are_both_slow() {
        let winding = |tick: usize| if tick % 20 < 10 { [600, 450] } else { [450, 600] };
        for reached in [1.0, 0.78] {
            let even = ratio(reached, [1.0; 2], winding);
            assert!((even.ratio - 1.0).abs() < 0.01, "{even:?}");
            let low = ratio(reached, [0.95, 1.0], winding);
            assert!((low.ratio - 1.0 / 0.95).abs() < 0.01 && low.deviation < 0.01, "{low:?}");
        }
    }

    #[test]
    fn nothing_is_known_of_wheels_that_were_told_to_stand() {
        assert_eq!(ratio(1.0, [0.9, 1.0], |_| [0; 2]), WheelRatio::UNKNOWN);
    }
}
