//! Ratio of the wheels' counted shares of their commanded travel, right over left.
//!
//! Unequal shares show a wrong encoder, loop or ground. Which one is unknown, so dead reckoning
//! takes the ratio as uncertainty of the curve.
//!
//! Least squares of `y_right x_left` over `y_left x_right`, with modelled travel x and counted
//! travel y, cancel common errors such as a late frame. Early or late wheels shift the ratio while
//! the curve changes, so the fit includes that change. A steadily narrowing curve confuses the two,
//! so the ratio nearer to 1 counts, from the fits with and without the change.
//!
//! A tick's travel outside of that of the ticks beside it and of all recent commands is a jump of
//! the counts, or the robot was moved. Dead reckoning takes it as uncertainty too.

use std::collections::VecDeque;

use common::{
    driver::counts::WheelCounts,
    least_squares::{Line, Two},
    mission::{Mission, ModelledSpeed, Response},
};

use super::modelled_wheels::{Axle, ModelledWheels};

const LEFT_AFTER_A_METRE: f64 = 0.72;
const LEAST_M: f64 = 1.0;
/// Share of commanded travel below which a wheel is held or dead, for other monitors to judge.
const TURNS: f64 = 0.25;

/// Steady motion: over `STEADY` ticks the least travel, modelled and counted, is at least `AGREE`
/// of the greatest. Changing speeds say nothing about encoders.
const STEADY: usize = 3;
const AGREE: f64 = 0.75;
/// Least share of the top speed. Model errors are a large part of slower travel.
const LEAST_SPEED: f64 = 0.15;
/// Relative difference of a settled wheel from its command.
const SETTLED: f64 = 0.05;

/// Change of the curve per tick, the logarithm of the travel ratio: its least square, as wheels
/// answer some ticks off, and the most that pending commands may alter it.
const LEAST_CHANGE: f64 = 1e-8;
const MOST_CORNER: f64 = 0.05;

/// Ticks whose commands explain travel, and the least travel that is unexplained, metres. In 120
/// missions of `firsthand-lab corpus` the sums led wheels at most 0.031 m apart.
const RECENT: usize = 24;
const LEAST_UNTOLD_M: f64 = 0.01;
/// Least excess of a tick's travel over that of both ticks beside it, beyond any such excess of the
/// commands, metres. In 99 of 100 missions of the corpus it stayed below.
const LEAST_SPIKE_M: f64 = 0.05;

#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    way_m: f64,
    ticks: f64,
    line: Line,
    change: Line,
    both: f64,
}

impl Sums {
    /// Adds a tick's modelled and counted travel, metres, with the modelled curve's change per
    /// tick.
    fn add(&mut self, told: [f64; 2], counted: [f64; 2], change: f64) {
        let [left, right] = told;
        let way_m = f64::midpoint(left.abs(), right.abs());
        let turns =
            |wheel: usize| counted[wheel] * told[wheel].signum() >= TURNS * told[wheel].abs();
        if left == 0.0 || right == 0.0 || !turns(0) || !turns(1) {
            return;
        }
        let x = counted[0] * right / way_m;
        let y = counted[1] * left / way_m;
        let left = LEFT_AFTER_A_METRE.powf(way_m);
        self.way_m = self.way_m * left + way_m;
        assert!(way_m > 0.0 && left < 1.0);
        self.ticks = self.ticks * left + 1.0;
        self.line.add(left, x, y);
        self.change.add(left, change * x, y);
        self.both = self.both * left + change * x * x;
    }

    fn ratio(&self) -> WheelRatio {
        let Self { line, change, .. } = self;
        let change = Line { xx: change.xx + LEAST_CHANGE * line.xx, ..*change };
        let alone = line.factor(self.ticks);
        match Two::of(line, &change, self.both, self.ticks, 0.0) {
            Some(Two { a: [ratio, deviation], .. }) if self.way_m >= LEAST_M => {
                let (ratio, deviation) = if (alone.0 - 1.0).abs() < (ratio - 1.0).abs() {
                    alone
                } else {
                    (ratio, deviation)
                };
                assert!(deviation >= 0.0);
                WheelRatio { ratio, deviation }
            }
            _ => WheelRatio::UNKNOWN,
        }
    }
}

