//! The procedure of a bring-up: the robot stands, turns on the spot to both sides, drives a short way and back, and turns to and fro.
//!
//! A leg ends when the wheels have counted its way in either direction, because a wheel of a new robot may count backwards, or after a
//! time.

use std::f64::consts::PI;

use common::{mission::Body, samples::GuidanceStatus, wire::counts_between};
use serde::{Deserialize, Serialize};

use crate::{
    response::{ASIDE_RAD, LEG_S, LEGS},
    wall::{Order, State},
};

/// The speed of the way there and back, m/s.
const SPEED_M_S: f64 = 0.15;
const WAY_M: f64 = 0.3;
/// Nearer things ahead end a leg, metres.
const NEAR_M: f64 = 0.2;
/// One and a half turns: what was seen in the first third is seen again.
const TURN_RAD: f64 = 3.0 * PI;
/// Longer than a slow base needs for [`TURN_RAD`] at its speed.
const LONGEST_TURN_S: f64 = 20.0;

/// What the robot is told, and after how much it is told the next: seconds, radians or metres by the counts, to the left if positive.
#[derive(Clone, Copy, Debug)]
enum Leg {
    Stand(f64),
    Turn(f64),
    Drive,
    ToAndFro(f64),
}

const STILL: Leg = Leg::Stand(1.0);
const PARTS: [Leg; 12] = [
    Leg::Stand(2.5),
    Leg::Turn(TURN_RAD),
    STILL,
    Leg::Turn(-TURN_RAD),
    STILL,
    Leg::Drive,
    STILL,
    Leg::Turn(PI),
    STILL,
    Leg::Drive,
    STILL,
    Leg::Turn(-PI),
];

/// The procedure in the planner's place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BringUp {
    leg: u32,
    ticks: u32,
    rate_hz: f64,
    counts: Option<[u16; 2]>,
    /// Counts of both wheels in this leg, on average, in any direction.
    counted: f64,
}

impl BringUp {
    #[must_use]
    pub const fn new(rate_hz: f64) -> Self {
        Self { leg: 0, ticks: 0, rate_hz, counts: None, counted: 0.0 }
    }

    fn leg(&self) -> Option<Leg> {
        let leg = self.leg as usize;
        let to_and_fro = leg.checked_sub(PARTS.len()).filter(|it| *it < LEGS as usize);
        let side = |number: usize| if number.is_multiple_of(2) { 1.0 } else { -1.0 };
        PARTS.get(leg).copied().or_else(|| to_and_fro.map(|it| Leg::ToAndFro(side(it))))
    }

    #[must_use]
    pub fn state(&self) -> State {
        if self.leg().is_none() { State::Finished } else { State::Running }
    }

    /// `echo_m` is the front sonar's: a robot that drives where it is told to turn ends its leg before what is there.
    pub fn step(&mut self, counts: [u16; 2], echo_m: Option<f64>, body: &Body) -> Order {
        let before = self.counts.replace(counts).unwrap_or(counts);
        let went =
            [0, 1].map(|wheel| f64::from(counts_between(before[wheel], counts[wheel])).abs());
        self.counted += (went[0] + went[1]) / 2.0;
        self.ticks = self.ticks.saturating_add(1);
        let seconds = f64::from(self.ticks) / self.rate_hz;
        let way_m = self.counted * body.metres_per_count();
        let is_over = match self.leg() {
            Some(Leg::Stand(least_s)) => seconds >= least_s,
            Some(Leg::Turn(angle)) => {
                way_m >= angle.abs() * body.track_m / 2.0 || seconds >= LONGEST_TURN_S
            }
            Some(Leg::Drive) => way_m >= WAY_M || seconds >= 3.0 * WAY_M / SPEED_M_S,
            Some(Leg::ToAndFro(_)) => seconds >= LEG_S,
            None => false,
        };
        let is_near = echo_m.is_some_and(|it| it < NEAR_M);
        if is_over || is_near && matches!(self.leg(), Some(Leg::Turn(_) | Leg::Drive)) {
            (self.leg, self.ticks, self.counted) = (self.leg + 1, 0, 0.0);
        }
        let (status, aside_rad, speed_limit_m_s) = match self.leg() {
            // A robot that faces its way and may go at no speed stands.
            Some(Leg::Stand(_)) => (GuidanceStatus::Along, 0.0, 0.0),
            Some(Leg::Turn(side) | Leg::ToAndFro(side)) => {
                (GuidanceStatus::Look, ASIDE_RAD.copysign(side), 0.0)
            }
            Some(Leg::Drive) => (GuidanceStatus::Along, 0.0, SPEED_M_S),
            None => (GuidanceStatus::AtTarget, 0.0, 0.0),
        };
        Order { status, aside_rad, speed_limit_m_s, x_m: 0.0, heading_rad: 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use common::mission::Mission;

    use super::*;

    #[test]
    fn the_procedure_ends_in_time_whether_the_wheels_count_or_not() {
        let mission = Mission::parse("target = [3, 0]", Path::new("m.toml")).unwrap();
        let body = mission.body();
        for counts_a_tick in [0, 40] {
            let mut procedure = BringUp::new(10.0);
            let (mut ticks, mut counts) = (0, [0_u16; 2]);
            while procedure.state() == State::Running {
                let order = procedure.step(counts, None, &body);
                if order.status == GuidanceStatus::Look || order.speed_limit_m_s > 0.0 {
                    counts = counts.map(|it| it.wrapping_add(counts_a_tick) % 32768);
                }
                ticks += 1;
            }
            assert!(ticks < 1200, "{counts_a_tick}: {ticks} ticks");
            assert_eq!(procedure.step(counts, None, &body).status, GuidanceStatus::AtTarget);
        }
    }
}
