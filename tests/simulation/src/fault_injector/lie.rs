//! Lies: a stream of the robot's data, and how it differs from the truth.

use std::{collections::VecDeque, fmt, time::Duration};

use common::{
    json_wire::Report,
    mission::{Mission, Protocol, Sensor, SensorKind},
};

use crate::random::Random;

/// Longest history of a value.
const MOST_KEPT: usize = 256;
const PAUSES_EVERY_S: f64 = 4.0;
/// Frozen range of a sensor without earlier readings.
const FROZEN_M: f64 = 1.5;
const LEAST_M: f64 = 0.02;
/// Number of the first beam; smaller ones are those of ranges.
const BEAMS: usize = 64;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stream {
    Wheel(usize),
    Wheels,
    Gyro,
    Range(usize),
    /// Every second one, from this on.
    HalfOfRanges(usize),
    AllRanges,
}

impl Stream {
    const fn is_angle(self) -> bool {
        matches!(self, Self::Wheel(_) | Self::Wheels | Self::Gyro)
    }
}

/// Sizes are radians of wheels and gyros, and metres of ranges.
#[derive(Clone, Copy, Debug)]
pub enum Change {
    /// The change since the lie began, or the range, times a factor.
    Scaled(f64),
    Shifted(f64),
    /// By so much a second.
    Drifts(f64),
    Stuck,
    /// Stuck but for noise, of beams a tenth of their range.
    Near(f64),
    /// By seconds.
    Late(f64),
    Noisy(f64),
    /// Angles by so much more each second, ranges every second second.
    Jumps(f64),
    /// Angles change at most by so much a second, ranges end there.
    Capped(f64),
    /// Rounded to multiples.
    Coarse(f64),
    /// Stuck for so many of each 4 s.
    Pauses(f64),
    /// Random within a range, for a share of the readings.
    Wild(f64, [f64; 2]),
    /// Nothing in reach, for a share of the readings.
    Deaf(f64),
}

impl Change {
    fn draw(stream: Stream, chance: &mut Random) -> Self {
        let number = chance.below(3);
        let size = [0.1, 0.3, 1.0][number];
        let sign = if chance.chance(0.5) { 1.0 } else { -1.0 };
        // Of these turns of wheels, turns of the body, or ranges.
        let unit = match stream {
            Stream::Wheel(_) | Stream::Wheels => 1.0,
            Stream::Gyro => 0.2,
            _ => 0.6,
        };
        let is_range = !stream.is_angle();
        match chance.below(if is_range { 12 } else { 11 }) {
            0 => Self::Scaled([0.94_f64, 0.75, 0.5][number].powf(sign)),
            1 => Self::Shifted(3.0 * sign * size * unit),
            2 => Self::Drifts(sign * size * unit),
            3 => Self::Stuck,
            4 => Self::Late(1.5 * size),
            5 => Self::Noisy(size * unit),
            6 => Self::Jumps(sign * size * unit),
            7 => Self::Capped(0.3 * unit / size),
            8 => Self::Coarse(2.0 * size * unit),
            9 => Self::Pauses(2.0 * size),
            10 if is_range => Self::Wild(size, [0.1, 2.5]),
            10 => Self::Scaled(-1.0),
            _ => Self::Deaf(size),
        }
    }
}

#[derive(Clone, Debug, Default)]
struct Channel {
    /// Time of the first false value, and the value before.
    began: Option<(Duration, f64)>,
    told: f64,
    history: VecDeque<(Duration, f64)>,
}

#[derive(Clone, Debug)]
pub struct Lie {
    stream: Stream,
    change: Change,
    chance: Random,
    channels: Vec<Channel>,
    angles: Option<(Duration, [f64; 2])>,
}

impl Lie {
    pub(crate) fn new(stream: Stream, change: Change, seed: u64) -> Self {
        let chance = Random::new(seed, 29);
        Self { stream, change, chance, channels: Vec::new(), angles: None }
    }

    /// Draws the lie of the mission's seed.
    pub fn draw(mission: &Mission) -> Self {
        use Stream::*;
        let single = |sensor: &&Sensor| sensor.kind != SensorKind::Scan;
        let ranges = match mission.robot.protocol() {
            Protocol::X80 => 3,
            _ => mission.sensor_table().iter().filter(single).count(),
        };
        let mut chance = Random::new(mission.seed, 31);
        let [wheel, one] = [2, ranges].map(|of| chance.below(of));
        let mut streams = vec![Wheel(wheel), Wheels, AllRanges];
        if mission.robot.gyro() {
            streams.push(Gyro);
        }
        if ranges > 1 {
            streams.extend([Range(0), Range(one), HalfOfRanges(wheel)]);
        }
        let stream = streams[chance.below(streams.len())];
        Self::new(stream, Change::draw(stream, &mut chance), mission.seed)
    }

