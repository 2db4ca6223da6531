//! Bumpers and cliff sensors: the robot stops at a touch, and goes no nearer while it lasts.
//!
//! The contact is reported at rest. The wheels may slip before, which would place it under the
//! body.

use std::{f64::consts::PI, ops::RangeInclusive, time::Duration};

use common::{
    clock::MissionTime,
    mission::{Mission, TouchRow},
    samples::{Cause, CommandSample, ContactSample},
};

use super::{
    contact::STANDS_FOR,
    monitor::{Condition, Moment, Monitor, Observation},
};

/// Half the mapped arc, radians: small enough to drive around, and at least a map cell.
const HALF_WIDTH: RangeInclusive<f64> = PI / 12.0..=PI / 6.0;

#[derive(Clone, Debug)]
pub struct Touches {
    /// With whether each is triggered.
    rows: Vec<(TouchRow, bool)>,
    stands_for: Duration,
    /// Whether the robot moves. At rest, or carried, its own motion causes no touch.
    moves: bool,
    /// Last triggered row, and when.
    newest: Option<(usize, MissionTime)>,
    is_told: bool,
}

impl Touches {
    fn take(&mut self, touched: &[(usize, bool)], now: MissionTime) {
        for &(row, feels) in touched {
            let Some((_, felt)) = self.rows.get_mut(row) else {
                continue;
            };
            let before = std::mem::replace(felt, feels);
            if feels && !before && self.moves && !self.stands(now) {
                self.newest = Some((row, now));
                self.is_told = false;
            }
        }
    }

    fn stands(&self, now: MissionTime) -> bool {
        self.newest.is_some_and(|(_, since)| now.since(since) < self.stands_for)
    }

    /// Takes the contact once the robot rests.
    pub(crate) fn take_contact(&mut self, now: MissionTime) -> Option<ContactSample> {
        let (row, _) = self.newest.filter(|_| !self.is_told && !self.stands(now))?;
        self.is_told = true;
        let (TouchRow { bearing_deg, wide_deg, .. }, _) = self.rows[row];
        let half_width = wide_deg.to_radians() / 2.0;
        Some(ContactSample {
            bearing_rad: bearing_deg.to_radians(),
            half_width_rad: half_width.clamp(*HALF_WIDTH.start(), *HALF_WIDTH.end()),
            ..ContactSample::default()
        })
    }

    /// Returns the permitted command: a turn on the spot if it leads nearer to a touch. In lockstep
    /// the robot also stops by it. Cars have no touch sensors.
    pub(crate) fn permitted(&self, command: &CommandSample, now: MissionTime) -> CommandSample {
        let CommandSample { left_rad_s: left, right_rad_s: right, .. } = *command;
        let felt = self.rows.iter().filter(|(_, feels)| *feels);
        let mut towards = felt.map(|(row, _)| (left + right) * row.bearing_deg.to_radians().cos());
        let turn = if self.stands(now) {
            0.0
        } else if towards.any(|towards| towards > 1e-6) {
            (right - left) / 2.0
        } else {
            return *command;
        };
        CommandSample { left_rad_s: -turn, right_rad_s: turn, ..*command }
    }
}

impl Monitor for Touches {
    fn new(mission: &Mission) -> Self {
        let body = mission.body();
        let brakes_s = body.top_speed_m_s / body.response.acceleration_m_s2;
        let rests_after = Duration::from_secs_f64(body.response.dead_time_s() + brakes_s);
        Self {
            rows: mission.touches().into_iter().map(|row| (row, false)).collect(),
            // The response may need more from top speed.
            stands_for: STANDS_FOR.max(rests_after),
            moves: false,
            newest: None,
            is_told: false,
        }
    }

    fn observe(&mut self, what: &Observation<'_>, now: Moment) {
        match *what {
            Observation::Commanded(counts) => self.moves = counts != [0, 0],
            Observation::Touched(touched) => self.take(touched, now.time),
            _ => {}
        }
    }

    fn condition(&self, _: Cause, now: Moment) -> Condition {
        self.stands(now.time).into()
    }

    fn explain(&self, _: Cause, _: Moment) -> Option<String> {
        let (row, _) = self.newest?;
        let name = &self.rows[row].0.name;
        Some(format!(
            "{name} detects a contact or a cliff; the robot stands, and then drives around it"
        ))
    }
}

#[cfg(test)]
mod tests {

    use super::*;
    use crate::testing::*;

    fn speeds(touches: &Touches, [left, right]: [f64; 2], s: f64) -> [f64; 2] {
        let permitted = touches.permitted(&turning(left, right), at(s));
        [permitted.left_rad_s, permitted.right_rad_s]
    }

    #[test]
    fn a_robot_stands_at_a_touch_then_turns_and_backs_but_goes_no_nearer_until_it_is_over() {
        let mut touches = Touches::new(&mission("robot.model = 'kobuki'"));
        touches.moves = true;
        assert_eq!(speeds(&touches, [2.0, 4.0], 0.0), [2.0, 4.0]);
        touches.take(&[(0, true), (1, false)], at(1.0));
        assert_eq!(speeds(&touches, [-2.0, -2.0], 1.1).map(f64::abs), [0.0; 2]);
        assert!(touches.take_contact(at(1.4)).is_none(), "it still slips");
        let contact = touches.take_contact(at(3.0)).unwrap();
        assert_eq!((contact.bearing_rad, contact.left, contact.right), (PI / 3.0, 0, 0));
        near(contact.half_width_rad, PI / 6.0, 1e-9);
        assert!(touches.take_contact(at(3.1)).is_none());
        assert_eq!(speeds(&touches, [2.0, 4.0], 3.1), [-1.0, 1.0]);
        assert_eq!(speeds(&touches, [-2.0, -2.0], 3.1), [-2.0; 2]);
        touches.take(&[(0, true)], at(3.2));
        assert!(touches.take_contact(at(9.0)).is_none());
        touches.take(&[(0, false), (9, true)], at(9.1));
        touches.moves = false;
        touches.take(&[(3, true), (3, false)], at(9.1));
        assert_eq!(speeds(&touches, [2.0, 4.0], 9.1), [2.0, 4.0]);
    }
}
