//! Evasion of moving obstacles.
//!
//! Paths of some seconds are predicted as controller and base would follow them. Legs follow the
//! field, go in all directions, back up if a laser covers the rear, or stand. Movers are discs with
//! constant velocity. Proximity to a mover is a danger that fades with time.
//!
//! Advice without danger is followed. Otherwise the robot begins the path with the greatest gain
//! along the field minus danger. It moves only if it could brake after the next tick and rest before
//! any contact, or if the whole path is free.
//!
//! A robot hindered for long insists on its way, because people who give way would make it stand
//! until its time ends. It evades again for its next target, or once nothing has moved near it for
//! as long.

use std::f64::consts::{PI, TAU};

use common::{
    geometry::{distance_to_segment, wrap_angle},
    kinematics::Twist,
    mission::{Mission, Sensor, SensorKind},
    samples::Mover,
};
use glam::DVec2;

use crate::{
    motion::{Advice, MotionModel, Moving, STAND, STEP_S},
    view::View,
};

const AHEAD_S: f64 = 5.0;
const DIRECTIONS: u32 = 16;
/// Shares of the top speed.
const SPEEDS: [f64; 2] = [1.0, 0.5];
/// Least gap between a moving robot and a mover, metres, and its growth, m/s, because movers turn.
const APART_M: f64 = 0.1;
const GROWS_M_S: f64 = 0.15;
/// Danger is 1 at a touch now and falls by a factor of e per `NEAR_M` and per `SOON_S`.
///
/// The velocity uncertainty counts up to `MOST_DOUBT_M_S`.
const NEAR_M: f64 = 0.3;
const SOON_S: f64 = 4.0;
const MOST_DOUBT_M_S: f64 = 0.4;
const MOST_DANGER: f64 = 3.0;
/// Danger below which advice is kept, and danger that the gain at top speed along the advice
/// outweighs.
///
/// With a third of `GAIN`, a robot of 0.7 m/s hardly advanced among people who give way.
const LEAST_DANGER: f64 = 0.1;
const GAIN: f64 = 1.0;
/// Hazard this near to a mover's place within the last `TRACE_S` may be its own trace, which fades
/// within two scans.
const TRACE_M: f64 = 0.1;
const TRACE_S: f64 = 0.3;
/// End times of the legs of a path; `KEPT` paths continue, no two of which end alike.
const LEGS_S: [f64; 5] = [0.5, 1.0, 2.0, 3.5, AHEAD_S];
const KEPT: usize = 16;
const ALIKE_M: f64 = 0.25;
const ALIKE_M_S: f64 = 0.3;
/// Standing time at the start of a run to detect movers.
const WATCHES_S: f64 = 0.5;
/// Lagging wheels below it count as at rest.
const FADED_M_S: f64 = 0.05;
/// Distance beyond which a mover is harmless, metres.
const FAR_M: f64 = 1.5;
/// Time of hindrance by movers, less the time without, after which the robot insists, seconds.
const PATIENCE_S: f64 = 16.0;
/// Shares of the advised speed for an insisting robot; a slow robot rests soon.
const PATIENT_SPEEDS: [f64; 3] = [1.0, 0.5, 0.25];
/// Longest time between two answers that counts, seconds.
const LONGEST_TICK_S: f64 = 1.0;

#[derive(Debug)]
pub(crate) struct Evasion {
    radius: f64,
    inflated_m: f64,
    rest_m: f64,
    motion: MotionModel,
    /// Time that lagging wheels still turn when the model is at rest, seconds.
    fades_s: f64,
    /// Whether a laser covers the rear.
    backs: bool,
    /// Time of the newest answer, and how long movers hindered the robot, seconds.
    answered_s: f64,
    kept_s: f64,
    insists: bool,
}

#[derive(Clone, Copy)]
struct Disc {
    at: DVec2,
    velocity: DVec2,
    radius: f64,
    touches_m: f64,
    doubt_m_s: f64,
}

