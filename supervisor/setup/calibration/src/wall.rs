//! Procedure before a wall: sweep, turn, drive away, turn, come back, sweep again. Pure.
//!
//! Headings are relative to the last normal, by the current estimate of the wheels. The first two
//! loops have a single turn, because the track is unknown. Later ones have as many turns as still
//! let the robot find the wall.

use std::f64::consts::{FRAC_PI_4, PI, TAU};

use common::{
    mission::{Body, CalibrationPlan},
    samples::{GuidanceStatus, RangeReading, RangeStatus},
};
use serde::{Deserialize, Serialize};

use crate::{
    loops::{Estimate, FEWEST_LOOPS, Loop, Wheels, normal_sd},
    normal::{Leg, NoNormal, normal},
    ways::Ways,
};

/// Range at which a drive to the wall ends, and range at which it slows down.
const STOP_M: f64 = 0.42;
const NEAR_M: f64 = 0.7;
/// Least free distance ahead for a drive away from the wall.
const AHEAD_M: f64 = 0.5;
/// Longest first drive to the wall, and the readings without an echo that end it earlier.
const APPROACH_M: f64 = 2.0;
const SILENT: u32 = 7;
/// Near echoes in a row; one may be false.
const NEAR: u32 = 2;
/// Minimum useful drive away from the wall.
const SHORTEST_M: f64 = 0.5;
/// Excess of a drive back that has missed the wall's echo.
const BEYOND_M: f64 = 0.15;
/// Half a sweep. If the robot mistook its turn, the next is wider by a third, up to the maximum
/// share.
const SWEEP_RAD: f64 = FRAC_PI_4;
const WIDER: f64 = 1.0 / 3.0;
const MOST_WIDER: u32 = 2;
const SWEEPS: u32 = 5;
/// Whole turns of a loop before the half one; the heading must be known to [`HEADING_SD_RAD`].
const TURNS: [f64; 2] = [3.0, 1.0];
const HEADING_SD_RAD: f64 = 0.13;
/// Minimum and maximum angle of the ordered direction ahead of the robot, in a sweep and in another
/// turn. The controller's turn rate is proportional to the remaining angle, at least 0.25 rad/s.
const SLOW_RAD: f64 = 0.08;
pub(crate) const FAST_RAD: f64 = 0.5;
const TURNED_RAD: f64 = 0.04;
pub(crate) const SPEED_M_S: f64 = 0.35;
const NEAR_M_S: f64 = 0.12;
/// Sufficient deviation of the track, relative to that of the ratio.
const TRACK_OVER_RATIO: f64 = 3.0;

#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Wall {
    plan: CalibrationPlan,
    ways: Ways,
    wheels: Wheels,
    visit: Ways,
    /// Whether a normal was measured; the start stands in for the first one.
    is_measured: bool,
    facing: f64,
    phase: Phase,
    phase_from_m: f64,
    /// Midpoint distance at the start of the drive away, its length, and the previous sweep's
    /// range.
    away_from_m: f64,
    away_m: f64,
    swept_m: f64,
    /// Consecutive readings at this phase's limit, and without an echo.
    near: u32,
    silent: u32,
    sweeps: u32,
    wider: u32,
    legs: [Leg; 2],
    /// Differences between both directions of each sweep, radians.
    differences: Vec<f64>,
    pub loops: Vec<Loop>,
    visits: u32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
enum Phase {
    #[default]
    Approach,
    Aside,
    Sweep(usize),
    Turn(f64),
    Away(f64),
    Back,
    Finished,
    Failed(Fault),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
pub enum Fault {
    #[error(
        "no flat wall was found ahead; place the robot 0.5 to 2 m in front of one, facing it, with 1 m of free wall on either side"
    )]
    NoWall,
    #[error(
        "an obstacle is less than half a metre behind the robot; clear the floor before the wall"
    )]
    NoRoom,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Order {
    pub status: GuidanceStatus,
    /// Angle from the robot's axis to the direction, counter-clockwise.
    pub aside_rad: f64,
    pub speed_limit_m_s: f64,
    /// Place and heading. At the origin the robot faces the wall, along the x-axis.
    pub x_m: f64,
    pub heading_rad: f64,
}

pub(crate) fn echo_m(reading: &RangeReading) -> Option<f64> {
    match reading.status() {
        RangeStatus::Measured => Some(reading.range_m),
        RangeStatus::AtContact => Some(0.0),
        RangeStatus::Nothing | RangeStatus::Absent | RangeStatus::Invalid => None,
    }
}

