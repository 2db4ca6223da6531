//! Contacts, detected by held wheels.
//!
//! A wheel that does not turn as commanded is held, or its encoder is dead. A held motor draws
//! several times the current of a rolling one. The encoder is suspected instead if the current:
//! - exceeds the range of the AD converter
//! - stays high after a commanded stop: the frames repeat
//! - is high while the wheel rolls as commanded: `robot.held_current_ad` is wrong for this robot

use std::{f64::consts::PI, time::Duration};

use common::{clock::MissionTime, mission::Mission, samples::ContactSample};

use super::monitor::Condition;

/// Seconds of high current that show a held wheel.
pub(crate) const HELD_AFTER_S: f64 = 0.4;
/// Stand-still for mapping the contact and restarting the planner.
pub(crate) const STANDS_FOR: Duration = Duration::from_millis(500);
/// Least time between contacts, so that one is answered before the next, in lockstep too.
const NEXT_AFTER: Duration = Duration::from_secs(1);
/// Time for a standing wheel's current to fall.
const FALLEN_AFTER: Duration = Duration::from_millis(350);
/// Seconds of high current on a rolling wheel after which current is no evidence.
const HIGH_AND_ROLLS_S: f64 = 2.0;
const MOST_AD: u16 = 4095;
/// Half the touched arc with both wheels held, radians.
const HALF_WIDTH: f64 = PI / 4.0;
/// Touched arc with one wheel held: bearing to its side, and half the width, radians.
const AT_ONE_WHEEL: (f64, f64) = (PI / 4.0, PI / 6.0);
/// Least share of the rims' relative speed that is not a turn on the spot.
const LEAST_AHEAD_SHARE: f64 = 0.5;

#[derive(Clone, Debug, Default)]
pub(crate) struct Contacts {
    limit_ad: u16,
    /// Newest currents, AD counts.
    pub(super) currents: [u16; 2],
    pub(super) high_and_rolls_s: [f64; 2],
    held: Option<([bool; 2], MissionTime)>,
    pub new: Option<ContactSample>,
}

impl Contacts {
    pub(super) fn new(mission: &Mission) -> Self {
        Self { limit_ad: mission.robot.held_current_ad, ..Self::default() }
    }

    pub(super) fn high(&self) -> [bool; 2] {
        [0, 1].map(|wheel| {
            self.limit_ad > 0
                && (self.limit_ad..=MOST_AD).contains(&self.currents[wheel])
                && self.high_and_rolls_s[wheel] < HIGH_AND_ROLLS_S
        })
    }

    /// Registers held wheels with commanded speeds, counts/s. Returns whether the contact is new.
    pub(super) fn begin(&mut self, held: [bool; 2], asked: [f64; 2], now: MissionTime) -> bool {
        if self.held.is_some_and(|(_, since)| now.since(since) < NEXT_AFTER) {
            return false;
        }
        self.held = Some((held, now));
        assert_ne!(held, [false; 2]);
        let (bearing_rad, half_width_rad) = arc(held, asked);
        assert!(bearing_rad.abs() <= 2.0 * PI && (0.0..=PI).contains(&half_width_rad));
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

    pub(super) fn repeats(&self, now: MissionTime) -> Option<usize> {
        let (held, since) = self.held?;
        let stood = now.since(since);
        let stands = stood >= FALLEN_AFTER && stood < NEXT_AFTER;
        let high = self.high();
        [0, 1].into_iter().find(|&wheel| stands && held[wheel] && high[wheel])
    }

    pub(super) const fn reset(&mut self) {
        self.held = None;
        self.new = None;
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
        Some(format!(
            "{wheels} held, because the robot touches an obstacle or a wheel is blocked; free the robot"
        ))
    }
}

/// Returns bearing and half width of the touch, radians.
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