/// Contact of the body with hazards: none at any heading, corners possible, or sides certain.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Near {
    Free,
    Corners,
    Sides,
}

#[derive(Clone, Copy)]
struct Way {
    first: Advice,
    last: Advice,
    /// Whether the robot rests without a touch if it brakes after the next tick.
    rests: bool,
    now: Moving,
    steps: u32,
    moved_s: f64,
    /// Least contact with a hazard since the start, which later steps may not exceed.
    near: Near,
    /// Times at which the moving robot meets a mover and reaches a hazard; infinite for never.
    meets_s: f64,
    hazard_s: f64,
    danger: f64,
    gain_m: f64,
}

impl Evasion {
    /// Returns `None` for a robot that cannot detect movers or turn on the spot.
    pub(crate) fn new(mission: &Mission) -> Option<Self> {
        let body = mission.body();
        let half_width = mission.outline().map_or(body.radius_m, |it| it.half_widths_m()[0]);
        let lags = (mission.speed_m_s() / FADED_M_S).ln() - 1.0;
        (mission.looks_first() && mission.used(SensorKind::Scan) > 0).then(|| Self {
            radius: body.radius_m,
            inflated_m: half_width + mission.mapper.clearance_m,
            rest_m: body.radius_m - half_width,
            motion: MotionModel::new(mission),
            fades_s: lags.max(0.0) * mission.trusted_response().lag_s,
            backs: mission.lasers().iter().any(|(_, laser)| looks_back(laser)),
            answered_s: 0.0,
            kept_s: 0.0,
            insists: false,
        })
    }

    pub(crate) fn forget_encounter(&mut self) {
        (self.kept_s, self.insists) = (0.0, false);
    }

    pub(crate) fn advise(
        &mut self,
        view: &View<'_>,
        movers: &[Mover],
        at_s: f64,
        now: Moving,
        advice: Advice,
    ) -> Advice {
        let for_s = (at_s - self.answered_s).clamp(0.0, LONGEST_TICK_S);
        self.answered_s = at_s;
        if at_s < WATCHES_S {
            return STAND;
        }
        let scene = Scene::new(self, view, movers, now);
        let safe = self.safe(&scene, advice);
        // An insisting robot follows its way, so only an empty scene ends the encounter.
        let is_free = scene.discs.is_empty() || safe == advice && !self.insists;
        let change_s = if is_free { -for_s } else { for_s };
        self.kept_s = (self.kept_s + change_s).clamp(0.0, PATIENCE_S);
        self.insists = self.kept_s >= PATIENCE_S || self.insists && self.kept_s > 0.0;
        assert!(!self.insists || self.kept_s > 0.0);
        safe
    }

    fn safe(&self, scene: &Scene<'_>, advice: Advice) -> Advice {
        let start = scene.start();
        let acts_until_s = self.motion.dead_s() + self.motion.period_s;
        let is_safe = |to: Advice| scene.rests(scene.go(start, to, acts_until_s));
        let is_clear = || scene.go(start, advice, AHEAD_S).danger < LEAST_DANGER;
        if scene.discs.is_empty() || is_clear() && is_safe(advice) {
            return advice;
        }
        let speed = self.motion.law.speed;
        if self.insists {
            let slower = PATIENT_SPEEDS.map(|share| advice.slower(share));
            return slower.into_iter().find(|to| is_safe(*to)).unwrap_or(STAND);
        }
        let advised = SPEEDS.map(|share| advice.slower(share));
        let back = SPEEDS.map(|share| Advice::back(scene.start.pose.axis(), share * speed));
        let back = back.into_iter().filter(|_| self.backs);
        let all = SPEEDS.into_iter().flat_map(|share| around(DIRECTIONS, share * speed));
        let open = advised.into_iter().chain(all).chain(back);
        let first =
            open.map(|to| Way { first: to, rests: is_safe(to), ..scene.go(start, to, LEGS_S[0]) });
        let first = first.filter(|way| way.hazard_s.is_infinite());
        let stand = Way { first: STAND, rests: true, ..scene.go(start, STAND, LEGS_S[0]) };
        let mut ways: Vec<_> = first.chain([stand]).collect();
        let score = |way: &Way| GAIN * way.gain_m / (speed * AHEAD_S) - way.danger;
        for until_s in &LEGS_S[1..] {
            let next = best(ways, score).into_iter().flat_map(|way| {
                let field = scene.field(way.now.pose.position);
                let field = field.map(|to| Advice::along(to, speed));
                let legs = around(DIRECTIONS / 2, speed).chain(field).chain([STAND, way.last]);
                legs.map(move |to| scene.go(way, to, *until_s))
            });
            ways = next.collect();
        }
        let open = ways.iter().filter(|way| way.rests || way.meets_s.is_infinite());
        assert!(!ways.is_empty());
        let best = open.max_by(|one, other| score(one).total_cmp(&score(other)));
        best.map_or(STAND, |way| way.first)
    }

