//! The robot is not where things that move will be.
//!
//! Ways of some seconds are foreseen as controller and base would follow them: the one that the field advises, those in all directions
//! around, back if a laser looks there, and to stand. Movers are foreseen as discs that go straight on. What the robot would come near to
//! is a danger, the less the later. Advice without danger is followed. Otherwise the robot goes the way with the greatest gain along the
//! advice less its danger, so it steps aside early. It goes only where it could brake after the next tick and be at rest before it meets
//! something: what runs into a robot at rest is not that robot's fault.

use std::f64::consts::{PI, TAU};

use common::{
    geometry::wrap_angle,
    kinematics::Twist,
    mission::{Mission, Sensor, SensorKind},
    samples::{GuidanceStatus, Mover, PoseSample},
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
/// A robot in motion meets what comes nearer than this, metres, and its growth, m/s: movers turn and change their speed.
const APART_M: f64 = 0.1;
const GROWS_M_S: f64 = 0.15;
/// Danger is 1 at a touch now, and falls by a factor of e in so many metres and seconds. The doubt of a velocity counts up to m/s.
const NEAR_M: f64 = 0.3;
const SOON_S: f64 = 4.0;
const MOST_DOUBT_M_S: f64 = 0.4;
const MOST_DANGER: f64 = 3.0;
/// Less changes no advice. The gain of the way at top speed along the advice outweighs so much less danger.
const LEAST_DANGER: f64 = 0.1;
const GAIN: f64 = 1.0 / 3.0;
/// Hazard this near to a mover may be its own, metres, because its trace fades within two scans.
const TRACE_M: f64 = 0.4;
/// A way leads to no hazard for so long.
const CLEAR_S: f64 = 1.0;

#[derive(Clone, Debug)]
pub(crate) struct Evasion {
    radius: f64,
    /// Hazards are inflated by this, and the rest of the body's radius.
    inflated_m: f64,
    rest_m: f64,
    motion: MotionModel,
    /// A laser looks there.
    backs: bool,
}

/// A mover.
#[derive(Clone, Copy, Debug)]
struct Disc {
    at: DVec2,
    velocity: DVec2,
    radius: f64,
    /// The distance from the robot's centre at a touch, metres.
    touches_m: f64,
    doubt_m_s: f64,
}

#[derive(Clone, Copy, Debug)]
struct Foreseen {
    /// When the robot meets something that moves, while it moves itself, and when it is at a hazard; infinite for never.
    meets_s: f64,
    hazard_s: f64,
    danger: f64,
    /// The way along the advice.
    gain_m: f64,
}

impl Evasion {
    /// None for a robot that does not see what moves, and for one that cannot turn on the spot.
    pub(crate) fn new(mission: &Mission) -> Option<Self> {
        let body = mission.body();
        let half_width = mission.outline().map_or(body.radius_m, |it| it.half_width_m());
        (mission.looks_first() && mission.used(SensorKind::Scan) > 0).then(|| Self {
            radius: body.radius_m,
            inflated_m: half_width + mission.mapper.clearance_m,
            rest_m: body.radius_m - half_width,
            motion: MotionModel::new(mission),
            backs: mission.lasers().iter().any(|(_, laser)| looks_back(laser)),
        })
    }

    /// The field's `advice` for a robot at `pose`, or another one because of `movers`.
    pub(crate) fn advise(
        &self,
        view: &View<'_>,
        movers: &[Mover],
        pose: &PoseSample,
        advice: Advice,
    ) -> Advice {
        let discs: Vec<_> = movers.iter().map(|mover| self.disc(mover)).collect();
        let foresee = |to: Advice, for_s| self.foresee(view, &discs, pose, (to, for_s), advice.1);
        let is_safe = |to: Advice| {
            let brakes = foresee(to, self.motion.period_s);
            brakes.meets_s.is_infinite() && brakes.hazard_s.is_infinite()
        };
        let (status, along, limit) = advice;
        if discs.is_empty() || foresee(advice, AHEAD_S).danger < LEAST_DANGER && is_safe(advice) {
            return advice;
        }
        let around = (0..DIRECTIONS)
            .map(|step| DVec2::from_angle(TAU * f64::from(step) / f64::from(DIRECTIONS)));
        let back = self.backs.then(|| (pose.pose().axis(), -1.0));
        let ways = around.map(|to| (to, 1.0)).chain(back).flat_map(|(to, sign)| {
            SPEEDS.map(|share| (GuidanceStatus::Along, to, sign * share * self.motion.speed))
        });
        let advised = SPEEDS.map(|share| (status, along, share * limit));
        let open = advised.into_iter().chain(ways).filter_map(|to| {
            let it = foresee(to, AHEAD_S);
            (it.hazard_s >= CLEAR_S && is_safe(to)).then_some((to, it))
        });
        let score = |it: &Foreseen| GAIN * it.gain_m / (self.motion.speed * AHEAD_S) - it.danger;
        let all = open.chain([(STAND, foresee(STAND, AHEAD_S))]);
        all.max_by(|(_, one), (_, other)| score(one).total_cmp(&score(other)))
            .map_or(STAND, |(to, _)| to)
    }

    fn disc(&self, mover: &Mover) -> Disc {
        let &Mover { x_m, y_m, vx_m_s, vy_m_s, radius_m, doubt_m, doubt_m_s } = mover;
        Disc {
            at: DVec2::new(x_m.into(), y_m.into()),
            velocity: DVec2::new(vx_m_s.into(), vy_m_s.into()),
            radius: radius_m.into(),
            touches_m: self.radius + f64::from(radius_m) + f64::from(doubt_m),
            doubt_m_s: doubt_m_s.into(),
        }
    }

    /// How the robot fares that follows `to` for `for_s` seconds and stands then, or before a hazard. From where it is too near by now,
    /// it may go away.
    fn foresee(
        &self,
        view: &View<'_>,
        discs: &[Disc],
        sample: &PoseSample,
        (to, for_s): (Advice, f64),
        along: DVec2,
    ) -> Foreseen {
        let start = sample.pose();
        let twist = Twist { v: sample.v_m_s, omega: sample.omega_rad_s };
        let mut now = Moving { pose: start, twist };
        let is_hazard = |at: DVec2| {
            let is_its = |disc: &Disc| {
                disc.at.distance(at) <= disc.radius + self.inflated_m + self.rest_m + TRACE_M
            };
            (view.is_hazard(at) || view.has_hazard(at, self.rest_m)) && !discs.iter().any(is_its)
        };
        let mut is_inside = is_hazard(start.position);
        let (mut meets_s, mut hazard_s, mut danger) = (f64::INFINITY, f64::INFINITY, 0.0_f64);
        let dead_s = self.motion.dead_s();
        for step in 1..=(AHEAD_S / STEP_S) as u32 {
            let at_s = STEP_S * f64::from(step);
            let follows = hazard_s.is_infinite() && at_s <= for_s + dead_s;
            let acts = (at_s > dead_s).then_some(if follows { to } else { STAND });
            let next = self.motion.next(now, STEP_S, acts);
            let moves = !next.is_at_rest();
            let is_there = moves && is_hazard(next.pose.position);
            is_inside &= !moves || is_there;
            if is_there && !is_inside {
                hazard_s = hazard_s.min(at_s);
                now.twist = Twist { v: 0.0, ..next.twist };
            } else {
                now = next;
            }
            for disc in discs {
                let at = disc.at + disc.velocity * at_s;
                let gap_m = at.distance(now.pose.position) - disc.touches_m;
                let least_m = APART_M + (GROWS_M_S + disc.doubt_m_s) * at_s;
                let first_m = disc.at.distance(start.position) - disc.touches_m;
                if moves && gap_m < least_m.min(first_m) {
                    meets_s = meets_s.min(at_s);
                }
                let doubt_m = disc.doubt_m_s.min(MOST_DOUBT_M_S) * at_s;
                let near = ((doubt_m - gap_m) / NEAR_M).exp().min(MOST_DANGER);
                danger = danger.max(near * (-at_s / SOON_S).exp());
            }
        }
        Foreseen {
            meets_s,
            hazard_s,
            danger,
            gain_m: (now.pose.position - start.position).dot(along),
        }
    }
}

fn looks_back(laser: &Sensor) -> bool {
    let (first_rad, step_rad) = laser.fan();
    let behind_rad = wrap_angle(PI - laser.mount.looks_rad()).abs();
    laser.used && behind_rad <= first_rad.abs() + step_rad
}