    /// Changes `report`. `before` holds the newest values from before the lie.
    pub(crate) fn change(&mut self, report: &mut Report, before: &Report, now: Duration) {
        use Stream::*;
        let stream = self.stream;
        match stream {
            Wheel(_) | Wheels => return self.miscount(report, before, now),
            Gyro => {
                if let Some(gyro) = &mut report.gyro {
                    *gyro = self.told(0, (*gyro, before.gyro), now).unwrap_or(*gyro);
                }
                return;
            }
            _ => {}
        }
        let lies = |number: usize| match stream {
            Range(one) => one == number,
            HalfOfRanges(from) => number % 2 == from,
            _ => true,
        };
        for (number, (name, range)) in report.ranges.iter_mut().enumerate() {
            if lies(number) {
                let before = before.ranges.get(name).copied().flatten().unwrap_or(FROZEN_M);
                *range = self.read(number, *range, Some(before), now);
            }
        }
        if stream == AllRanges {
            let before_of = |name| Some(&before.scans.get(name)?.ranges);
            let named =
                report.scans.iter_mut().map(|(name, scan)| (before_of(name), &mut scan.ranges));
            let own = report.scan.iter_mut().map(|beams| (before.scan.as_ref(), beams));
            let mut number = BEAMS;
            for (before, beams) in own.chain(named) {
                for (at, beam) in beams.iter_mut().enumerate() {
                    let before = before.and_then(|before| *before.get(at)?).map(f64::from);
                    let read = self.read(number, beam.map(f64::from), before, now);
                    (*beam, number) = (read.map(|beam| beam as f32), number + 1);
                }
            }
        }
    }

    fn miscount(&mut self, report: &mut Report, before: &Report, now: Duration) {
        let Some(mut angles) = report.wheels else { return };
        for (wheel, angle) in angles.iter_mut().enumerate() {
            if self.stream == Stream::Wheels || self.stream == Stream::Wheel(wheel) {
                let truth = (*angle, before.wheels.map(|before| before[wheel]));
                *angle = self.told(wheel, truth, now).unwrap_or(*angle);
            }
        }
        let last = self.angles.replace((now, angles));
        if let (Some((then, last)), Some(speeds)) = (last, &mut report.speeds)
            && now > then
        {
            let for_s = (now - then).as_secs_f64();
            *speeds = [0, 1].map(|wheel| (angles[wheel] - last[wheel]) / for_s);
        }
        report.wheels = Some(angles);
    }

    fn read(
        &mut self,
        number: usize,
        range: Option<f64>,
        before: Option<f64>,
        now: Duration,
    ) -> Option<f64> {
        let truth = match (self.change, range) {
            // These need no truth.
            (Change::Stuck | Change::Near(_), _) => before?,
            (Change::Wild(..), _) => {
                let told = self.told(number, (range.unwrap_or(f64::NAN), None), now);
                return told.filter(|told| !told.is_nan());
            }
            (_, Some(range)) if range >= 0.0 => range,
            _ => return range,
        };
        Some(self.told(number, (truth, before), now)?.max(LEAST_M))
    }

    /// Returns what is told of a value, which was another one before the lie; none for nothing in
    /// reach.
    fn told(
        &mut self,
        number: usize,
        (truth, before): (f64, Option<f64>),
        now: Duration,
    ) -> Option<f64> {
        use Change::*;
        if self.channels.len() <= number {
            self.channels.resize_with(number + 1, Channel::default);
        }
        let (channel, chance) = (&mut self.channels[number], &mut self.chance);
        let is_angle = self.stream.is_angle();
        let (began, onset) = *channel.began.get_or_insert_with(|| {
            channel.told = before.unwrap_or(truth);
            (now, channel.told)
        });
        let seconds = (now - began).as_secs_f64();
        let (then, last) = channel.history.back().copied().unwrap_or((now, onset));
        channel.history.push_back((now, truth));
        channel.history.drain(..channel.history.len().saturating_sub(MOST_KEPT));
        let zero = if is_angle { onset } else { 0.0 };
        channel.told = match self.change {
            Scaled(factor) => zero + factor * (truth - zero),
            Shifted(by) => truth + by,
            Drifts(by) => truth + by * seconds,
            Stuck => onset,
            Near(by) => {
                let of = if number < BEAMS { 1.0 } else { onset / 10.0 };
                onset + of * chance.within(-by, by)
            }
            Late(by_s) => {
                let old = |(at, _): &&(Duration, f64)| *at + Duration::from_secs_f64(by_s) <= now;
                channel.history.iter().rfind(old).map_or(onset, |(_, old)| *old)
            }
            Noisy(by) => truth + chance.within(-by, by),
            Jumps(by) if is_angle => truth + by * seconds.floor(),
            Jumps(by) => truth + by * (seconds.floor() % 2.0),
            Capped(most) if is_angle => {
                let most = most * (now - then).as_secs_f64();
                channel.told + (truth - last).clamp(-most, most)
            }
            Capped(most) => truth.min(most),
            Coarse(step) => (truth / step).round() * step,
            Pauses(for_s) if seconds % PAUSES_EVERY_S < for_s => channel.told,
            Wild(share, [least, most]) if chance.chance(share) => chance.within(least, most),
            Deaf(share) if chance.chance(share) => return None,
            Pauses(_) | Wild(..) | Deaf(_) => truth,
        };
        Some(channel.told)
    }
}

impl fmt::Display for Lie {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} {:?}", self.stream, self.change)
    }
}
