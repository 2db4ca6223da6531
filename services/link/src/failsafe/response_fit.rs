//! Fit of a base response to the newest commands and counts.
//!
//! A grid of delays and accelerations predicts wheel travel. Part of it limits each wheel; the rest
//! limits their mean and difference separately, and fits the difference by itself. A response
//! explains the wheels if each, and their difference, rolled as predicted up to one factor. Dead,
//! swapped and reversed wheels fit no response.

use std::collections::VecDeque;

use common::{clock::MissionTime, mission::Response};

use super::{
    keep,
    modelled_wheels::{Axle, Limits},
};

const KEPT_S: f64 = 5.0;
/// Extra retention of commands, because the wheels may roll when the oldest counts are taken.
const BEFORE_S: f64 = 2.0;
/// Bound on kept entries at any input rate.
const MOST_KEPT: usize = 512;
const DEAD_TIMES: u32 = 21;
pub(super) const DEAD_TIME_STEP_S: f64 = 0.05;
/// Acceleration grid, and then infinite. The slowest is a heavy base that a person pushes in vain.
const LEAST_ACCELERATION_M_S2: f64 = 0.15;
pub(super) const ACCELERATION_RATIO: f64 = 1.25;
const ACCELERATIONS: i32 = 16;
/// Scale of the turn grid, per wheel. At 4.5 grid steps lower, no entry equals single wheels.
const TURN_SHARE: f64 = 0.366;
/// Least squared correlation of travel and model.
const EXPLAINED: f64 = 0.8;
/// Plausible factors of wheels.
const FACTORS: std::ops::RangeInclusive<f64> = 0.5..=1.5;
/// Least modelled travel that is evidence, metres.
const LEAST_M: f64 = 0.04;
/// Largest unexplained share of judged motion.
const UNEXPLAINED: f64 = 0.25;

/// Grid of added delay.
const LATER_STEP_S: f64 = 0.1;
const LATER_STEPS: i32 = 20;
const LEAST_LATER_S: f64 = 0.25;
const LEAST_INTERVALS: usize = 8;
/// Least improvement, and noise, (m/s)^2 s; least ratio.
const LEAST_BETTER: f64 = 0.03;
const NOISE: f64 = 0.01;
const BETTER: f64 = 1.5;
/// Largest unexplained share of the wheels' motion, and least explained share of their difference.
const LATER_UNEXPLAINED: f64 = 0.1;
const TURN_EXPLAINED: f64 = 0.5;

/// Least motion that identifies a response, and tolerance of alike responses, (m/s)^2 s.
const LEAST_MOTION: f64 = 0.05;
const ALIKE: f64 = 0.003;
/// Largest spread of alike stopping distances: a factor, plus travel for these seconds.
const TOLD_APART: f64 = 1.3;
const TOLD_APART_S: f64 = 0.15;

/// Squared relative difference of equally commanded wheels.
const DIFFERENT: f64 = 0.05 * 0.05;

/// Allowed excess over a command, as a share of the fastest wheel's speed.
const UNTOLD_SHARE: f64 = 0.25;

/// Left, right, and their difference.
const CHANNELS: usize = 3;
const TURN: usize = 2;

/// Motion that a response must explain to end a suspicion, besides that of a wheel before it died.
#[derive(Clone, Copy)]
pub(super) struct Suspected {
    pub channel: usize,
    /// Start of the evidence, seconds.
    pub from_s: f64,
}

#[derive(Clone, Copy)]
pub(super) struct Alike {
    /// Response that stops last from top speed.
    pub slowest: Response,
    /// Shortest stopping distance among them, metres.
    pub stops_within_m: f64,
    /// Whether the alike responses differ little.
    pub are_told_apart: bool,
}

fn is_far_better(unlike: f64, other: f64) -> bool {
    other > (unlike + LEAST_BETTER).max(BETTER * (unlike + NOISE))
}

pub(super) fn channels([left, right]: [f64; 2]) -> [f64; CHANNELS] {
    [left, right, right - left]
}