    fn disc(&self, mover: &Mover) -> Disc {
        let &Mover { radius_m, doubt_m, doubt_m_s, .. } = mover;
        Disc {
            at: mover.place(),
            velocity: mover.velocity(),
            radius: radius_m.into(),
            touches_m: self.radius + f64::from(radius_m) + f64::from(doubt_m),
            doubt_m_s: doubt_m_s.into(),
        }
    }
}

fn around(directions: u32, speed: f64) -> impl Iterator<Item = Advice> {
    (0..directions).map(move |step| {
        let angle = TAU * f64::from(step) / f64::from(directions);
        Advice::along(DVec2::from_angle(angle), speed)
    })
}

fn best(mut ways: Vec<Way>, score: impl Fn(&Way) -> f64) -> Vec<Way> {
    ways.sort_by(|one, other| score(other).total_cmp(&score(one)));
    let mut kept: Vec<Way> = Vec::with_capacity(KEPT);
    for way in ways {
        let is_alike = |other: &Way| {
            let apart_m = other.now.pose.position.distance(way.now.pose.position);
            let apart_m_s = (other.now.twist.v - way.now.twist.v).abs();
            apart_m < ALIKE_M && apart_m_s < ALIKE_M_S
        };
        if kept.len() < KEPT && !kept.iter().any(is_alike) {
            kept.push(way);
        }
    }
    kept
}

struct Scene<'a> {
    evasion: &'a Evasion,
    view: &'a View<'a>,
    discs: Vec<Disc>,
    start: Moving,
}

impl<'a> Scene<'a> {
    /// Leaves out movers that the robot cannot meet within the prediction.
    fn new(evasion: &'a Evasion, view: &'a View<'a>, movers: &[Mover], start: Moving) -> Self {
        let (at, reach_m) = (start.pose.position, AHEAD_S * evasion.motion.law.speed + FAR_M);
        let comes = |disc: &Disc| {
            let goes_to = disc.at + AHEAD_S * disc.velocity;
            distance_to_segment(at, disc.at, goes_to) <= reach_m + disc.touches_m
        };
        let discs = movers.iter().map(|mover| evasion.disc(mover)).filter(comes).collect();
        Self { evasion, view, discs, start }
    }

    fn start(&self) -> Way {
        Way {
            first: STAND,
            rests: true,
            last: STAND,
            now: self.start,
            steps: 0,
            moved_s: f64::NEG_INFINITY,
            near: self.near(self.start.pose.position),
            meets_s: f64::INFINITY,
            hazard_s: f64::INFINITY,
            danger: 0.0,
            gain_m: 0.0,
        }
    }

