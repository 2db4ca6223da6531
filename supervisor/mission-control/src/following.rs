//! Followed beacon, and the robot's place beside it. Pure.
//!
//! The sensors see the followed body as a hazard, so the robot goes to a free place beside it.
//! Candidates lie within the distance to keep and see the beacon. The one with the shortest path
//! wins. The field leads there as to any target.

use std::{cmp::Reverse, collections::BinaryHeap, time::Duration};

use common::{
    clock::MissionTime,
    grid::{Cell, CellState, GridFrame, Replica},
    mission::Mission,
    samples::{BeaconRefusal, BeaconSample, FollowState, FollowingSample, PoseSample},
};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::target_list::Followed;

/// Silence of the beacon after which the robot stands.
///
/// A person walks 1 m meanwhile, the distance to keep. A source at 10 Hz may lose several samples
/// in a row.
pub(crate) const SILENT: Duration = Duration::from_secs(1);
/// Greatest deviation of a used sample, metres. Two deviations make up [`ROOM_M`].
const MOST_DEVIATION_M: f64 = 0.25;
/// A person or an X80.
const BODY_M: f64 = 0.3;
/// Default gap between the bodies, metres.
const ROOM_M: f64 = 0.5;
/// Spread of echoes around the followed body, metres.
const SPREAD_M: f64 = 0.15;
const MOST_DISTANCE_M: f64 = 10.0;

fn least_m(mission: &Mission) -> f64 {
    BODY_M + mission.body().radius_m
}

/// Returns the distance to keep for a request of `distance_m` (0: default); `None` if out of range.
pub(crate) fn kept_m(distance_m: f64, mission: &Mission) -> Option<f64> {
    let least_m = least_m(mission);
    let wanted_m = if distance_m == 0.0 { least_m + ROOM_M } else { distance_m };
    (least_m..=MOST_DISTANCE_M).contains(&wanted_m).then_some(wanted_m)
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Following {
    distance_m: f64,
    began: MissionTime,
    /// Odometer reading at the beginning, metres.
    began_m: f64,
    /// Time and place of the newest used sample.
    heard: Option<(MissionTime, DVec2)>,
    pub is_lost: bool,
    used: u64,
    refused: u64,
    refusal: u8,
    lost: u64,
}

impl Following {
    pub(crate) fn new(distance_m: f64, now: MissionTime, pose: Option<&PoseSample>) -> Self {
        Self {
            distance_m,
            began: now,
            began_m: pose.map_or(0.0, |pose| pose.travelled_m),
            is_lost: true,
            ..Self::default()
        }
    }

    pub(crate) const fn is_new(&self) -> bool {
        self.used + self.refused == 0
    }

    pub(crate) fn place(&self) -> DVec2 {
        self.heard.map_or(DVec2::ZERO, |(_, place)| place)
    }

    pub(crate) fn take(
        &mut self,
        beacon: &BeaconSample,
        now: MissionTime,
        mission: &Mission,
    ) -> Result<(), BeaconRefusal> {
        let taken = self.heard_by(beacon, now, mission);
        match taken {
            Ok(heard) => {
                assert!(self.heard.is_none_or(|(before, _)| before <= heard.0));
                (self.heard, self.is_lost) = (Some(heard), false);
                assert!(heard.1.is_finite());
                self.used += 1;
            }
            Err(refusal) => {
                self.refusal = refusal.into();
                self.refused += 1;
            }
        }
        taken.map(|_| ())
    }

    fn heard_by(
        &self,
        beacon: &BeaconSample,
        now: MissionTime,
        mission: &Mission,
    ) -> Result<(MissionTime, DVec2), BeaconRefusal> {
        let BeaconSample { capture_ns, x_m, y_m, deviation_m, .. } = *beacon;
        let (captured, place) = (MissionTime(capture_ns), DVec2::new(x_m, y_m));
        let tick_ns = (1e9 / mission.robot.rate_hz) as u64;
        // Samples come from outside and may hold any value.
        if !(place.is_finite() && deviation_m.is_finite() && deviation_m >= 0.0) {
            Err(BeaconRefusal::NotFinite)
        } else if capture_ns > now.0.saturating_add(tick_ns) {
            Err(BeaconRefusal::Future)
        } else if now.since(captured) > SILENT || self.heard.is_some_and(|(at, _)| captured < at) {
            Err(BeaconRefusal::Late)
        } else if deviation_m > MOST_DEVIATION_M {
            Err(BeaconRefusal::Doubtful)
        } else if !mission.contains(place) {
            Err(BeaconRefusal::Outside)
        } else {
            Ok((captured, place))
        }
    }

    pub(crate) fn loses(&mut self, now: MissionTime) -> bool {
        let silent = self.heard.is_none_or(|(at, _)| now.since(at) > SILENT);
        let loses = silent && !self.is_lost;
        self.is_lost |= silent;
        self.lost += u64::from(loses);
        loses
    }

    pub(crate) fn followed(&self, now: MissionTime, pose: Option<&PoseSample>) -> Followed {
        let travelled_m = pose.map_or(self.began_m, |pose| pose.travelled_m);
        Followed {
            way_m: travelled_m - self.began_m,
            time_s: now.since(self.began).as_secs_f64(),
            lost: self.lost,
        }
    }

    pub(crate) fn sample(&self, now: MissionTime, pose: Option<&PoseSample>) -> FollowingSample {
        let Followed { way_m, time_s, lost } = self.followed(now, pose);
        let place = self.place();
        FollowingSample {
            state: if self.is_lost { FollowState::Lost } else { FollowState::Heard }.into(),
            refusal: self.refusal,
            distance_m: self.distance_m,
            x_m: place.x,
            y_m: place.y,
            heard_ns: self.heard.map_or(u64::MAX, |(at, _)| at.0),
            used: self.used,
            refused: self.refused,
            lost,
            followed_m: way_m,
            followed_s: time_s,
            ..FollowingSample::default()
        }
    }

    /// Returns the place to send the robot to; `None` if it goes on to `current`.
    ///
    /// `rest` is where the robot would come to rest, `arrived` whether it is at `current`.
    pub(crate) fn next_place(
        &self,
        grid: &Replica<u8>,
        mission: &Mission,
        (rest, current): (DVec2, Option<DVec2>),
        arrived: bool,
    ) -> Option<DVec2> {
        let (_, beacon) = self.heard?;
        let least_m = least_m(mission);
        let around = Around { frame: grid.frame()?, grid, beacon, least_m };
        let most_m = self.distance_m + around.frame.resolution_m / 2.0;
        let is_near = |at: DVec2| at.distance(beacon) <= most_m && around.sees(at);
        let stays =
            |at: DVec2| at.distance(beacon) >= least_m && !grid.is_hazard(at) && is_near(at);
        let goes_on = if is_near(rest) { arrived } else { current.is_some_and(stays) };
        if goes_on {
            return None;
        }
        let next = around.nearest(rest, self.distance_m)?;
        let moves = |current: DVec2| current.distance(next) >= around.frame.resolution_m / 2.0;
        current.is_none_or(moves).then_some(next)
    }
}

struct Around<'a> {
    frame: GridFrame,
    grid: &'a Replica<u8>,
    beacon: DVec2,
    least_m: f64,
}