#[derive(Clone, Debug)]
pub(super) struct ResponseFit {
    axle: Axle,
    /// Times and commands, counts/s.
    commands: VecDeque<(f64, [f64; 2])>,
    /// Interval ends and counts; None if unknown.
    turned: VecDeque<(f64, Option<[f64; 2]>)>,
}

impl ResponseFit {
    pub(super) const fn new(axle: Axle) -> Self {
        Self { axle, commands: VecDeque::new(), turned: VecDeque::new() }
    }

    pub(super) fn commanded(&mut self, counts: [f64; 2], now: MissionTime) {
        keep(&mut self.commands, (now.seconds(), counts), KEPT_S + BEFORE_S, MOST_KEPT);
    }

    pub(super) fn turned(&mut self, counts: Option<[f64; 2]>, now: MissionTime) {
        // In lockstep several frames may share a tick's time.
        if let Some((at, Some(before))) = self.turned.back_mut()
            && *at == now.seconds()
        {
            let [left, right] = counts.unwrap_or_default();
            *before = [before[0] + left, before[1] + right];
            return;
        }
        keep(&mut self.turned, (now.seconds(), counts), KEPT_S, MOST_KEPT);
    }

    /// Returns whether wheels or limited axes exceed every command.
    ///
    /// The bound is the largest of 0, commands since `from_s`, and earlier ones less the limit's
    /// deceleration. The excess must pass `least` counts/s plus a share of the fastest.
    pub(super) fn is_untold(
        &self,
        speeds: [f64; 2],
        (from_s, limits): (f64, Limits),
        least: f64,
    ) -> bool {
        let told = |channel: usize, sign: f64| {
            let left = |(at, told): &(f64, [f64; 2])| {
                let most = limits.most[channel % 2];
                let slowed = if *at < from_s { most * (from_s - at) } else { 0.0 };
                sign * channels(limits.axes(*told))[channel] - slowed
            };
            self.commands.iter().map(left).fold(0.0, f64::max)
        };
        let fastest = [0, 1].map(|wheel| told(wheel, 1.0).max(told(wheel, -1.0)));
        let fastest = fastest[0].max(fastest[1]);
        let is_beyond = |(channel, speed): (usize, f64)| {
            speed.abs() > told(channel, speed.signum()) + least + UNTOLD_SHARE * fastest
        };
        let judged = if limits.are_apart { 2 } else { self.judged() };
        fastest > 0.0
            && channels(limits.axes(speeds)).into_iter().enumerate().take(judged).any(is_beyond)
    }

    /// Returns the number of judged channels. Only one wheel of a car drives.
    pub(super) fn judged(&self) -> usize {
        self.axle.track_m.map_or(1, |_| CHANNELS)
    }

    /// Returns the best response for both motion and suspicion, with the lag of `stated`. Wheels
    /// that do not drive are left out.
    pub(super) fn explain(&self, stated: Response, suspected: Suspected) -> Option<Response> {
        let explained = self.weighed(|dead_time_s, limits, courses| {
            let motions = self.motions(dead_time_s, limits, courses, suspected.from_s);
            let explained = self.explained(motions, suspected)?;
            let lag_s = stated.lag_s.min(dead_time_s);
            assert!((0.0..=dead_time_s).contains(&lag_s));
            let found = self.axle.response(dead_time_s - lag_s, limits);
            Some((explained, Response { lag_s, ..found }))
        });
        let best = explained.into_iter().max_by(|(one, _), (other, _)| one.total_cmp(other));
        best.filter(|(explained, _)| *explained >= EXPLAINED).map(|(_, response)| response)
    }

