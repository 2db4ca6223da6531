//! Contacts, seen by held wheels.
//!
//! A wheel that does not turn as told is held, or its encoder is dead. A held motor draws several times the current of a rolling one.
//! The encoder is suspected where a current cannot be right:
//! - it is above the range of the AD converter
//! - it stays high while the wheel is told to stand: the frames repeat
//! - it is high while the wheel rolls as told: `robot.held_current_ad` is not this robot's

use std::{f64::consts::PI, time::Duration};

use common::{clock::MissionTime, mission::Mission, samples::ContactSample};

use super::monitor::Condition;

/// A wheel with a held one's current is held after this.
pub(crate) const HELD_AFTER: Duration = Duration::from_millis(400);
/// The robot stands while the contact is mapped and the planner restarted.
pub(crate) const STANDS_FOR: Duration = Duration::from_millis(500);
/// The least time between two contacts: one is answered before the next, in lockstep too.
const NEXT_AFTER: Duration = Duration::from_secs(1);
/// A standing wheel's current has fallen by then.
const FALLEN_AFTER: Duration = Duration::from_millis(350);
/// A current that is so long high while its wheel rolls as told is no sign of a held wheel.
const HIGH_AND_ROLLS: Duration = Duration::from_secs(2);
const MOST_AD: u16 = 4095;
/// Half the arc of a touch with both wheels held, radians.
const HALF_WIDTH: f64 = PI / 4.0;
/// The touched arc of a body with one wheel held: its bearing, to that side, and half of it, radians.
const AT_ONE_WHEEL: (f64, f64) = (PI / 4.0, PI / 6.0);
/// A command below this share of the rims' relative speed is a turn on the spot.
const LEAST_AHEAD_SHARE: f64 = 0.5;

#[derive(Clone, Debug, Default)]
pub(super) struct Contacts {
    limit_ad: u16,
    currents: [u16; 2],
    /// High while the wheel rolled as told, seconds.
    high_and_rolls_s: [f64; 2],
    /// The held wheels, and since when that is known.
    held: Option<([bool; 2], MissionTime)>,
    new: Option<ContactSample>,
}

impl Contacts {
    pub(super) fn new(mission: &Mission) -> Self {
        Self { limit_ad: mission.robot.held_current_ad, ..Self::default() }
    }

    pub(super) const fn take_currents(&mut self, currents: [u16; 2]) {
        self.currents = currents;
    }

    /// Whether each motor draws a held one's current.
    pub(super) fn high(&self) -> [bool; 2] {
        let range = self.limit_ad.max(1)..=MOST_AD;
        let is_sign = |s: &f64| self.limit_ad > 0 && *s < HIGH_AND_ROLLS.as_secs_f64();
        [0, 1].map(|wheel| {
            range.contains(&self.currents[wheel]) && is_sign(&self.high_and_rolls_s[wheel])
        })
    }

    pub(super) fn rolled(&mut self, wheel: usize, gap_s: f64) {
        self.high_and_rolls_s[wheel] += gap_s;
    }

    /// These wheels are held, told these speeds, counts/s. Returns whether the contact is new.
    pub(super) fn begin(&mut self, held: [bool; 2], asked: [f64; 2], now: MissionTime) -> bool {
        if self.held.is_some_and(|(_, since)| now.since(since) < NEXT_AFTER) {
            return false;
        }
        self.held = Some((held, now));
        let (bearing_rad, half_width_rad) = arc(held, asked);
        let [left, right] = held.map(u8::from);
        self.new = Some(ContactSample {
            bearing_rad,
            half_width_rad,
            left,
            right,
            ..ContactSample::default()
        });
        true
    }

    /// A held wheel whose current stays although it was told to stand.
    pub(super) fn repeats(&self, now: MissionTime) -> Option<usize> {
        let (held, since) = self.held?;
        let stood = now.since(since);
        let stands = stood >= FALLEN_AFTER && stood < NEXT_AFTER;
        let high = self.high();
        [0, 1].into_iter().find(|&wheel| stands && held[wheel] && high[wheel])
    }

    /// The next tick alone has it.
    pub(super) const fn take(&mut self) -> Option<ContactSample> {
        self.new.take()
    }

    pub(super) const fn reset(&mut self) {
        (self.held, self.new) = (None, None);
    }

    pub(super) fn condition(&self, now: MissionTime) -> Condition {
        self.held.is_some_and(|(_, since)| now.since(since) < STANDS_FOR).into()
    }

    pub(super) fn explain(&self) -> Option<String> {
        let wheels = match self.held?.0 {
            [true, false] => "the left wheel is",
            [false, true] => "the right wheel is",
            _ => "the wheels are",
        };
        Some(format!("{wheels} held: the robot touches something, or something blocks a wheel"))
    }
}

/// The direction of the touch, and half the angle in which it may be, radians.
fn arc(held: [bool; 2], [left, right]: [f64; 2]) -> (f64, f64) {
    let ahead = left + right;
    if ahead.abs() < LEAST_AHEAD_SHARE * (right - left).abs() {
        return (0.0, 0.0);
    }
    let (aside, half_width) = AT_ONE_WHEEL;
    let (bearing, half_width) = match held {
        [true, false] => (aside, half_width),
        [false, true] => (-aside, half_width),
        _ => (0.0, HALF_WIDTH),
    };
    (if ahead > 0.0 { bearing } else { PI - bearing }, half_width)
}
