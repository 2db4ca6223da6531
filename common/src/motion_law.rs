//! Motion law: guidance to a twist. The controller commands it, and the planner predicts it.
//!
//! `method = "paper"` follows (14), (15) and (16); so does a car, within the speed limit and never
//! on the spot. The evidential law turns on the spot towards the guidance, then drives by (15)
//! within what response and speed limit allow.

use glam::DVec2;

use crate::{
    kinematics::{FACES_COSINE, LEAST_SPEED_M_S, TURN_GAIN, Twist},
    mission::{Controller, Method, Mission, Response},
    samples::Maneuver,
};

/// Turn rate below which the wheels stick.
const LEAST_TURN_RAD_S: f64 = 0.25;

/// Alignment (14), with the heading for the measured velocity, which has no direction at rest,
/// where every mission starts.
#[derive(Clone, Copy, Debug)]
pub struct Alignment {
    /// eta_d.
    pub cosine: f64,
    /// eta_c: its sine, positive for guidance to the left. The printed sign turns away.
    pub sine: f64,
}

impl Alignment {
    pub fn of(axis: DVec2, guidance: DVec2) -> Self {
        Self { cosine: axis.dot(guidance), sine: axis.perp_dot(guidance) }
    }

    fn angle(self) -> f64 {
        self.sine.atan2(self.cosine).abs()
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct MotionLaw {
    method: Method,
    /// A car follows (16) within the limit by either method, and cannot turn on the spot.
    is_car: bool,
    /// vd, m/s.
    pub speed: f64,
    pub turn: f64,
    look: f64,
    /// Cosines of the evidential law's angles: full speed within, turns on the spot beyond.
    full_speed: f64,
    pub turns: f64,
    pub keys: Controller,
    pub response: Response,
}

impl MotionLaw {
    pub fn new(mission: &Mission) -> Self {
        let hurry = mission.hurry();
        Self {
            method: mission.method,
            is_car: mission.body().steering.is_some(),
            speed: mission.speed_m_s(),
            turn: mission.turn_rad_s(),
            look: hurry.look_rad_s,
            full_speed: hurry.full_speed_within_deg.to_radians().cos(),
            turns: hurry.turns_beyond_deg.to_radians().cos(),
            keys: mission.controller.clone(),
            response: mission.trusted_response(),
        }
    }

    /// Returns the twist of a robot at `distance`, metres, from its target within `limit`, m/s;
    /// None to stand.
    ///
    /// Near the antipode the robot turns to its `side`, 1 left, -1 right, and holds it against
    /// noise.
    pub fn twist(
        &self,
        maneuver: Maneuver,
        alignment: Alignment,
        distance: f64,
        limit: f64,
        side: &mut f64,
    ) -> Option<Twist> {
        let least = LEAST_SPEED_M_S.min(self.speed);
        let slow = (distance / self.keys.slow_radius_m).min(1.0);
        match maneuver {
            Maneuver::Stand => None,
            Maneuver::Turn | Maneuver::Back if self.is_car => None,
            Maneuver::Turn => Some(self.on_the_spot(alignment, side)),
            // Backs straight. A non-circular body may lack room to turn, and an approaching
            // obstacle leaves no time.
            Maneuver::Back => {
                (limit > 0.0).then(|| Twist { v: -limit.min(self.speed), omega: 0.0 })
            }
            Maneuver::Follow if self.method == Method::Evidential && !self.is_car => {
                let sharp = (alignment.cosine - self.turns) / (self.full_speed - self.turns);
                if sharp > 0.0 && limit >= least {
                    let dead_s = self.response.dead_time_s();
                    let stops = self.response.speed_to_stop_within(distance, dead_s);
                    let v = (self.speed * sharp.min(1.0) * slow).min(stops).clamp(least, limit);
                    return Some(Twist { v, omega: self.angular(alignment, side) });
                }
                // Without speed the robot only turns; the planner allows speed where it must leave.
                let faces = alignment.cosine > FACES_COSINE;
                (!faces).then(|| self.on_the_spot(alignment, side))
            }
            Maneuver::Follow => {
                let omega = self.angular(alignment, side);
                let wanted = self.speed * self.aligned(alignment, omega) * slow;
                if !self.is_car {
                    return Some(Twist { v: wanted, omega });
                }
                let wanted = wanted.max(least);
                let v = wanted.min(limit);
                // A lower speed on the same curve.
                (limit >= least).then(|| Twist { v, omega: omega * v / wanted })
            }
        }
    }

    /// Keeps the side near the antipode.
    fn side(&self, Alignment { cosine, sine }: Alignment, side: &mut f64) -> f64 {
        if cosine > 0.0 {
            return sine.signum();
        }
        if sine.abs() >= self.keys.dead_zone {
            *side = if sine > 0.0 { 1.0 } else { -1.0 };
        }
        *side
    }

    /// Returns wc of (15), from which the base stops at the guidance.
    fn angular(&self, alignment: Alignment, side: &mut f64) -> f64 {
        let most = self.response.turn_to_stop_within(|| alignment.angle());
        let share = if alignment.cosine > 0.0 { alignment.sine.abs() } else { 1.0 };
        self.side(alignment, side) * (self.turn * share).min(most)
    }

    /// Returns the twist on the spot: no farther than the guidance, and fast enough for sticking
    /// wheels.
    fn on_the_spot(&self, alignment: Alignment, side: &mut f64) -> Twist {
        let angle = alignment.angle();
        let least = LEAST_TURN_RAD_S.min(self.look);
        let most = self.look.min(self.response.turn_to_stop_within(|| angle)).max(least);
        Twist { v: 0.0, omega: self.side(alignment, side) * (TURN_GAIN * angle).clamp(least, most) }
    }

    /// Returns the share of vd by (16). The slowdown at the target multiplies it; as a separate
    /// case, as printed, it would override it.
    fn aligned(&self, Alignment { cosine, .. }: Alignment, omega: f64) -> f64 {
        if !self.keys.modulated {
            1.0
        } else if cosine < 0.0 {
            f64::midpoint(cosine, 1.0)
        } else {
            1.0 - (omega / self.turn).abs() / 2.0
        }
    }
}