    /// Returns `stated` with the added delay that fits far better. It may lie in the base or its
    /// network.
    pub(super) fn later(&self, stated: Response) -> Option<Response> {
        let (last_s, _) = self.turned.back()?;
        // A network that begins to lag is silent for a moment.
        let is_gap = |(_, turned): &&(f64, Option<[f64; 2]>)| turned.is_none();
        let (from_s, _) = self.turned.iter().rfind(is_gap).or(self.turned.front())?;
        let intervals = self.turned.iter().filter(|(at, _)| at > from_s).count();
        if intervals < LEAST_INTERVALS {
            return None;
        }
        let scale = self.scale(intervals, last_s - from_s);
        let (limits, courses) = self.courses(self.axle.limits(&stated));
        let fit = |later_s: f64| {
            let dead_time_s = stated.dead_time_s() + later_s;
            let [_, channels] = self.motions(dead_time_s, limits, courses.each_ref(), *from_s);
            let (wheels, factor) = self.of_wheels(&channels);
            let turn = &channels[TURN];
            let unlike = wheels.unlike(factor);
            let turns = turn.both * turn.both.abs() >= TURN_EXPLAINED * turn.model * turn.turned;
            let explains =
                unlike <= LATER_UNEXPLAINED * wheels.turned && (self.judged() == 1 || turns);
            (scale * unlike, later_s, explains)
        };
        let (later, prompt): (Vec<_>, Vec<_>) = (-LATER_STEPS..=LATER_STEPS)
            .map(|step| f64::from(step) * LATER_STEP_S)
            .chain([-stated.dead_time_s()])
            .filter(|later_s| stated.dead_time_s() + later_s >= 0.0)
            .map(fit)
            .partition(|(_, later_s, _)| *later_s >= LEAST_LATER_S);
        // In repeating motion, an early base looks like one a whole round late.
        let prompt = prompt.into_iter().map(|(unlike, ..)| unlike).fold(f64::INFINITY, f64::min);
        let (unlike, later_s, explains) =
            later.into_iter().min_by(|one, other| one.0.total_cmp(&other.0))?;
        let is_later = explains && is_far_better(unlike, prompt);
        is_later.then_some(Response { delay_s: stated.delay_s + later_s, ..stated })
    }

    /// Returns the responses that explain the motion about as well as the best one, unless
    /// `believed` fits nearly as well.
    pub(super) fn alike(&self, believed: Option<Response>, top_speed_m_s: f64) -> Option<Alike> {
        let (first_s, _) = self.turned.front()?;
        let (last_s, _) = self.turned.back()?;
        let intervals = self.turned.iter().filter(|(_, turned)| turned.is_some()).count();
        let scale = self.scale(intervals, last_s - first_s);
        // Unexplained motion, all motion, and the factor.
        let fit = |[channels, _]: [[Motion; CHANNELS]; 2]| {
            let (wheels, factor) = self.of_wheels(&channels);
            (scale * wheels.unlike(factor), scale * wheels.turned, factor)
        };
        let believed = believed.map(|it| {
            let (limits, courses) = self.courses(self.axle.limits(&it));
            fit(self.motions(it.dead_time_s(), limits, courses.each_ref(), *first_s)).0
        });
        // Most robots answer as stated: even a perfect fit is not far better.
        if believed.is_some_and(|believed| !is_far_better(0.0, believed)) {
            return None;
        }
        let fits = self.weighed(|dead_time_s, limits, courses| {
            let (unlike, all, factor) = fit(self.motions(dead_time_s, limits, courses, *first_s));
            // Wheels that reach less speed reach it sooner.
            let most = limits.most.map(|most| most * factor);
            let response = self.axle.response(dead_time_s, Limits { most, ..limits });
            let stops_m = response.way_to_stop_m(top_speed_m_s, dead_time_s);
            let tells = all >= LEAST_MOTION && unlike <= LATER_UNEXPLAINED * all;
            tells.then_some((unlike, stops_m, response))
        });
        let (least, best_m, _) = *fits.iter().min_by(|one, other| one.0.total_cmp(&other.0))?;
        if believed.is_some_and(|believed| !is_far_better(least, believed)) {
            return None;
        }
        let near = || fits.iter().filter(|(unlike, ..)| *unlike <= BETTER * least + ALIKE);
        let (_, slowest_m, slowest) = *near().max_by(|one, other| one.1.total_cmp(&other.1))?;
        let most_m = TOLD_APART * best_m + TOLD_APART_S * top_speed_m_s;
        Some(Alike {
            slowest,
            stops_within_m: near().fold(slowest_m, |least, (_, stops_m, _)| least.min(*stops_m)),
            are_told_apart: slowest_m <= most_m,
        })
    }