/// Returns the ordered direction of a robot with `left` to turn on the spot, radians.
pub(crate) fn direction_aside(left: f64, most: f64) -> f64 {
    const { assert!(TURNED_RAD < SLOW_RAD && SLOW_RAD < FAST_RAD) };
    left.abs().clamp(SLOW_RAD, most) * left.signum()
}

impl Wall {
    pub fn new(plan: CalibrationPlan) -> Self {
        Self { plan, swept_m: STOP_M, ..Self::default() }
    }

    pub fn normal_sd(&self) -> f64 {
        normal_sd(&self.differences)
    }

    pub fn metres(&self) -> f64 {
        self.ways.rolled_m / 2.0
    }

    pub const fn ended(&self) -> Option<Result<(), Fault>> {
        match self.phase {
            Phase::Finished => Some(Ok(())),
            Phase::Failed(fault) => Some(Err(fault)),
            _ => None,
        }
    }

    pub fn step(&mut self, counts: [u16; 2], echo_m: Option<f64>, body: &Body) -> Order {
        self.ways.step(counts, body);
        self.advance(self.heading(body), echo_m, body);
        self.order(self.heading(body), echo_m)
    }

    fn heading(&self, body: &Body) -> f64 {
        let left = self.ways.left_m - self.visit.left_m;
        let right = self.ways.right_m - self.visit.right_m;
        self.wheels.turned(left, right, body.track_m)
    }

    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        self.phase_from_m = self.ways.arc_m();
        (self.near, self.silent) = (0, 0);
    }

    fn advance(&mut self, heading: f64, echo_m: Option<f64>, body: &Body) {
        const { assert!(STOP_M < AHEAD_M && AHEAD_M < NEAR_M && NEAR_M_S < SPEED_M_S) };
        let driven = (self.ways.arc_m() - self.phase_from_m).abs();
        let limit = if matches!(self.phase, Phase::Away(_)) { AHEAD_M } else { STOP_M };
        self.near = if echo_m.is_some_and(|echo| echo <= limit) { self.near + 1 } else { 0 };
        self.silent = if echo_m.is_none() { self.silent + 1 } else { 0 };
        let is_near = self.near >= NEAR;
        match self.phase {
            Phase::Approach => {
                let (longest, is_lost) = if self.visits == 0 {
                    (APPROACH_M, self.silent >= SILENT)
                } else {
                    (self.away_m + self.swept_m - STOP_M + BEYOND_M, false)
                };
                if is_near || is_lost || driven >= longest {
                    (self.sweeps, self.wider) = (0, 0);
                    self.enter(Phase::Aside);
                }
            }
            Phase::Aside => {
                if heading <= self.facing - self.half_rad() {
                    self.legs = Default::default();
                    self.enter(Phase::Sweep(0));
                }
            }
            Phase::Sweep(leg) => {
                let nominal = (self.ways.right_m - self.ways.left_m) / body.track_m;
                self.legs[leg.min(1)].push(nominal, echo_m);
                if leg == 0 && heading >= self.facing + self.half_rad() {
                    self.enter(Phase::Sweep(1));
                } else if leg == 1 && heading <= self.facing - self.half_rad() {
                    self.end_sweep(nominal, body);
                }
            }
            Phase::Turn(target) => {
                if (target - heading) * target.signum() <= TURNED_RAD {
                    self.away_from_m = self.ways.arc_m();
                    self.enter(Phase::Away(target));
                }
            }
            Phase::Away(target) => {
                if driven >= self.plan.drive_m || is_near {
                    self.away_m = driven;
                    self.facing = target + PI * target.signum();
                    let fault = driven < SHORTEST_M;
                    self.enter(if fault { Phase::Failed(Fault::NoRoom) } else { Phase::Back });
                }
            }
            Phase::Back => {
                if (self.facing - heading) * self.facing.signum() <= TURNED_RAD {
                    self.away_m = (self.ways.arc_m() - self.away_from_m).abs();
                    self.enter(Phase::Approach);
                }
            }
            Phase::Finished | Phase::Failed(_) => {}
        }
    }

    /// A wall found completes the loop.
    fn end_sweep(&mut self, nominal: f64, body: &Body) {
        self.sweeps += 1;
        let normal = match normal(&self.legs) {
            Ok(normal) => normal,
            Err(problem) => {
                if problem == NoNormal::Narrow {
                    self.wider = (self.wider + 1).min(MOST_WIDER);
                }
                let again = self.sweeps < SWEEPS;
                self.enter(if again { Phase::Aside } else { Phase::Failed(Fault::NoWall) });
                return;
            }
        };
        // Wheel distances of an ideal turn on the spot from here to the normal.
        let aside_m = (normal.heading - nominal) * body.track_m / 2.0;
        let mut faced = self.ways;
        faced.left_m -= aside_m;
        faced.right_m += aside_m;
        self.differences.push(normal.difference);
        self.swept_m = normal.range_m;
        if self.is_measured {
            self.loops.push(Loop {
                number: self.visits,
                turns: (self.facing / TAU).round(),
                left_m: faced.left_m - self.visit.left_m,
                right_m: faced.right_m - self.visit.right_m,
                rolled_m: faced.rolled_m - self.visit.rolled_m,
            });
        }
        self.visits += 1;
        (self.visit, self.is_measured, self.facing) = (faced, true, 0.0);
        let estimate = Estimate::by_loops(&self.loops, self.normal_sd(), body.track_m).ok();
        self.wheels = estimate.as_ref().map_or(self.wheels, Estimate::wheels);
        if self.is_enough(estimate.as_ref()) {
            self.enter(Phase::Finished);
            return;
        }
        let done = self.loops.len();
        let side = if done.is_multiple_of(2) { 1.0 } else { -1.0 };
        self.enter(Phase::Turn(side * (TAU * self.turns(estimate.as_ref(), body) + PI)));
    }

    fn half_rad(&self) -> f64 {
        SWEEP_RAD * (1.0 + WIDER * f64::from(self.wider))
    }

    /// Returns the turns of the next loop; none until both sides were tried once.
    fn turns(&self, estimate: Option<&Estimate>, body: &Body) -> f64 {
        let Some(estimate) = estimate.filter(|_| self.loops.len() >= 2) else {
            return 0.0;
        };
        let is_known = |turns: &f64| {
            let turned = TAU * (turns + 1.0);
            let rolled_m = 4.0 * self.plan.drive_m + turned * body.track_m;
            let by_slip = estimate.slip * rolled_m.sqrt() / body.track_m;
            (turned * estimate.track_sd()).hypot(by_slip) <= HEADING_SD_RAD
        };
        TURNS.into_iter().find(is_known).unwrap_or(0.0)
    }

    fn is_enough(&self, estimate: Option<&Estimate>) -> bool {
        let done = self.loops.len();
        if done < FEWEST_LOOPS {
            return false;
        }
        let asked = self.plan.ratio_sd;
        done >= usize::try_from(self.plan.loops).unwrap_or(usize::MAX)
            || estimate.is_some_and(|estimate| {
                estimate.ratio_sd() <= asked && estimate.track_sd() <= TRACK_OVER_RATIO * asked
            })
    }

    fn order(&self, heading: f64, echo_m: Option<f64>) -> Order {
        let turn = |target: f64, most: f64| {
            (GuidanceStatus::Look, direction_aside(target - heading, most), 0.0)
        };
        let along = |target: f64, limit: f64| {
            let aside = (target - heading).clamp(-PI / 6.0, PI / 6.0);
            (GuidanceStatus::Along, aside, limit)
        };
        let is_near = echo_m.is_some_and(|echo| echo <= NEAR_M);
        let speed = if is_near { NEAR_M_S } else { SPEED_M_S };
        // The ordered direction lies beyond a leg's end, so the robot still turns there.
        let beyond = self.half_rad() + SLOW_RAD;
        let (status, aside_rad, speed_limit_m_s) = match self.phase {
            Phase::Approach => along(self.facing, speed),
            Phase::Aside => turn(self.facing - beyond, FAST_RAD),
            Phase::Sweep(0) => turn(self.facing + beyond, SLOW_RAD),
            Phase::Sweep(_) => turn(self.facing - beyond, SLOW_RAD),
            Phase::Turn(target) => turn(target, FAST_RAD),
            Phase::Away(target) => along(target, SPEED_M_S),
            Phase::Back => turn(self.facing, FAST_RAD),
            // The run is over in both phases.
            Phase::Finished | Phase::Failed(_) => (GuidanceStatus::AtTarget, 0.0, 0.0),
        };
        let driven = (self.ways.arc_m() - self.phase_from_m).abs();
        let x_m = match self.phase {
            Phase::Away(_) => -driven,
            Phase::Back => -self.away_m,
            Phase::Approach if self.visits > 0 => (driven - self.away_m).min(0.0),
            _ => 0.0,
        };
        Order { status, aside_rad, speed_limit_m_s, x_m, heading_rad: heading }
    }
}

#[cfg(test)]
pub(crate) mod tests;