impl Around<'_> {
    fn is_free_cell(&self, cell: Cell) -> bool {
        !CellState::from_byte(self.grid.cells()[self.frame.index(cell)]).is_hazard()
    }

    /// Returns whether the followed body is in line of sight from `at`.
    fn sees(&self, at: DVec2) -> bool {
        let way_m = at.distance(self.beacon) - self.least_m - SPREAD_M;
        let steps = (way_m / self.frame.resolution_m).ceil().max(0.0) as u32;
        let towards = (self.beacon - at).normalize_or_zero();
        (1..=steps).all(|step| {
            let along_m = (f64::from(step) * self.frame.resolution_m).min(way_m);
            !self.grid.is_hazard(at + towards * along_m)
        })
    }

    /// Returns the place within `distance_m` that sees the beacon, with the shortest path from
    /// `from`. Without one, returns the reachable place nearest to the beacon.
    fn nearest(&self, from: DVec2, distance_m: f64) -> Option<DVec2> {
        let start = self.start(from)?;
        let side = self.frame.cells as usize;
        assert_eq!(self.grid.cells().len(), self.frame.area());
        let mut costs = vec![u32::MAX; self.frame.area()];
        // A* heuristic: a lower bound to the circle around the beacon.
        let least_cost = |at: DVec2| {
            let way_m = (at.distance(self.beacon) - distance_m).max(0.0);
            (way_m / self.frame.resolution_m * 9.8) as u32
        };
        let mut next = BinaryHeap::from([Reverse((0, 0, self.frame.index(start)))]);
        costs[self.frame.index(start)] = 0;
        let mut best: Option<(f64, DVec2)> = None;
        while let Some(Reverse((_, cost, index))) = next.pop() {
            if cost > costs[index] {
                continue;
            }
            assert_eq!(cost, costs[index], "a cheaper way replaces the entry");
            let cell = Cell { col: (index % side) as u32, row: (index / side) as u32 };
            debug_assert!(self.is_free_cell(cell));
            let at = self.frame.centre_of(cell);
            let off_m = at.distance(self.beacon);
            if off_m <= distance_m && self.sees(at) {
                return Some(at);
            }
            if best.is_none_or(|(least_m, _)| off_m < least_m) {
                best = Some((off_m, at));
            }
            let beside = |at: u32| at.saturating_sub(1)..=(at + 1).min(self.frame.cells - 1);
            for row in beside(cell.row) {
                for col in beside(cell.col) {
                    let near = Cell { col, row };
                    // In tenths of a cell. The way to the cell itself never becomes shorter.
                    let way = cost + if col == cell.col || row == cell.row { 10 } else { 14 };
                    let index = self.frame.index(near);
                    if self.is_free_cell(near) && way < costs[index] {
                        costs[index] = way;
                        let whole = way + least_cost(self.frame.centre_of(near));
                        next.push(Reverse((whole, way, index)));
                    }
                }
            }
        }
        best.map(|(_, at)| at)
    }

    /// Returns the nearest free cell; the robot may stand in a hazard's margin.
    fn start(&self, from: DVec2) -> Option<Cell> {
        self.frame.cell_at(from).filter(|cell| self.is_free_cell(*cell)).or_else(|| {
            let free = self.frame.whole().cells().filter(|cell| self.is_free_cell(*cell));
            let off = |cell: &Cell| self.frame.centre_of(*cell).distance_squared(from);
            free.min_by(|one, other| off(one).total_cmp(&off(other)))
        })
    }
}

#[cfg(test)]
mod tests;
