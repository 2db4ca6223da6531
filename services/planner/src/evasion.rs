//! The robot is not where things that move will be.
//!
//! Ways of some seconds are foreseen as controller and base would follow them: the one that the field advises, those in all directions
//! around, back, and to stand. Movers are foreseen as discs that go straight on and grow with their doubt. Advice that meets none is
//! followed. Otherwise the robot goes the way that meets none and comes farthest along the advice, or, if there is none, the way that
//! meets one last. It stands when it could not be at rest by then: what runs into a robot at rest is not that robot's fault.

use std::f64::consts::TAU;

use common::{
    kinematics::{FACES_COSINE, LEAST_SPEED_M_S, TURN_GAIN},
    mission::{Mission, Response, SensorKind},
    samples::{GuidanceStatus, Mover, PoseSample},
};
use glam::DVec2;

use crate::view::View;

const AHEAD_S: f64 = 3.0;
const STEP_S: f64 = 0.1;
const DIRECTIONS: u32 = 16;
/// Shares of the top speed.
const SPEEDS: [f64; 2] = [1.0, 0.5];
/// The least distance from a mover, metres, and its growth for a robot in motion and at rest, m/s: movers turn and change their speed.
const APART_M: f64 = 0.1;
const GROWS_M_S: f64 = 0.15;
const GROWS_AT_REST_M_S: f64 = 0.05;
/// Hazard this near to a mover may be its own, metres, because its trace fades within two scans.
const TRACE_M: f64 = 0.4;
/// The robot brakes so many ticks before it must.
const EARLIER_TICKS: f64 = 2.0;

/// Status, direction and speed limit of the guidance.
pub(crate) type Advice = (GuidanceStatus, DVec2, f64);

const STAND: Advice = (GuidanceStatus::Waiting, DVec2::ZERO, 0.0);

#[derive(Clone, Debug)]
pub(crate) struct Evasion {
    radius: f64,
    /// Hazards are inflated by this, and the rest of the body's radius.
    inflated_m: f64,
    rest_m: f64,
    speed: f64,
    turn: f64,
    look: f64,
    /// The controller's cosines for full speed, and for turns on the spot.
    full_speed: f64,
    turns: f64,
    response: Response,
    period_s: f64,
}

/// A mover.
#[derive(Clone, Copy, Debug)]
struct Disc {
    at: DVec2,
    velocity: DVec2,
    radius: f64,
    /// The least distance from the robot's centre at first, metres, and its growth, m/s.
    apart_m: f64,
    doubt_m_s: f64,
}

#[derive(Clone, Copy, Debug)]
struct Foreseen {
    /// When something is met; infinite for never.
    meets_s: f64,
    /// The way along the advice.
    gain_m: f64,
}