    /// Returns the least explained share of the channels' motion. None for an implausible factor,
    /// deviating judged motion, or a suspected channel with hardly any command.
    fn explained(
        &self,
        [all, judged_all]: [[Motion; CHANNELS]; 2],
        suspected: Suspected,
    ) -> Option<f64> {
        let mut least: Option<f64> = None;
        let motions = all.iter().zip(&judged_all).enumerate();
        for (channel, (all, judged)) in motions.take(self.judged()) {
            if all.way >= LEAST_M * self.axle.counts_per_m {
                let factor = all.both / all.model;
                if !FACTORS.contains(&factor) || all.turned <= 0.0 || !judged.is_as_modelled(factor)
                {
                    return None;
                }
                let explained = all.both * all.both / (all.model * all.turned);
                least = Some(least.map_or(explained, |least| least.min(explained)));
            } else if channel == suspected.channel {
                // A small difference may be a mismatch of wheels.
                let wheels = judged_all[0].turned + judged_all[1].turned;
                if channel != TURN || judged.unlike(1.0) > DIFFERENT * wheels + judged.rounding {
                    return None;
                }
            }
        }
        least
    }

    /// Returns the scale from squared counts to (m/s)^2 s.
    fn scale(&self, intervals: usize, in_s: f64) -> f64 {
        intervals as f64 / in_s / self.axle.counts_per_m.powi(2)
    }

    /// Applies `weigh` to each response of the grid. Of separate turns only the best fit is tried;
    /// responses of single wheels come last.
    fn weighed<T>(&self, weigh: impl Fn(f64, Limits, [&Course; 2]) -> Option<T>) -> Vec<T> {
        let mut weighed = Vec::new();
        let accelerations = (0..ACCELERATIONS)
            .map(|power| LEAST_ACCELERATION_M_S2 * ACCELERATION_RATIO.powi(power))
            .chain([f64::INFINITY]);
        for are_apart in [true, false].into_iter().skip(usize::from(self.judged() == 1)) {
            let share = if are_apart { TURN_SHARE } else { 1.0 };
            let courses = |acceleration: f64| {
                let most = acceleration * self.axle.counts_per_m;
                self.courses(Limits { are_apart, most: [most, most * share] })
            };
            let grid: Vec<_> = accelerations.clone().map(courses).collect();
            for step in 0..DEAD_TIMES {
                let dead_time_s = f64::from(step) * DEAD_TIME_STEP_S;
                let unlike = grid.iter().map(|(_, [_, turn])| self.unlike_turn(turn, dead_time_s));
                let best = unlike.enumerate().min_by(|one, other| one.1.total_cmp(&other.1));
                let best = best.filter(|(_, unlike)| are_apart && !unlike.is_nan());
                for (index, one) in grid.iter().enumerate() {
                    if are_apart && best.is_none() {
                        continue;
                    }
                    let other = &grid[best.map_or(index, |(best, _)| best)];
                    let most = [one.0.most[0], other.0.most[1]];
                    let courses = [&one.1[0], &other.1[1]];
                    weighed.extend(weigh(dead_time_s, Limits { are_apart, most }, courses));
                }
            }
        }
        weighed
    }

    /// Returns the deviation from half the wheels' difference; NaN if unmodelled.
    fn unlike_turn(&self, course: &Course, dead_time_s: f64) -> f64 {
        let mut turn = Motion::default();
        for ((_, turned), modelled) in
            self.turned.iter().skip(1).zip(self.ways(course, dead_time_s))
        {
            if let Some([left, right]) = turned {
                turn.add(modelled, (right - left) / 2.0);
            }
        }
        turn.unlike(turn.factor())
    }

