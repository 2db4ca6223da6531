//! Decision whether the robot stalls, and the next recovery step. Pure.
//!
//! The paper's rule: if a robot should move and does not, the planner is at fault. Recovery steps,
//! in order: replan from the same map; reset the sensed map and replan; give up.
//!
//! | cause | sign | first step |
//! |---|---|---|
//! | still | neither drives nor turns | replan |
//! | pinned | drives or turns, and stays at its place | replan |
//! | inside hazard | stands in a hazard, and has driven far without leaving it | reset |
//! | held | something holds the wheels: motors push, encoders stand | replan |
//! | wandering | has driven several times the distance to its target; with a laser, over known ground | reset |
//! | relocated | fixes or an operator put it elsewhere, so the map is of another place; no limit | reset |
//! | cut off | no way leads to the target, and it has looked around | reset |

use std::{collections::HashSet, f64::consts::TAU, time::Duration};

use common::{
    clock::MissionTime,
    mission::{Body, Method, Mission, SensorKind},
    samples::{GuidanceSample, GuidanceStatus, PoseSample, RecoveryStep, StallCause, StallSample},
};
use glam::{DVec2, IVec2};

/// Motionless mission time of a stall. The slowest turn on the spot starts sooner.
const STALLED_AFTER: Duration = Duration::from_secs(3);
/// Mission time of a stall without a path to the target. A false echo vanishes sooner.
const CUT_OFF_AFTER: Duration = Duration::from_secs(1);
/// Time for a field; the largest takes several seconds.
const FIELD_WITHIN: Duration = Duration::from_secs(60);
/// Turns of a cut-off robot with the evidential method, at half the ordered speed.
const SCAN_TURNS: f64 = 1.2;
/// Turns at one place, at the slower of two rates, beyond which it makes no progress.
const TURNS_AT_A_PLACE: f64 = 2.0;
/// Radius of a place, metres; less for a slow robot.
const PLACE_M: f64 = 0.2;
/// Radius of a circling robot's place, in diameters of its circle.
const CIRCLES: f64 = 1.2;
/// Distance below which a robot stands, metres; less for a slow robot.
const MOVED_M: f64 = 0.02;
/// Angle below which a robot does not turn, radians; less for a slow robot.
const TURNED_RAD: f64 = 0.1;
/// Share of full-speed motion that counts; a robot crawls near its target.
const SHARE: f64 = 0.05;
/// Distance out of any margin, even of several overlapping ones, metres.
const WAY_OUT_M: f64 = 1.0;
/// Distance within which contacts share a place, metres; a robot turns about a blocked wheel.
const HELD_WITHIN_M: f64 = 0.5;
/// Multiple of the target distance after which a robot wanders. The way around a trap takes two to
/// three.
const WANDERS: f64 = 3.0;
/// Least distance after which a robot wanders, metres.
const WANDERS_LEAST_M: f64 = 12.0;
/// Side of a map square, metres.
///
/// A laser's map is trustworthy, and a way through a building long. So each new square lets a robot
/// with a laser drive [`WANDERS`] squares farther.
const SQUARE_M: f64 = 1.0;
const MOST_SQUARES: usize = 10_000;
const MOST_REPLANS: u32 = 2;
/// Resets of the map before the target is unreachable.
const MOST_RESETS: u64 = 3;

pub(crate) fn words(cause: StallCause, body: &Body) -> String {
    let cause = match cause {
        StallCause::Still => "the robot stands still after every replan",
        StallCause::Pinned => "the robot moves but stays in place after every replan",
        StallCause::Wandering => {
            "the robot drives around without getting nearer, even after map resets"
        }
        StallCause::Held => "the wheels are held fast after every replan",
        StallCause::Relocated => "position fixes agree that the robot is elsewhere",
        StallCause::InsideHazard => "the map repeatedly shows the robot inside a hazard",
        StallCause::CutOff => "the map repeatedly cuts the robot off from the target",
    };
    match body.ackermann().map(|car| car.least_turning_radius()) {
        None => cause.to_owned(),
        Some(radius) => format!(
            "{cause}; this car cannot reverse and has a least turning radius of {radius:.2} m; give it more room"
        ),
    }
}

pub(crate) fn log(stall: &StallSample) {
    let (cause, recovery) = (stall.cause(), stall.recovery());
    let StallSample { stamp, x_m, y_m, epoch, replans, resets, .. } = stall;
    let what = match cause {
        StallCause::Relocated => "the robot is elsewhere; the map is reset",
        _ => "the robot stalls",
    };
    tracing::warn!(
        tick = stamp.tick,
        x_m,
        y_m,
        ?cause,
        ?recovery,
        epoch,
        replans,
        resets,
        "{what}"
    );
}