impl Evasion {
    /// None for a robot that does not see what moves, and for one that cannot turn on the spot.
    pub(crate) fn new(mission: &Mission) -> Option<Self> {
        let (body, hurry) = (mission.body(), mission.hurry());
        let half_width = mission.outline().map_or(body.radius_m, |it| it.half_width_m());
        (mission.looks_first() && mission.used(SensorKind::Scan) > 0).then(|| Self {
            radius: body.radius_m,
            inflated_m: half_width + mission.mapper.clearance_m,
            rest_m: body.radius_m - half_width,
            speed: mission.speed_m_s(),
            turn: mission.turn_rad_s(),
            look: hurry.look_rad_s,
            full_speed: hurry.full_speed_within_deg.to_radians().cos(),
            turns: hurry.turns_beyond_deg.to_radians().cos(),
            response: body.response,
            period_s: 1.0 / mission.robot.rate_hz,
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
        let foresee = |to: Advice| self.foresee(view, &discs, pose, to, advice.1);
        if discs.is_empty() || foresee(advice).meets_s.is_infinite() {
            return advice;
        }
        let around = (0..DIRECTIONS)
            .map(|step| DVec2::from_angle(TAU * f64::from(step) / f64::from(DIRECTIONS)));
        let ways = std::iter::once(advice.1).chain(around).map(|to| (to, 1.0));
        let ways = ways.chain([(pose.pose().axis(), -1.0)]).flat_map(|(to, sign)| {
            SPEEDS.map(|share| (GuidanceStatus::Along, to, sign * share * self.speed))
        });
        let foreseen = ways.chain([STAND]).map(|to| (to, foresee(to)));
        let best = foreseen.max_by(|(_, one), (_, other)| {
            let later = one.meets_s.total_cmp(&other.meets_s);
            later.then(one.gain_m.total_cmp(&other.gain_m))
        });
        let Response { acceleration_m_s2, turn_acceleration_rad_s2, .. } = self.response;
        let brakes_s = (pose.v_m_s.abs() / acceleration_m_s2)
            .max(pose.omega_rad_s.abs() / turn_acceleration_rad_s2);
        let stops_s = self.response.dead_time_s() + brakes_s + EARLIER_TICKS * self.period_s;
        best.filter(|(_, it)| it.meets_s > stops_s).map_or(STAND, |(to, _)| to)
    }

    fn disc(&self, mover: &Mover) -> Disc {
        let &Mover { x_m, y_m, vx_m_s, vy_m_s, radius_m, doubt_m, doubt_m_s } = mover;
        Disc {
            at: DVec2::new(x_m.into(), y_m.into()),
            velocity: DVec2::new(vx_m_s.into(), vy_m_s.into()),
            radius: radius_m.into(),
            apart_m: self.radius + APART_M + f64::from(radius_m) + f64::from(doubt_m),
            doubt_m_s: doubt_m_s.into(),
        }
    }

    /// How the robot fares that follows `to`. From where it is too near by now, it may go away.
    fn foresee(
        &self,
        view: &View<'_>,
        discs: &[Disc],
        sample: &PoseSample,
        to: Advice,
        along: DVec2,
    ) -> Foreseen {
        let start = sample.pose();
        let (mut pose, mut v, mut omega) = (start, sample.v_m_s, sample.omega_rad_s);
        let is_hazard = |at: DVec2| {
            let is_its = |disc: &Disc| {
                disc.at.distance(at) <= disc.radius + self.inflated_m + self.rest_m + TRACE_M
            };
            (view.is_hazard(at) || view.has_hazard(at, self.rest_m)) && !discs.iter().any(is_its)
        };
        let mut is_inside = is_hazard(start.position);
        let mut meets_s = f64::INFINITY;
        for step in 1..=(AHEAD_S / STEP_S) as u32 {
            let at_s = STEP_S * f64::from(step);
            if at_s > self.response.dead_time_s() {
                let [wanted_v, wanted_omega] = self.command(pose.axis(), to);
                let near = |now: f64, wanted: f64, most: f64| {
                    now + (wanted - now).clamp(-most * STEP_S, most * STEP_S)
                };
                v = near(v, wanted_v, self.response.acceleration_m_s2);
                omega = near(omega, wanted_omega, self.response.turn_acceleration_rad_s2);
            }
            let moves = v != 0.0 || omega != 0.0;
            pose = pose.along_arc(v * STEP_S, omega * STEP_S);
            let grows_m_s = if moves { GROWS_M_S } else { GROWS_AT_REST_M_S };
            let is_met = |disc: &Disc| {
                let apart_m = disc.apart_m + (grows_m_s + disc.doubt_m_s) * at_s;
                let at = disc.at + disc.velocity * at_s;
                at.distance(pose.position) < apart_m.min(disc.at.distance(start.position))
            };
            is_inside &= is_hazard(pose.position);
            if discs.iter().any(is_met) || moves && !is_inside && is_hazard(pose.position) {
                meets_s = at_s;
                break;
            }
        }
        Foreseen { meets_s, gain_m: (pose.position - start.position).dot(along) }
    }

    /// The controller's speed ahead, m/s, and turn rate, rad/s.
    fn command(&self, axis: DVec2, (status, to, limit): Advice) -> [f64; 2] {
        let (cosine, sine) = (axis.dot(to), axis.perp_dot(to));
        let angle = sine.atan2(cosine).abs();
        let most = self.response.turn_to_stop_within(angle);
        let drives = matches!(status, GuidanceStatus::Along | GuidanceStatus::WayOut);
        let sharp = ((cosine - self.turns) / (self.full_speed - self.turns)).min(1.0);
        if drives && limit < 0.0 {
            [limit, 0.0]
        } else if drives && sharp > 0.0 && limit >= LEAST_SPEED_M_S {
            [(self.speed * sharp).min(limit), (self.turn * sine).clamp(-most, most)]
        } else if drives && cosine > FACES_COSINE {
            [0.0; 2]
        } else {
            [0.0, (TURN_GAIN * angle).min(self.look).min(most) * sine.signum()]
        }
    }
}
