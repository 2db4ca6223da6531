//! Held wheels: contacts that the wheels show.
//!
//! A wheel that is told to turn and does not has a dead encoder, or something holds it. The motor current tells which: a held motor
//! draws several times the current of a rolling one. Where a current cannot be right, it tells nothing, and the encoder is suspected:
//! - a current above the range of the AD converter
//! - a current that stays high while the wheel is told to stand: the frames repeat
//! - a current that is high while the wheel rolls as told: `robot.held_current_ad` is not this robot's

use std::{f64::consts::PI, time::Duration};

use common::{clock::MissionTime, mission::Mission, samples::ContactSample};

use super::monitor::Condition;

/// The time after which a wheel that draws a held wheel's current is held.
pub(crate) const HELD_AFTER: Duration = Duration::from_millis(400);
/// The time for which the robot stands while the contact is mapped and the planner is restarted.
pub(crate) const STANDS_FOR: Duration = Duration::from_millis(500);
/// The least time between two contacts, so that the answer to one comes before the next, in lockstep too.
const NEXT_AFTER: Duration = Duration::from_secs(1);
/// The time after which the current of a wheel that stands has fallen.
const FALLEN_AFTER: Duration = Duration::from_millis(350);
/// The time after which a current that is high while its wheel rolls as told is no sign of a held wheel.
const HIGH_AND_ROLLS: Duration = Duration::from_secs(2);
/// The greatest value of the AD converter.
const MOST_AD: u16 = 4095;
/// Half the arc in which something touches a body both of whose wheels are held, radians.
const HALF_WIDTH: f64 = PI / 4.0;
/// Bearing of the arc if only one wheel is held, to its side, and half of that arc, radians.
const AT_ONE_WHEEL: (f64, f64) = (PI / 4.0, PI / 6.0);
/// Below this share of the rims' speed relative to each other a command is a turn on the spot.
const LEAST_AHEAD_SHARE: f64 = 0.5;

/// The motor currents of two wheels, and the last contact.
#[derive(Clone, Debug)]
pub(super) struct Contacts {
    limit_ad: u16,
    currents: [u16; 2],
    /// The time for which each current was high while its wheel rolled as told, seconds.
    high_and_rolls_s: [f64; 2],
    /// The wheels that are held, and the time since which that is known.
    held: Option<([bool; 2], MissionTime)>,
    /// The contact that no tick has shown yet.
    new: Option<ContactSample>,
}

impl Contacts {
    pub(super) fn new(mission: &Mission) -> Self {
        Self {
            limit_ad: mission.robot.held_current_ad,
            currents: [0; 2],
            high_and_rolls_s: [0.0; 2],
            held: None,
            new: None,
        }
    }

    pub(super) const fn take_currents(&mut self, currents: [u16; 2]) {
        self.currents = currents;
    }

    /// For each wheel, whether its motor draws the current of a held one.
    pub(super) fn high(&self) -> [bool; 2] {
        let range = self.limit_ad.max(1)..=MOST_AD;
        let is_sign = |s: &f64| self.limit_ad > 0 && *s < HIGH_AND_ROLLS.as_secs_f64();
        [0, 1].map(|wheel| {
            range.contains(&self.currents[wheel]) && is_sign(&self.high_and_rolls_s[wheel])
        })
    }

    /// Note that `wheel` rolled as told for `gap_s` seconds with a high current.
    pub(super) fn rolled(&mut self, wheel: usize, gap_s: f64) {
        self.high_and_rolls_s[wheel] += gap_s;
    }

    /// The wheels `held` are held, and were told these speeds, counts/s. Returns whether this is a new contact.
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

    /// A held wheel whose current has not fallen although it was told to stand.
    pub(super) fn repeats(&self, now: MissionTime) -> Option<usize> {
        let (held, since) = self.held?;
        let stood = now.since(since);
        let stands = stood >= FALLEN_AFTER && stood < NEXT_AFTER;
        let high = self.high();
        [0, 1].into_iter().find(|&wheel| stands && held[wheel] && high[wheel])
    }

    /// The contact, for the next tick alone.
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

/// The direction in which something touches the body, and half the angle in which that may be, radians.
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