#[derive(Default)]
pub(crate) struct StallWatch {
    moved_m: f64,
    turned_rad: f64,
    place_m: f64,
    pinned_after: Duration,
    cut_off_after: Duration,
    /// Last motion and place of the robot; `None` before both are known.
    motion: Option<(PoseSample, Place)>,
    cut_off_since: Option<MissionTime>,
    waits_since: Option<MissionTime>,
    inside_hazard_since: Option<f64>,
    /// Whether long ways reset the map. The paper's method has no such rule.
    forgets: bool,
    /// Distance travelled at which the robot wanders, metres; `None` until the first tick after a
    /// start or reset.
    wanders_at: Option<f64>,
    /// Squares visited on the way to the target; `None` without a laser.
    been: Option<HashSet<IVec2>>,
    replans_here: u32,
    replans: u32,
    /// Place of held wheels, and its replans since the last reset.
    held_at: Option<(DVec2, u32)>,
    epoch: u64,
    /// Epochs skipped beside resets, and resets by relocations.
    skipped: u64,
    relocated: u64,
    /// Resets before the present target, without relocations.
    resets_before: u64,
    target: Option<u64>,
    relocations: u64,
    tick: Option<u64>,
    stalls: Vec<StallSample>,
    /// Stalls up to the newest target given up in the run.
    settled: usize,
}

#[derive(Clone, Copy, Debug)]
struct Place {
    since: MissionTime,
    middle: DVec2,
    /// Least distance to the target from this place, metres.
    nearest_m: f64,
}

impl StallWatch {
    pub(crate) fn new(mission: &Mission) -> Self {
        const { assert!(MOVED_M < PLACE_M) };
        let seconds = STALLED_AFTER.as_secs_f64();
        let slowest_turn = TAU / mission.turn_rad_s().min(mission.hurry().look_rad_s);
        let at_a_place = TURNS_AT_A_PLACE * slowest_turn;
        let car = mission.body().ackermann();
        // A robot turns on the spot, or while it drives.
        let on_the_spot = mission.method == Method::Evidential && car.is_none();
        let tightest = car.map_or(0.0, |car| car.least_turning_radius());
        let circle = tightest.max(mission.speed_m_s() / mission.turn_rad_s());
        Self {
            moved_m: MOVED_M.min(mission.speed_m_s() * seconds * SHARE),
            turned_rad: TURNED_RAD.min(mission.turn_rad_s() * seconds * SHARE),
            place_m: if on_the_spot {
                PLACE_M.min(mission.speed_m_s() * at_a_place * SHARE)
            } else {
                CIRCLES * 2.0 * circle
            },
            pinned_after: STALLED_AFTER + Duration::from_secs_f64(at_a_place),
            cut_off_after: if on_the_spot {
                let turn = SCAN_TURNS * TAU / mission.hurry().look_rad_s;
                CUT_OFF_AFTER + Duration::from_secs_f64(2.0 * turn)
            } else {
                CUT_OFF_AFTER
            },
            // A calibration drives to and fro, so its long way is intended.
            forgets: mission.method == Method::Evidential && mission.planner.calibration.is_none(),
            been: (mission.used(SensorKind::Scan) > 0).then(HashSet::new),
            ..Self::default()
        }
    }

    pub(crate) const fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Returns the replans and resets up to `tick`, or of the whole mission.
    pub(crate) fn recoveries(&self, tick: Option<u64>) -> (u32, u64) {
        let after = |tick: u64| self.stalls.iter().find(|stall| stall.stamp.tick > tick);
        tick.and_then(after).map_or((self.replans, self.resets()), |stall| match stall.recovery() {
            RecoveryStep::Replan => (stall.replans - 1, stall.resets),
            RecoveryStep::Reset => (stall.replans, stall.resets - 1),
            RecoveryStep::GiveUp => (stall.replans, stall.resets),
        })
    }

    const fn resets(&self) -> u64 {
        assert!(self.skipped <= self.epoch);
        self.epoch - self.skipped
    }

    pub(crate) fn gave_up(&self) -> Option<&StallSample> {
        let is_last = |stall: &&StallSample| stall.recovery() == RecoveryStep::GiveUp;
        assert!(self.settled <= self.stalls.len());
        self.stalls.iter().skip(self.settled).find(is_last)
    }

