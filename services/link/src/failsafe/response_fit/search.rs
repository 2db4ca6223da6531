//! The responses of the grid, and how each would have turned the wheels.

use common::mission::{ModelledSpeed, Response};

use super::{CHANNELS, FACTORS, ResponseFit, UNEXPLAINED, channels};
use crate::failsafe::modelled_wheels::Limits;

const DEAD_TIMES: u32 = 21;
pub(in super::super) const DEAD_TIME_STEP_S: f64 = 0.05;
/// Speeds grow by so much in a second: the slowest is that of a heavy base that a person pushes in vain, and the last but one is
/// [`ACCELERATION_RATIO`] to the power of [`ACCELERATIONS`] times as much. The last is infinite.
const LEAST_ACCELERATION_M_S2: f64 = 0.15;
pub(in super::super) const ACCELERATION_RATIO: f64 = 1.25;
const ACCELERATIONS: i32 = 16;
/// What a turn that is limited apart gives a wheel, over that grid: the slowest is that of a narrow and heavy base, and none is that of two
/// wheels, as it lies 4.5 steps of the grid lower.
const TURN_SHARE: f64 = 0.366;

impl ResponseFit {
    /// What `weigh` makes of each response of the grid: of its dead time, its limits, and their ways. Of a turn that is limited apart the
    /// grid has only the one that is most like the wheels. Those of wheels are last.
    pub(super) fn weighed<T>(&self, weigh: impl Fn(f64, Limits, Ways<'_>) -> Option<T>) -> Vec<T> {
        let mut weighed = Vec::new();
        let accelerations = (0..ACCELERATIONS)
            .map(|power| LEAST_ACCELERATION_M_S2 * ACCELERATION_RATIO.powi(power))
            .chain([f64::INFINITY]);
        for are_apart in [true, false].into_iter().skip(usize::from(self.judged() == 1)) {
            let share = if are_apart { TURN_SHARE } else { 1.0 };
            let grid = accelerations.clone().map(|acceleration| {
                let most = acceleration * self.axle.counts_per_m;
                Limits { are_apart, most: [most, most * share] }
            });
            let grid: Vec<_> = grid.collect();
            for step in 0..DEAD_TIMES {
                let dead_time_s = f64::from(step) * DEAD_TIME_STEP_S;
                let ways = |axis: usize| {
                    grid.iter().map(move |limits| self.ways(*limits, axis, dead_time_s))
                };
                let others: Vec<_> = ways(1).collect();
                let unlike = others.iter().map(|ways| self.unlike_turn(ways));
                let best = unlike.enumerate().min_by(|one, other| one.1.total_cmp(&other.1));
                let best = best.filter(|(_, unlike)| are_apart && !unlike.is_nan());
                for (index, one) in ways(0).enumerate().filter(|_| best.is_some() || !are_apart) {
                    let other = best.map_or(index, |(best, _)| best);
                    let most = [grid[index].most[0], grid[other].most[1]];
                    weighed.extend(weigh(
                        dead_time_s,
                        Limits { are_apart, most },
                        [&one, &others[other]],
                    ));
                }
            }
        }
        weighed
    }

    /// What is not half the wheels' difference; no number if none is modelled.
    fn unlike_turn(&self, ways: &[f64]) -> f64 {
        let mut turn = Motion::default();
        for ((_, turned), modelled) in self.turned.iter().zip(ways).skip(1) {
            if let Some([left, right]) = turned {
                turn.add(*modelled, (right - left) / 2.0);
            }
        }
        turn.unlike(turn.factor())
    }

    /// What an axis that answers so late rolls in each interval, counts. The first only begins the others.
    fn ways(&self, limits: Limits, axis: usize, dead_time_s: f64) -> Vec<f64> {
        let mut modelled = ModelledSpeed::new(dead_time_s, limits.most[axis]);
        let mut commands = self.commands.iter().peekable();
        let rolled = |(until, _): &(f64, _)| {
            while let Some((at, told)) = commands.next_if(|(at, _)| at <= until) {
                modelled.command(*at, limits.axes(*told)[axis]);
            }
            modelled.go_on(*until)
        };
        self.turned.iter().map(rolled).collect()
    }

    pub(super) fn motions_of(
        &self,
        dead_time_s: f64,
        response: &Response,
        from_s: f64,
    ) -> [[Motion; CHANNELS]; 2] {
        let limits = self.axle.limits(response);
        let [one, other] = [0, 1].map(|axis| self.ways(limits, axis, dead_time_s));
        self.motions(limits, [&one, &other], from_s)
    }

    /// The channels' motion by these ways: all, and from then on.
    pub(super) fn motions(
        &self,
        limits: Limits,
        [one, other]: Ways<'_>,
        from_s: f64,
    ) -> [[Motion; CHANNELS]; 2] {
        let mut all = [Motion::default(); CHANNELS];
        let mut judged_all = all;
        for ((&(until, turned), one), other) in self.turned.iter().zip(one).zip(other).skip(1) {
            let modelled = channels(limits.wheels([*one, *other]));
            for (channel, turned) in turned.map(channels).into_iter().flatten().enumerate() {
                all[channel].add(modelled[channel], turned);
                if until >= from_s {
                    judged_all[channel].add(modelled[channel], turned);
                }
            }
        }
        [all, judged_all]
    }
}

/// What is limited rolls so far in each interval.
pub(super) type Ways<'a> = [&'a [f64]; 2];

/// Sums over the intervals of a channel: of the modelled way, of the squares of the modelled and the counted way, and of their product,
/// counts.
#[derive(Clone, Copy, Default)]
pub(super) struct Motion {
    pub(super) way: f64,
    pub(super) model: f64,
    pub(super) turned: f64,
    pub(super) both: f64,
    /// Each interval begins and ends between two counts of each wheel.
    pub(super) rounding: f64,
}

impl Motion {
    fn add(&mut self, model: f64, turned: f64) {
        self.way += model.abs();
        self.model += model * model;
        self.turned += turned * turned;
        self.both += model * turned;
        self.rounding += 1.0;
    }

    pub(super) fn with(&self, other: &Self) -> Self {
        Self {
            way: self.way + other.way,
            model: self.model + other.model,
            turned: self.turned + other.turned,
            both: self.both + other.both,
            rounding: self.rounding + other.rounding,
        }
    }

    /// The sum of squares of what was counted less `factor` times what was modelled.
    pub(super) fn unlike(&self, factor: f64) -> f64 {
        self.turned - 2.0 * factor * self.both + factor * factor * self.model
    }

    pub(super) fn factor(&self) -> f64 {
        (self.both / self.model).clamp(*FACTORS.start(), *FACTORS.end())
    }

    pub(super) fn is_as_modelled(&self, factor: f64) -> bool {
        self.unlike(factor) <= UNEXPLAINED * self.model.max(self.turned) + self.rounding
    }
}