    /// Returns an axis' course without dead time.
    fn course(&self, limits: Limits, axis: usize) -> Course {
        let mut way = 0.0;
        let mut speed = 0.0;
        let mut course = Vec::with_capacity(2 * self.commands.len());
        let ends = self.commands.iter().skip(1).map(|(at, _)| *at).chain([f64::INFINITY]);
        for (&(at, told), end) in self.commands.iter().zip(ends).filter(|((at, _), end)| at < end) {
            let target = limits.axes(told)[axis];
            let rate = limits.most[axis].copysign(target - speed);
            let reached = (at + (target - speed) / rate).min(end);
            assert!((at..=end).contains(&reached));
            course.push([at, way, speed, if reached > at { rate } else { 0.0 }]);
            let before = speed;
            speed = if reached < end { target } else { speed + rate * (end - at) };
            way += (before + speed) / 2.0 * (reached - at);
            course.push([reached, way, speed, 0.0]);
            way += speed * (end - reached);
        }
        course
    }

    /// Returns the travel of each interval.
    fn ways<'a>(
        &'a self,
        course: &'a Course,
        dead_time_s: f64,
    ) -> impl Iterator<Item = f64> + use<'a> {
        let mut pieces = course.iter().peekable();
        let mut piece = &[0.0; 4];
        // The oldest counts only start the first interval.
        let mut before = None;
        self.turned.iter().filter_map(move |(until, _)| {
            while let Some(next) = pieces.next_if(|[from, ..]| *from <= until - dead_time_s) {
                piece = next;
            }
            let [from, way, speed, rate] = piece;
            let for_s = until - dead_time_s - from;
            let way = way + for_s * (speed + rate * for_s / 2.0);
            before.replace(way).map(|before| way - before)
        })
    }

    fn courses(&self, limits: Limits) -> (Limits, [Course; 2]) {
        (limits, [0, 1].map(|axis| self.course(limits, axis)))
    }

    /// Returns the channels' motion: all, and that since `from_s`.
    fn motions(
        &self,
        dead_time_s: f64,
        limits: Limits,
        courses: [&Course; 2],
        from_s: f64,
    ) -> [[Motion; CHANNELS]; 2] {
        let mut all = [Motion::default(); CHANNELS];
        let mut judged_all = all;
        let [one, other] = courses.map(|course| self.ways(course, dead_time_s));
        for ((&(until, turned), one), other) in self.turned.iter().skip(1).zip(one).zip(other) {
            let modelled = channels(limits.wheels([one, other]));
            for (channel, turned) in turned.map(channels).into_iter().flatten().enumerate() {
                all[channel].add(modelled[channel], turned);
                if until >= from_s {
                    judged_all[channel].add(modelled[channel], turned);
                }
            }
        }
        [all, judged_all]
    }

    fn of_wheels(&self, [left, right, _]: &[Motion; CHANNELS]) -> (Motion, f64) {
        let wheels = if self.judged() == 1 { *left } else { left.with(right) };
        (wheels, wheels.factor())
    }
}

/// Pieces of a course: start, travel, speed, acceleration; seconds and counts.
type Course = Vec<[f64; 4]>;

/// Sums over intervals, counts: modelled travel, squares of modelled and counted travel, their
/// product.
#[derive(Clone, Copy, Default)]
struct Motion {
    way: f64,
    model: f64,
    turned: f64,
    both: f64,
    /// Each interval begins and ends between two counts.
    rounding: f64,
}

impl Motion {
    fn add(&mut self, model: f64, turned: f64) {
        self.way += model.abs();
        self.model += model * model;
        self.turned += turned * turned;
        self.both += model * turned;
        self.rounding += 1.0;
    }

    fn with(&self, other: &Self) -> Self {
        Self {
            way: self.way + other.way,
            model: self.model + other.model,
            turned: self.turned + other.turned,
            both: self.both + other.both,
            rounding: self.rounding + other.rounding,
        }
    }

    fn unlike(&self, factor: f64) -> f64 {
        self.turned - 2.0 * factor * self.both + factor * factor * self.model
    }

    fn factor(&self) -> f64 {
        (self.both / self.model).clamp(*FACTORS.start(), *FACTORS.end())
    }

    fn is_as_modelled(&self, factor: f64) -> bool {
        self.unlike(factor) <= UNEXPLAINED * self.model.max(self.turned) + self.rounding
    }
}

#[cfg(test)]
mod tests;