    /// Continues the run with another target. Ticks up to the `newest` belong to the last one.
    pub(crate) fn settle(&mut self, newest: Option<u64>) {
        self.settled = self.stalls.len();
        self.tick = self.tick.map(|tick| tick.max(newest.unwrap_or_default()));
    }

    pub(crate) const fn tick(&self) -> Option<u64> {
        self.tick
    }

    /// Checks a tick of a robot with the order to drive; each tick counts once.
    ///
    /// `held`: the link's failsafe or a missing stage holds the robot. `contact`: something holds
    /// its wheels.
    pub(crate) fn step(
        &mut self,
        pose: &PoseSample,
        guidance: &GuidanceSample,
        held: bool,
        contact: bool,
    ) -> Option<StallSample> {
        match self.tick.replace(pose.stamp.tick) {
            Some(tick) if tick == pose.stamp.tick => return None,
            Some(_) => {}
            None => self.relocations = pose.relocations,
        }
        // The map may be older than this supervisor.
        self.epoch = self.epoch.max(guidance.epoch);
        // A fresh planner knows no target yet.
        if guidance.target_number != 0
            && let Some(before) = self.target.replace(guidance.target_number)
            && before != guidance.target_number
        {
            self.on_new_target(pose.stamp.tick);
        }
        if held {
            self.hold(pose.stamp.tick);
            return None;
        }
        let relocated = self.relocations != pose.relocations;
        self.relocations = pose.relocations;
        let cause = if relocated {
            StallCause::Relocated
        } else if contact {
            StallCause::Held
        } else if self.waits_for_field(pose, guidance) {
            self.motion = None;
            return None;
        } else {
            self.without_policy(pose, guidance)
                .or_else(|| self.without_motion(pose, guidance))
                .or_else(|| self.without_end(pose, guidance))?
        };
        Some(self.recover(cause, pose))
    }

    /// Records a tick without an order to drive, at `pose` with a map of `epoch`.
    ///
    /// Only a relocation since the last pose is a stall.
    pub(crate) fn stand(&mut self, pose: &PoseSample, epoch: u64) -> Option<StallSample> {
        let is_first = self.tick.is_none();
        self.hold(pose.stamp.tick);
        self.epoch = self.epoch.max(epoch);
        let before = std::mem::replace(&mut self.relocations, pose.relocations);
        let is_elsewhere = !is_first && before != pose.relocations;
        is_elsewhere.then(|| self.recover(StallCause::Relocated, pose))
    }

    fn recover(&mut self, cause: StallCause, pose: &PoseSample) -> StallSample {
        let relocated = cause == StallCause::Relocated;
        assert!(self.relocated + self.resets_before <= self.resets());
        let recovery = if self.may_replan(cause, pose.pose().position) {
            self.replans += 1;
            RecoveryStep::Replan
        } else if relocated || self.resets() - self.relocated - self.resets_before < MOST_RESETS {
            // In an even epoch the mapper also resets the evidence near the robot.
            let skips = u64::from(relocated) * ((self.epoch + 1) % 2);
            self.relocated += u64::from(relocated);
            self.skipped += skips;
            self.epoch += 1 + skips;
            self.wanders_at = None;
            self.replans_here = 0;
            self.held_at = None;
            RecoveryStep::Reset
        } else {
            RecoveryStep::GiveUp
        };
        let now = pose.stamp.time();
        if let Some((anchor, place)) = &mut self.motion {
            (anchor.stamp, place.since) = (pose.stamp, now);
        }
        (self.cut_off_since, self.inside_hazard_since) = (None, None);
        self.waits_since = None;
        let stall = StallSample {
            stamp: pose.stamp,
            x_m: pose.x_m,
            y_m: pose.y_m,
            epoch: self.epoch,
            replans: self.replans,
            resets: self.resets(),
            cause: cause.into(),
            recovery: recovery.into(),
        };
        debug_assert!(!relocated || self.epoch.is_multiple_of(2));
        debug_assert!(self.stalls.last().is_none_or(|last| last.epoch <= stall.epoch));
        self.stalls.push(stall);
        stall
    }

    /// Returns whether a fresh planner is the next step against `cause`, and counts it.
    fn may_replan(&mut self, cause: StallCause, here: DVec2) -> bool {
        let replans = match cause {
            StallCause::Still | StallCause::Pinned => &mut self.replans_here,
            StallCause::Held => {
                let elsewhere = |(at, _): &mut (DVec2, u32)| at.distance(here) > HELD_WITHIN_M;
                self.held_at.take_if(elsewhere);
                &mut self.held_at.get_or_insert((here, 0)).1
            }
            StallCause::InsideHazard
            | StallCause::CutOff
            | StallCause::Wandering
            | StallCause::Relocated => return false,
        };
        let may = *replans < MOST_REPLANS;
        *replans += u32::from(may);
        assert!(*replans <= MOST_REPLANS);
        may
    }

