//! Procedures as lists of legs: a bring-up, turns to and fro, squares, drives and turns for a gyro.
//!
//! In a bring-up the robot stands, turns to both sides, drives a short distance and back, and turns
//! to and fro. A leg ends after a time, or when the wheels have counted its distance in either
//! direction. A new robot's wheel may count backwards.

use std::f64::consts::{FRAC_PI_2, PI};

use common::{
    mission::{Body, Procedure},
    samples::GuidanceStatus,
};
use serde::{Deserialize, Serialize};

use crate::{
    loops::Wheels,
    wall::{FAST_RAD, Order, SPEED_M_S, direction_aside},
    ways::Ways,
};

/// Duration of a turn to one side, seconds. A base with 0.5 s delay and 1 rad/s^2 turns by then.
pub(crate) const LEG_S: f64 = 1.6;
const LEGS: u32 = 8;
/// Direction that makes the robot turn as fast as it may.
const ASIDE_RAD: f64 = 1.2;
const SLOWLY_M_S: f64 = 0.15;
const WAY_M: f64 = 0.3;
/// Range ahead that ends a leg, metres; longer for a robot that drives metres from its start.
const NEAR_M: f64 = 0.2;
const AHEAD_M: f64 = 0.5;
/// One and a half turns: the first third is seen twice.
const TURN_RAD: f64 = 3.0 * PI;
/// Time beyond what a slow base needs for [`TURN_RAD`].
const LONGEST_TURN_S: f64 = 20.0;
/// Remaining angle at which a square's corner counts as turned.
const TURNED_RAD: f64 = 0.03;

/// Order with its end in seconds, radians or metres by the counts; positive to the left.
#[derive(Clone, Copy, Debug)]
enum Leg {
    Stand(f64),
    Turn(f64),
    Drive,
    ToAndFro(f64),
    Side,
    Corner,
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

/// The link uses a gyro after it agreed with the wheels in a turn. The longest rest shows its bias,
/// the drives the wheel ratio, the turns the track.
const WITH_GYRO: [Leg; 13] = [
    STILL,
    Leg::Turn(FRAC_PI_2),
    STILL,
    Leg::Turn(-FRAC_PI_2),
    Leg::Stand(5.0),
    Leg::Drive,
    STILL,
    Leg::Turn(PI),
    STILL,
    Leg::Drive,
    STILL,
    Leg::Turn(-PI),
    STILL,
];

#[derive(Debug, Serialize, Deserialize)]
pub struct Script {
    procedure: Procedure,
    side_m: f64,
    rate_hz: f64,
    leg: u32,
    /// Ticks of this leg, and the distances at its beginning.
    ticks: u32,
    from: Ways,
    ways: Ways,
}

impl Script {
    /// Creates any procedure except the wall's. `side_m` is the side of squares, and the drive
    /// length for a gyro.
    pub fn new(procedure: Procedure, side_m: f64, rate_hz: f64) -> Self {
        let (from, ways) = (Ways::default(), Ways::default());
        Self { procedure, side_m, rate_hz, leg: 0, ticks: 0, from, ways }
    }

    fn leg(&self) -> Option<Leg> {
        let is_even = self.leg.is_multiple_of(2);
        let to_and_fro = |before: u32| {
            let side = if is_even { 1.0 } else { -1.0 };
            (self.leg < before + LEGS).then_some(Leg::ToAndFro(side))
        };
        match self.procedure {
            Procedure::Turns => to_and_fro(0),
            Procedure::Gyro => WITH_GYRO.get(self.leg as usize).copied(),
            Procedure::BringUp => {
                PARTS.get(self.leg as usize).copied().or_else(|| to_and_fro(PARTS.len() as u32))
            }
            _ => (self.leg < 8).then_some(if is_even { Leg::Side } else { Leg::Corner }),
        }
    }

    /// Advances by a tick.
    ///
    /// `echo_m` is the front sonar's, or a laser's for a gyro. A robot that drives on a turn
    /// command ends its leg before an obstacle.
    pub fn step(&mut self, counts: [u16; 2], echo_m: Option<f64>, body: &Body) -> Order {
        self.ways.step(counts, body);
        let (from, ways) = (self.from, self.ways);
        let rolled_m = (ways.rolled_m - from.rolled_m) / 2.0;
        let side = if self.procedure == Procedure::RightSquare { -1.0 } else { 1.0 };
        let heading = side * Wheels::default().turned(ways.left_m, ways.right_m, body.track_m);
        let left = |leg: u32| FRAC_PI_2 * f64::from(leg.div_ceil(2)) - heading;
        let seconds = f64::from(self.ticks) / self.rate_hz;
        let (way_m, way_m_s, ahead_m) = match self.procedure {
            Procedure::Gyro => (self.side_m, SPEED_M_S, AHEAD_M),
            _ => (WAY_M, SLOWLY_M_S, NEAR_M),
        };
        let nearer_than = |limit_m| echo_m.is_some_and(|it| it < limit_m);
        let is_over = match self.leg() {
            Some(Leg::Stand(least_s)) => seconds >= least_s,
            Some(Leg::Turn(angle)) => {
                let turned = rolled_m >= angle.abs() * body.track_m / 2.0;
                turned || seconds >= LONGEST_TURN_S || nearer_than(NEAR_M)
            }
            Some(Leg::Drive) => {
                rolled_m >= way_m || seconds >= 3.0 * way_m / way_m_s || nearer_than(ahead_m)
            }
            Some(Leg::ToAndFro(_)) => seconds >= LEG_S,
            Some(Leg::Side) => (ways.arc_m() - from.arc_m()).abs() >= self.side_m,
            Some(Leg::Corner) => left(self.leg) <= TURNED_RAD,
            None => false,
        };
        self.ticks = self.ticks.saturating_add(1);
        if is_over {
            (self.leg, self.ticks, self.from) = (self.leg + 1, 1, ways);
        }
        let left = left(self.leg);
        let (status, aside_rad, speed_limit_m_s) = match self.leg() {
            Some(Leg::Stand(_)) => (GuidanceStatus::Along, 0.0, 0.0),
            Some(Leg::Turn(side) | Leg::ToAndFro(side)) => {
                (GuidanceStatus::Look, ASIDE_RAD.copysign(side), 0.0)
            }
            Some(Leg::Drive) => (GuidanceStatus::Along, 0.0, way_m_s),
            Some(Leg::Side) => {
                (GuidanceStatus::Along, side * left.clamp(-FAST_RAD, FAST_RAD), SPEED_M_S)
            }
            Some(Leg::Corner) => {
                (GuidanceStatus::Look, side * direction_aside(left, FAST_RAD), 0.0)
            }
            None => (GuidanceStatus::AtTarget, 0.0, 0.0),
        };
        Order { status, aside_rad, speed_limit_m_s, x_m: 0.0, heading_rad: 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wall::tests::body;

    #[test]
    fn the_procedure_ends_in_time_whether_the_wheels_count_or_not() {
        let body = body();
        for counts_a_tick in [0, 40] {
            let mut procedure = Script::new(Procedure::BringUp, 0.0, 10.0);
            let (mut ticks, mut counts) = (0, [0_u16; 2]);
            while procedure.leg().is_some() {
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