/// Returns the logarithm of right over left.
fn curve([left, right]: [f64; 2]) -> f64 {
    (right / left).abs().ln()
}

/// Returns whether pending commands of `wheels` continue the curve's recent change.
///
/// Wheels answer a corner partly before the model. The ticks that would compensate are unsteady and
/// left out, so the tick before must be too.
fn goes_on(
    wheels: &ModelledWheels,
    told: [f64; 2],
    change: f64,
    [then_s, now_s]: [f64; 2],
) -> bool {
    let mut before = [f64::NAN; 2];
    wheels.pending().all(|(acts_s, speeds)| {
        // The link repeats its commands.
        if std::mem::replace(&mut before, speeds) == speeds {
            return true;
        }
        let ticks = 1.0 + (acts_s - now_s) / (now_s - then_s);
        let same_ways = speeds[0] * told[0] > 0.0 && speeds[1] * told[1] > 0.0;
        same_ways && (curve(speeds) - curve(told) - change * ticks).abs() <= MOST_CORNER
    })
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WheelRatio {
    pub ratio: f64,
    pub deviation: f64,
}

impl WheelRatio {
    const UNKNOWN: Self = Self { ratio: 1.0, deviation: 0.0 };
}

#[derive(Clone, Debug, Default)]
struct Untold {
    /// Modelled and counted travel, oldest first.
    recent: VecDeque<[[f64; 2]; 2]>,
    way_m: [f64; 2],
}

/// Returns how far the middle value lies outside of the others.
fn spike([before, it, after]: [f64; 3]) -> f64 {
    it - it.max(before.min(after)).min(before.max(after))
}

impl Untold {
    fn take(&mut self, tick: [[f64; 2]; 2]) {
        self.recent.push_back(tick);
        if self.recent.len() > RECENT {
            self.recent.pop_front();
        }
        let recent = &*self.recent.make_contiguous();
        let [.., before, judged, after] = recent else { return };
        let [before, judged, after] = [before, judged, after].map(|[_, counted]| *counted);
        for (wheel, way_m) in self.way_m.iter_mut().enumerate() {
            let told = recent.iter().map(|[told, _]| told[wheel]);
            let [least, most] = [f64::min, f64::max]
                .map(|of| told.clone().fold(of(before[wheel], after[wheel]), of));
            let untold_m = judged[wheel] - judged[wheel].max(least).min(most);
            let spike_m = spike([before, judged, after].map(|counted| counted[wheel]));
            let told_m =
                recent.windows(3).map(|it| spike([0, 1, 2].map(|at| it[at][0][wheel])).abs());
            let is_spike = spike_m.abs() > LEAST_SPIKE_M + told_m.fold(0.0, f64::max);
            if is_spike || untold_m.abs() > LEAST_UNTOLD_M {
                *way_m += if is_spike { spike_m } else { untold_m };
            }
        }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct WheelShares {
    axle: Axle,
    top_speed_m_s: f64,
    /// None for a car, with one driven wheel.
    wheels: Option<ModelledWheels>,
    sums: Sums,
    /// Modelled and counted travel, oldest first.
    newest: [[[f64; 2]; 2]; STEADY],
    frame: Option<(WheelCounts, f64)>,
    longest_gap_s: f64,
    untold: Untold,
}

impl WheelShares {
    pub(crate) fn new(mission: &Mission) -> Self {
        let body = mission.body();
        let axle = Axle::from(&body);
        let mut shares = Self {
            axle,
            top_speed_m_s: body.top_speed_m_s,
            wheels: None,
            sums: Sums::default(),
            newest: [[[0.0; 2]; 2]; STEADY],
            frame: None,
            longest_gap_s: 2.0 / mission.robot.rate_hz,
            untold: Untold::default(),
        };
        shares.adopt(mission.trusted_response());
        shares
    }

    /// Takes counts/s.
    pub(crate) fn told(&mut self, counts: [i16; 2], now_s: f64) {
        if let Some(wheels) = &mut self.wheels {
            wheels.command(now_s, counts.map(f64::from));
        }
    }

    /// Forgets the last frame; counts may restart.
    pub(crate) fn interrupt(&mut self) {
        self.frame = None;
        self.untold.recent.clear();
    }

    pub(crate) fn rolled(&mut self, counts: WheelCounts, now_s: f64) {
        let before = self.frame.replace((counts, now_s));
        let Some(wheels) = &mut self.wheels else {
            return;
        };
        let told = wheels.go_on(now_s);
        if let Some((before, then_s)) = before
            && now_s - then_s <= self.longest_gap_s
        {
            let metres = |counts: [f64; 2]| counts.map(|count| count / self.axle.counts_per_m);
            let told = metres(told);
            let rolled = metres(counts.since(before));
            self.untold.take([told, rolled]);
            // Travel during speed changes depends on timing, which the model knows less well.
            let left = wheels.each(ModelledSpeed::left);
            let speeds = wheels.each(ModelledSpeed::speed);
            let settles = |wheel: usize| left[wheel].abs() <= SETTLED * speeds[wheel].abs();
            let told = if settles(0) && settles(1) { told } else { [0.0; 2] };
            self.newest.rotate_left(1);
            self.newest[STEADY - 1] = [told, rolled];
            let change = (curve(told) - curve(self.newest[0][0])) / (STEADY - 1) as f64;
            let goes_on = goes_on(wheels, told, change, [then_s, now_s]);
            if goes_on && self.is_steady(LEAST_SPEED * self.top_speed_m_s * (now_s - then_s)) {
                self.sums.add(told, rolled, change);
            }
        }
    }

    fn is_steady(&self, least_m: f64) -> bool {
        let is_steady = |(kind, wheel): (usize, usize)| {
            let ways = self.newest.map(|tick| tick[kind][wheel]);
            let along = ways.map(|way| way * ways[STEADY - 1].signum());
            let least = along.into_iter().fold(f64::INFINITY, f64::min);
            least >= least_m && least >= AGREE * along.into_iter().fold(0.0, f64::max)
        };
        [(0, 0), (0, 1), (1, 0), (1, 1)].into_iter().all(is_steady)
    }

    pub(crate) fn adopt(&mut self, response: Response) {
        let wheels = || ModelledWheels::new(self.axle, response.dead_time_s(), &response);
        self.wheels = self.axle.track_m.map(|_| wheels());
        self.sums = Sums::default();
        self.untold.recent.clear();
    }

    /// Returns the travel, left and right, that nothing explains, metres.
    pub(crate) const fn untold_m(&self) -> [f64; 2] {
        self.untold.way_m
    }

    pub(crate) fn ratio(&self) -> WheelRatio {
        self.sums.ratio()
    }
}

#[cfg(test)]
mod tests {

    use super::*;
    use crate::testing::*;

    /// Returns the shares after `ticks` of wheels that turn as `rolls(now_s, told)`, counts per tick.
    fn shares(
        mut shares: WheelShares,
        ticks: usize,
        told: impl Fn(usize) -> [i16; 2],
        mut rolls: impl FnMut(f64, [f64; 2]) -> [f64; 2],
    ) -> WheelShares {
        let mut rolled = [0.0; 2];
        for tick in 0..ticks {
            let now_s = tick as f64 * PERIOD_S;
            shares.rolled(WheelCounts::Endless(rolled), now_s);
            let told = told(tick);
            shares.told(told, now_s);
            for (rolled, way) in rolled.iter_mut().zip(rolls(now_s, told.map(f64::from))) {
                *rolled += way;
            }
        }
        shares
    }

    /// Returns the ratio of wheels with a stated response that reach and count these shares.
    fn ratio(text: &str, reached: [f64; 2], told: impl Fn(usize) -> [i16; 2]) -> WheelRatio {
        told_shares(text, reached, 0.0, told).ratio()
    }

    /// As [`ratio`], with a jump of the left wheel's counts, metres, after 15 s.
    fn told_shares(
        text: &str,
        reached: [f64; 2],
        jump_m: f64,
        told: impl Fn(usize) -> [i16; 2],
    ) -> WheelShares {
        let told_shares = WheelShares::new(&mission(text));
        let mut wheels = told_shares.wheels.clone().unwrap();
        let mut jump = jump_m * told_shares.axle.counts_per_m;
        shares(told_shares, 200, told, |now_s, told| {
            wheels.command(now_s, told);
            let ways = wheels.go_on(now_s + PERIOD_S);
            let jumps = if now_s > 15.0 { std::mem::take(&mut jump) } else { 0.0 };
            [ways[0] * reached[0] + jumps, ways[1] * reached[1]]
        })
    }

    #[test]
    fn a_jump_of_the_counts_is_untold_and_other_motion_is_not() {
        let turns = |tick: usize| [[600, 600], [300, 700], [0, 0]][tick / 9 % 3];
        for (jump_m, least_m) in [(0.0, 0.0), (0.1, 0.05), (-0.1, -0.2)] {
            let [left, right] = told_shares("", [0.78; 2], jump_m, turns).untold_m();
            assert!((least_m..=least_m + 0.1 * jump_m.abs() * 15.0).contains(&left), "{left}");
            assert_eq!(right, 0.0);
        }
    }

    #[test]
    fn a_wheel_that_counts_another_share_than_the_other_is_told_from_wheels_that_are_both_slow() {
        let winding = |tick: usize| if tick % 20 < 10 { [600, 450] } else { [450, 600] };
        for reached in [1.0, 0.78] {
            let even = ratio("", [reached; 2], winding);
            near(even.ratio, 1.0, 0.01);
            let low = ratio("", [0.95 * reached, reached], winding);
            assert!((low.ratio - 1.0 / 0.95).abs() < 0.01 && low.deviation < 0.01, "{low:?}");
        }
        // Nothing is known of wheels that were told to stand.
        assert_eq!(ratio("", [0.9, 1.0], |_| [0; 2]), WheelRatio::UNKNOWN);
    }

    #[test]
    fn wheels_that_answer_sooner_than_stated_are_even_though_their_curve_narrows_all_the_time() {
        let narrowing = |tick: usize| [600, 600 - 3 * tick as i16];
        let at_once = |_, told: [f64; 2]| told.map(|told| told * PERIOD_S);
        let found = shares(WheelShares::new(&mission("")), 112, narrowing, at_once);
        near(found.ratio().ratio, 1.0, 0.003);
    }

    #[test]
    fn equal_wheels_with_a_lag_that_turn_aside_at_once_and_back_slowly_are_even() {
        let [once, repeated] = [1, 2].map(turned_aside);
        assert!(once > 2.0 && repeated > 0.9 * once, "{once} {repeated}");
    }

    /// Returns the remembered travel, metres, if each command is sent `says` times.
    fn turned_aside(says: usize) -> f64 {
        let mission = mission("");
        let Response { delay_s, lag_s, .. } = mission.body().response;
        let mut shares = WheelShares::new(&mission);
        let mut acts = [(); 2].map(|()| ModelledSpeed::new(delay_s, f64::INFINITY));
        let (mut speeds, mut rolled) = ([0.0; 2], [0.0; 2]);
        let step_s = PERIOD_S / 100.0;
        for tick in 0..300 {
            let now_s = f64::from(tick) * PERIOD_S;
            shares.rolled(WheelCounts::Endless(rolled), now_s);
            // Aside for a wall or person, and back along a narrowing curve.
            let aside = match tick % 12 {
                0..4 => 0,
                4..6 => 450,
                left => 75 * (11 - left),
            };
            let told = [1000 - aside, 1000 + aside];
            for again in 0..says {
                shares.told(told, now_s + again as f64 * PERIOD_S / 2.0);
            }
            for wheel in 0..2 {
                acts[wheel].command(now_s, told[wheel].into());
                for step in 1..=100 {
                    acts[wheel].go_on(now_s + f64::from(step) * step_s);
                    speeds[wheel] += (acts[wheel].speed() - speeds[wheel]) * step_s / lag_s;
                    rolled[wheel] += speeds[wheel] * step_s;
                }
            }
            near(shares.ratio().ratio, 1.0, 0.018);
        }
        shares.sums.way_m
    }

    #[test]
    fn equal_wheels_that_gain_speed_slowly_and_fall_short_alike_are_even() {
        let turns = |tick: usize| [[600, 600], [300, 700], [700, 600], [700, 250]][tick / 9 % 4];
        // Stated acceleration, but less speed.
        let found = ratio("robot.response.acceleration_m_s2 = 0.3", [0.78; 2], turns);
        near(found.ratio, 1.0, 0.01 + 3.0 * found.deviation);
    }
}