    fn on_new_target(&mut self, tick: u64) {
        self.hold(tick);
        (self.inside_hazard_since, self.wanders_at, self.held_at) = (None, None, None);
        self.replans_here = 0;
        self.been.iter_mut().for_each(HashSet::clear);
        self.resets_before = self.resets() - self.relocated;
    }

    /// Records that the robot had no order to drive until `tick`.
    pub(crate) fn hold(&mut self, tick: u64) {
        self.tick = Some(tick);
        self.forget_motion();
    }

    /// Clears motion after something held the robot, perhaps without a tick.
    pub(crate) const fn forget_motion(&mut self) {
        self.motion = None;
        (self.cut_off_since, self.waits_since) = (None, None);
    }

    /// Returns whether the robot waits for a field within [`FIELD_WITHIN`].
    fn waits_for_field(&mut self, pose: &PoseSample, guidance: &GuidanceSample) -> bool {
        if guidance.status() != GuidanceStatus::Waiting {
            self.waits_since = None;
            return false;
        }
        let now = pose.stamp.time();
        now.since(*self.waits_since.get_or_insert(now)) < FIELD_WITHIN
    }

    /// Detects u = 0 at the robot, in the current map's field, for longer than it needs to get
    /// away.
    fn without_policy(
        &mut self,
        pose: &PoseSample,
        guidance: &GuidanceSample,
    ) -> Option<StallCause> {
        let (now, travelled) = (pose.stamp.time(), pose.travelled_m);
        let status = guidance.status();
        let is = |what| status == what && guidance.epoch == self.epoch;
        if !is(GuidanceStatus::Unreachable) {
            self.cut_off_since = None;
        } else if now.since(*self.cut_off_since.get_or_insert(now)) >= self.cut_off_after {
            return Some(StallCause::CutOff);
        }
        if !is(GuidanceStatus::WayOut) {
            self.inside_hazard_since = None;
        } else if travelled - *self.inside_hazard_since.get_or_insert(travelled) >= WAY_OUT_M {
            return Some(StallCause::InsideHazard);
        }
        None
    }

    /// Detects a drive since the start or last reset that is too long for a correct map.
    fn without_end(&mut self, pose: &PoseSample, guidance: &GuidanceSample) -> Option<StallCause> {
        let most_m = (WANDERS * guidance.distance_m).max(WANDERS_LEAST_M);
        let wanders_at = self.wanders_at.get_or_insert(pose.travelled_m + most_m);
        let square = (pose.pose().position / SQUARE_M).floor().as_ivec2();
        let is_new = |been: &mut HashSet<_>| been.len() < MOST_SQUARES && been.insert(square);
        if self.been.as_mut().is_some_and(is_new) {
            *wanders_at += WANDERS * SQUARE_M;
        }
        (self.forgets && pose.travelled_m >= *wanders_at).then_some(StallCause::Wandering)
    }

    /// Detects a robot that stands still, or moves at one place for longer.
    fn without_motion(
        &mut self,
        pose: &PoseSample,
        guidance: &GuidanceSample,
    ) -> Option<StallCause> {
        let now = pose.stamp.time();
        let (middle, nearest_m) = (pose.pose().position, guidance.distance_m);
        let arrived = Place { since: now, middle, nearest_m };
        let (anchor, place) = self.motion.get_or_insert((*pose, arrived));
        if (pose.travelled_m - anchor.travelled_m).abs() >= self.moved_m
            || (pose.heading_rad - anchor.heading_rad).abs() >= self.turned_rad
        {
            *anchor = *pose;
        }
        if middle.distance(place.middle) >= self.place_m {
            *place = arrived;
            self.replans_here = 0;
        } else if nearest_m <= place.nearest_m - self.moved_m {
            // A robot that crawls to its target makes progress.
            *place = Place { middle: place.middle, ..arrived };
        }
        // The planner looks around first, which has its own timeout.
        if guidance.status() == GuidanceStatus::Unreachable {
            return None;
        }
        let still = now.since(anchor.stamp.time()) >= STALLED_AFTER;
        let pinned = now.since(place.since) >= self.pinned_after;
        match (still, pinned) {
            (true, _) => Some(StallCause::Still),
            (_, true) => Some(StallCause::Pinned),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests;
