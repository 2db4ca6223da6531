//! Detection of sensors that are all deaf, as "nothing in range" is also normal in the open.
//!
//! With nothing in reach, infrared rangers still read the end of their scale in a quarter of the
//! frames, by noise. In 107 recorded missions of robots with seven rangers, some with moving things
//! and harsh noise, two successive frames were never empty. Empty frames are thus unlikely if
//! earlier frames had many end-of-scale readings.
//!
//! Without such noise deafness looks like an empty hall, which a robot must cross. It then goes
//! slowly once it has driven the reach of its sensors without a reading.

use std::collections::BTreeMap;

use common::{
    mission::Mission,
    samples::{RangeReading, RangeStatus},
};

/// Share of a sensor's reach beyond which readings are end-of-scale. Fewer than `LEAST_ENDS` per
/// frame prove nothing.
const END_SHARE: f64 = 0.85;
const LEAST_ENDS: f64 = 1.0;
/// Averaging length, frames.
const MEAN_OF: f64 = 30.0;
/// Missing end-of-scale readings for doubt and for certainty. Healthy sensors reached 3.7.
const MISSING: [f64; 2] = [6.0, 12.0];
/// Spells of certain deafness, each ended by a reading, that show sensors deaf in motion.
const SPELLS: u32 = 3;

/// Sum of readings due during a silence.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Missing {
    sum: f64,
    spells: u32,
}

impl Missing {
    pub(super) fn add(&mut self, more: f64, sure: f64) {
        assert!(more >= 0.0 && sure > 0.0);
        let was_sure = self.sum >= sure;
        self.sum += more;
        self.spells += u32::from(!was_sure && self.sum >= sure);
    }

    pub(super) fn end(&mut self) {
        self.sum = 0.0;
    }

    pub(super) fn is(self, least: f64) -> bool {
        self.sum >= least || self.is_in_motion()
    }

    fn is_in_motion(self) -> bool {
        self.spells >= SPELLS
    }
}

#[derive(Clone, Debug, Default)]
pub(super) struct Deafness {
    /// Reaches by row, metres.
    sensors: BTreeMap<u8, f64>,
    /// Values of the current frame.
    answers: bool,
    hears: bool,
    ends: f64,
    mean_ends: f64,
    /// Values since the last reading.
    frames: u32,
    missing: Missing,
    way_m: f64,
}

impl Deafness {
    pub(super) fn of(mission: &Mission) -> Self {
        let table = (0..).zip(mission.sensor_table()).filter(|(_, sensor)| sensor.used);
        let sensors = table.map(|(row, sensor)| (row, sensor.reach_m)).collect();
        Self { sensors, ..Self::default() }
    }

    pub(super) fn reset(&mut self) {
        *self = Self { sensors: std::mem::take(&mut self.sensors), ..Self::default() };
    }

    pub(super) fn take(&mut self, readings: &[RangeReading]) {
        for reading in readings {
            let Some(reach_m) = self.sensors.get(&reading.sensor) else { continue };
            let status = reading.status();
            self.answers |= status != RangeStatus::Invalid;
            if status == RangeStatus::Measured {
                self.hears = true;
                self.ends += f64::from(u8::from(reading.range_m > END_SHARE * reach_m));
            }
        }
    }

    /// Completes a frame after a motion of `way_m`.
    pub(super) fn went(&mut self, way_m: f64) {
        if self.hears {
            self.mean_ends += (self.ends - self.mean_ends) / MEAN_OF;
            assert!(self.mean_ends >= 0.0);
            self.missing.end();
            (self.frames, self.way_m) = (0, 0.0);
        } else if self.answers {
            self.frames += 1;
            self.way_m += way_m.abs();
            if self.mean_ends >= LEAST_ENDS {
                self.missing.add(self.mean_ends, MISSING[1]);
            }
        }
        (self.answers, self.hears, self.ends) = (false, false, 0.0);
    }

    /// Explains doubtful, or surely deaf, sensors.
    pub(super) fn judged(&self, sure: bool) -> Option<String> {
        let reach_m = self.sensors.values().copied().fold(0.0, f64::max);
        let is_open = !sure && self.way_m > reach_m;
        if !self.missing.is(MISSING[usize::from(sure)]) && !is_open {
            return None;
        }
        let Self { frames, way_m, .. } = self;
        let when = match self.missing.is_in_motion() {
            true => format!("has heard anything while the robot moved, {SPELLS} times"),
            false => format!("has heard anything in {frames} frames and {way_m:.1} m"),
        };
        Some(format!(
            "no ranging sensor {when}: the ground is open, or the sensors are deaf; check their supply and cable, then run `firsthand stop` and `resume`"
        ))
    }
}

#[cfg(test)]
mod tests {

    use super::*;
    use crate::testing::mission;

    /// Judges a ranger, row 3, with these readings, centimetres, on a robot that drives 0.05 m per
    /// frame.
    fn judged(ranges: impl Iterator<Item = Option<u8>>) -> [bool; 2] {
        let mut deafness = Deafness::of(&mission(""));
        let judgement = judge(&mut deafness, ranges);
        deafness.reset();
        assert_eq!(judge(&mut deafness, std::iter::empty()), [false; 2]);
        judgement
    }

    fn judge(deafness: &mut Deafness, ranges: impl Iterator<Item = Option<u8>>) -> [bool; 2] {
        for range in ranges {
            let status = range.map_or(RangeStatus::Nothing, |_| RangeStatus::Measured);
            let range_m = f64::from(range.unwrap_or_default()) / 100.0;
            let of = |sensor: u8| RangeReading { range_m, sensor, raw: 0, status: status.into() };
            deafness.take(&[of(3), of(4)]);
            deafness.went(0.05);
        }
        [false, true].map(|sure| deafness.judged(sure).is_some())
    }

    fn frames(range: Option<u8>, count: usize) -> impl Iterator<Item = Option<u8>> {
        std::iter::repeat_n(range, count)
    }

    #[test]
    fn rangers_whose_noise_at_the_end_of_their_scale_is_missing_are_doubted_and_then_surely_deaf() {
        // A robot that leaves what it saw for open ground, or never hears anything, goes slowly after
        // its sensors' reach, and does not stand.
        for (heard, silent, judgement) in [
            (Some(79), 2, [false, false]),
            (Some(79), 4, [true, false]),
            (Some(79), 8, [true, true]),
            (Some(50), 50, [false, false]),
            (Some(50), 500, [true, false]),
            (None, 50, [false, false]),
            (None, 500, [true, false]),
        ] {
            let before = if heard.is_some() { 60 } else { 0 };
            let all = frames(heard, before).chain(frames(None, silent));
            assert_eq!(judged(all), judgement, "{heard:?} {silent}");
        }
    }

    #[test]
    fn sensors_that_hear_only_whenever_the_robot_stands_are_deaf_until_it_is_resumed() {
        let spell = || frames(Some(79), 60).chain(frames(None, 9));
        let hears = || frames(Some(50), 9);
        assert_eq!(judged(spell().chain(spell()).chain(hears())), [false, false]);
        assert_eq!(judged(spell().chain(spell()).chain(spell()).chain(hears())), [true, true]);
    }
}