    fn near(&self, at: DVec2) -> Near {
        let Evasion { inflated_m, rest_m, .. } = *self.evasion;
        let is_its = |disc: &Disc| {
            let was = disc.at - TRACE_S * disc.velocity;
            let apart_m = distance_to_segment(at, was, disc.at);
            apart_m <= disc.radius + inflated_m + rest_m + TRACE_M
        };
        let near = match self.view.is_hazard(at) {
            true => Near::Sides,
            false if self.view.has_hazard(at, rest_m) => Near::Corners,
            false => Near::Free,
        };
        if self.discs.iter().any(is_its) { Near::Free } else { near }
    }

    fn field(&self, at: DVec2) -> Option<DVec2> {
        match self.view.guidance(at) {
            harmonic::Guidance::Along(to) => Some(to.into()),
            _ => None,
        }
    }

    /// Continues `way` along `to` until `until_s`; the robot stands before a hazard.
    ///
    /// A robot too near to a hazard may leave it but come no nearer.
    fn go(&self, way: Way, to: Advice, until_s: f64) -> Way {
        let motion = &self.evasion.motion;
        let dead_s = motion.dead_s();
        assert!(until_s > 0.0);
        let mut way = Way { last: to, ..way };
        let until = (until_s / STEP_S).ceil() as u32;
        while way.steps < until {
            way.steps += 1;
            let at_s = STEP_S * f64::from(way.steps);
            let to = if way.hazard_s.is_infinite() { to } else { STAND };
            let from = way.now.pose.position;
            let next = motion.next(way.now, STEP_S, (at_s > dead_s).then_some(to));
            let moves = !next.is_at_rest();
            let near = if moves { self.near(next.pose.position) } else { way.near };
            let is_there = near > way.near;
            way.near = way.near.min(near);
            if is_there {
                way.hazard_s = way.hazard_s.min(at_s);
                way.now.twist = Twist { v: 0.0, ..next.twist };
            } else {
                way.now = next;
            }
            let at = way.now.pose.position;
            if at != from {
                let along = self.field(from).unwrap_or(DVec2::ZERO);
                way.gain_m += (at - from).dot(along);
            }
            way.moved_s = if moves { at_s } else { way.moved_s };
            let may_move = self.may_move(&way);
            self.meet(&mut way, at_s, may_move);
        }
        way
    }

    fn may_move(&self, way: &Way) -> bool {
        STEP_S * f64::from(way.steps) <= way.moved_s + self.evasion.fades_s
    }

    /// Returns whether the robot rests before any contact if it brakes now.
    fn rests(&self, mut way: Way) -> bool {
        while way.meets_s.is_infinite() && way.hazard_s.is_infinite() {
            let next_s = STEP_S * f64::from(way.steps + 1);
            if next_s > AHEAD_S || !self.may_move(&way) {
                return true;
            }
            way = self.go(way, STAND, next_s);
        }
        false
    }

    fn meet(&self, way: &mut Way, at_s: f64, moves: bool) {
        let at = way.now.pose.position;
        for disc in &self.discs {
            let doubt_m = disc.doubt_m_s.min(MOST_DOUBT_M_S) * at_s;
            let there = disc.at + disc.velocity * at_s;
            let far_m = disc.touches_m + doubt_m + FAR_M;
            if there.distance_squared(at) > far_m * far_m {
                continue;
            }
            let gap_m = there.distance(at) - disc.touches_m;
            let least_m = APART_M + (GROWS_M_S + disc.doubt_m_s) * at_s;
            let first_m = disc.at.distance(self.start.pose.position) - disc.touches_m;
            if moves && gap_m < least_m.min(first_m) {
                way.meets_s = way.meets_s.min(at_s);
            }
            let near = ((doubt_m - gap_m) / NEAR_M).exp().min(MOST_DANGER);
            way.danger = way.danger.max(near * (-at_s / SOON_S).exp());
            assert!((0.0..=MOST_DANGER).contains(&way.danger));
        }
    }
}

fn looks_back(laser: &Sensor) -> bool {
    let (first_rad, step_rad) = laser.fan();
    let behind_rad = wrap_angle(PI - laser.mount.looks_rad()).abs();
    laser.used && behind_rad <= first_rad.abs() + step_rad
}
