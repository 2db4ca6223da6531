//! Controller: aligns the robot with the guidance, which sets its speed.

mod car;

use common::{
    bus::Topic,
    clock::MissionTime,
    found_response::FoundResponse,
    geometry::wrap_angle,
    kinematics::{Drive, FACES_COSINE, LEAST_SPEED_M_S, TURN_GAIN, Twist},
    mission::{Lead, Method, Mission, Response},
    samples::{CommandSample, CommandState, GuidanceSample, GuidanceStatus},
    stage::{Answer, Answering, ForeignState},
    topics::{COMMAND, GUIDANCE},
};
use glam::DVec2;

/// Turn rate below which the wheels stick.
const LEAST_TURN_RAD_S: f64 = 0.25;

/// Largest distance of a robot that has arrived beside its target.
const MOST_OFF_TARGET_M: f64 = 0.5;

const FACES_WITHIN_RAD: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// Alignment (14), with the heading for the measured velocity, which has no direction at rest,
/// where every mission starts.
#[derive(Clone, Copy, Debug)]
pub struct Alignment {
    /// eta_d: cosine of the angle to the guidance.
    pub cosine: f64,
    /// eta_c: its sine, positive for guidance to the left. The printed sign turns away.
    pub sine: f64,
}

impl Alignment {
    pub fn of(axis: DVec2, guidance: DVec2) -> Self {
        Self { cosine: axis.dot(guidance), sine: axis.perp_dot(guidance) }
    }
}

#[derive(Clone, Copy, Debug)]
enum SpeedLaw {
    /// Law (16): the robot drives while it turns.
    Paper,
    /// Turns on the spot towards the guidance, then drives within its limit.
    Evidential,
    /// Law (16) within the limit for either method, as cars cannot turn on the spot.
    Car,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Arrival {
    #[default]
    OnTheWay,
    /// At the target, turning to its heading.
    Turning,
    Arrived,
}

#[derive(Debug)]
pub struct Controller {
    drive: Drive,
    speed: f64,
    turn: f64,
    look: f64,
    /// Cosines of the evidential method's angles: full speed within, turns on the spot beyond.
    full_speed: f64,
    turns: f64,
    law: SpeedLaw,
    response: Response,
    lead: Option<Lead>,
    /// Turn near the antipode: 1 left, -1 right.
    side: f64,
    /// Newest target's number, and progress.
    arrival: (u64, Arrival),
    /// Mission as stated, without a found response.
    mission: Mission,
    found: FoundResponse,
}

impl Answering for Controller {
    type In = GuidanceSample;
    type Out = CommandSample;
    type Further = FoundResponse;
    const NAME: &'static str = "controller";
    const INPUT: &'static Topic<GuidanceSample> = &GUIDANCE;
    const OUTPUT: &'static Topic<CommandSample> = &COMMAND;
    const NEWEST_ONLY: bool = true;
    /// None survives the process. A robot at its target has arrived for the next controller too, or
    /// drives the last centimetre again. Unanswered commands are forgotten.
    type State = ();

    fn new(mission: &Mission) -> Self {
        let body = mission.body();
        let hurry = mission.hurry();
        Self {
            drive: body.drive(),
            speed: mission.speed_m_s(),
            turn: mission.turn_rad_s(),
            look: hurry.look_rad_s,
            full_speed: hurry.full_speed_within_deg.to_radians().cos(),
            turns: hurry.turns_beyond_deg.to_radians().cos(),
            law: match mission.method {
                _ if body.steering.is_some() => SpeedLaw::Car,
                Method::Paper => SpeedLaw::Paper,
                Method::Evidential => SpeedLaw::Evidential,
            },
            response: mission.trusted_response(),
            lead: Lead::new(mission),
            side: 1.0,
            arrival: Default::default(),
            mission: mission.clone(),
            found: FoundResponse::default(),
        }
    }

    fn state(&self) -> &() {
        &()
    }

    fn restore(&mut self, (): ()) -> Result<(), ForeignState> {
        Ok(())
    }

    fn answer(
        &mut self,
        guidance: &GuidanceSample,
        found: &FoundResponse,
        _: MissionTime,
    ) -> Answer<CommandSample> {
        if let Some(mission) = self.found.changed(found, &self.mission) {
            // Drops unanswered commands: the base stood while its response was found.
            let Self { side, arrival, found, .. } = *self;
            let stated = std::mem::take(&mut self.mission);
            *self = Self { side, arrival, mission: stated, found, ..Answering::new(&mission) };
        }
        self.command(guidance).into()
    }
}

impl Controller {
    pub fn command(&mut self, guidance: &GuidanceSample) -> CommandSample {
        let pose = guidance.pose();
        let distance = pose.position.distance(guidance.target.position());
        let command = CommandSample {
            distance_m: distance,
            pose_ns: guidance.pose_ns,
            guidance_ns: guidance.stamp.stamp_ns,
            target_number: guidance.target_number,
            ..CommandSample::default()
        };
        let (status, direction) =
            match (self.arrival(guidance, distance), guidance.target.heading()) {
                (Arrival::Arrived, _) => {
                    return CommandSample { state: CommandState::Arrived.into(), ..command };
                }
                (Arrival::Turning, Some(heading)) if self.may_turn(guidance, distance) => {
                    (GuidanceStatus::Look, DVec2::from_angle(heading))
                }
                _ => {
                    let direction = DVec2::new(guidance.ex, guidance.ey);
                    (guidance.status(), direction)
                }
            };
        // Samples may hold anything; only unit vectors are followed.
        let unit = (direction.length() - 1.0).abs() < 1e-3;
        let is_sent = guidance.target_number != 0;
        let sane = is_sent && unit && distance.is_finite() && pose.heading.is_finite();
        let time_s = MissionTime(guidance.pose_ns).seconds();
        let acts_at = match &mut self.lead {
            Some(lead) if sane => lead.foresee(pose, time_s).0,
            _ => pose,
        };
        let alignment = Alignment::of(acts_at.axis(), direction);
        let twist = if sane {
            self.motion(status, alignment, distance, guidance.speed_limit_m_s)
        } else {
            None
        };
        if let Some(lead) = &mut self.lead {
            lead.command(twist.unwrap_or_default(), time_s);
        }
        let Some(twist) = twist else {
            return CommandSample { state: CommandState::Halt.into(), ..command };
        };
        let [left_rad_s, right_rad_s] = self.drive.inputs(twist);
        CommandSample {
            left_rad_s,
            right_rad_s,
            v_m_s: twist.v,
            omega_rad_s: twist.omega,
            state: CommandState::Driving.into(),
            ..command
        }
    }

    /// Advances the progress, which never reverts: a robot at rest on the circle's edge stays for
    /// one count. Beside a target in a hazard it has arrived too, if the planner sees no nearer
    /// place.
    fn arrival(&mut self, guidance: &GuidanceSample, distance: f64) -> Arrival {
        let number = guidance.target_number;
        if self.arrival.0 != number {
            self.arrival = (number, Arrival::OnTheWay);
        }
        let is_there = self.is_there(guidance, distance);
        let arrival = &mut self.arrival.1;
        if *arrival == Arrival::OnTheWay && is_there && number != 0 {
            *arrival = Arrival::Turning;
        }
        let faces = guidance.target.heading().is_none_or(|heading| {
            wrap_angle(heading - guidance.heading_rad).abs() <= FACES_WITHIN_RAD
        });
        if *arrival == Arrival::Turning && faces {
            *arrival = Arrival::Arrived;
        }
        *arrival
    }

    fn is_there(&self, guidance: &GuidanceSample, distance: f64) -> bool {
        let beside = guidance.status() == GuidanceStatus::AtTarget;
        distance <= self.mission.arrival_tolerance_m || beside && distance <= MOST_OFF_TARGET_M
    }

    /// Returns whether the robot may turn to the wanted heading. Non-circular bodies need a numeric
    /// limit, by which the planner shows room.
    fn may_turn(&self, guidance: &GuidanceSample, distance: f64) -> bool {
        let waits = guidance.status() == GuidanceStatus::Waiting;
        let allows = !waits && !guidance.speed_limit_m_s.is_nan();
        self.mission.outline().is_none() || allows && self.is_there(guidance, distance)
    }

    /// Returns None to stand.
    fn motion(
        &mut self,
        status: GuidanceStatus,
        alignment: Alignment,
        distance: f64,
        limit: f64,
    ) -> Option<Twist> {
        let on_the_spot =
            |controller: &mut Self| Twist { v: 0.0, omega: controller.turn_to(alignment) };
        match (status, self.law) {
            (_, SpeedLaw::Car) => self.car_motion(status, alignment, distance, limit),
            // The paper's method gives no direction to an unreachable target.
            (GuidanceStatus::Look, _) | (GuidanceStatus::Unreachable, SpeedLaw::Evidential) => {
                Some(on_the_spot(self))
            }
            (GuidanceStatus::Along | GuidanceStatus::WayOut, SpeedLaw::Paper) => {
                let omega = self.angular(alignment);
                let v = self.tangential(alignment, omega, distance);
                Some(Twist { v, omega })
            }
            // Backs straight. A non-circular body may lack room to turn, and an approaching
            // obstacle leaves no time.
            (GuidanceStatus::Along | GuidanceStatus::WayOut, SpeedLaw::Evidential)
                if limit < 0.0 =>
            {
                Some(Twist { v: limit.max(-self.speed), omega: 0.0 })
            }
            (GuidanceStatus::Along | GuidanceStatus::WayOut, SpeedLaw::Evidential) => {
                let v = self.cautious(alignment, distance, limit);
                if v == 0.0 {
                    // Without a limit above 0 the robot only turns; the planner allows speed where
                    // it must leave.
                    let faces = alignment.cosine > FACES_COSINE;
                    return (!faces).then(|| on_the_spot(self));
                }
                let omega = self.angular(alignment);
                Some(Twist { v, omega })
            }
            _ => None,
        }
    }

    /// Returns wc of (15). Near the antipode it holds its side against noise.
    fn angular(&mut self, alignment: Alignment) -> f64 {
        let Alignment { cosine, sine } = alignment;
        let most = self.response.turn_to_stop_within(sine.atan2(cosine).abs());
        if cosine > 0.0 {
            return (self.turn * sine).clamp(-most, most);
        }
        if sine.abs() >= self.mission.controller.dead_zone {
            self.side = if sine > 0.0 { 1.0 } else { -1.0 };
        }
        self.turn.min(most) * self.side
    }

    /// Returns the evidential wc on the spot: no farther than the guidance, and fast enough for
    /// sticking wheels.
    fn turn_to(&mut self, alignment: Alignment) -> f64 {
        let angle = alignment.sine.atan2(alignment.cosine).abs();
        let side = self.angular(alignment).signum();
        let least = LEAST_TURN_RAD_S.min(self.look);
        let most = self.look.min(self.response.turn_to_stop_within(angle)).max(least);
        side * (TURN_GAIN * angle).clamp(least, most)
    }

    /// Returns the evidential vc: 0 until nearly aligned, at most `limit`, and fast enough for
    /// sticking wheels.
    fn cautious(&self, alignment: Alignment, distance: f64, limit: f64) -> f64 {
        let sharp = ((alignment.cosine - self.turns) / (self.full_speed - self.turns)).min(1.0);
        let slow = self.slow_near_target(distance);
        let stops = self.response.speed_to_stop_within(distance, self.response.dead_time_s());
        let wanted = (self.speed * sharp.max(0.0) * slow).min(stops);
        let least = LEAST_SPEED_M_S.min(self.speed);
        // A NaN limit means stand.
        if sharp <= 0.0 {
            0.0
        } else if limit >= least {
            wanted.clamp(least, limit)
        } else {
            0.0
        }
    }

    /// Returns vc of (16). The slowdown at the target multiplies the aligned speed; as a separate
    /// case, as printed, it would override it.
    fn tangential(&self, alignment: Alignment, omega: f64, distance: f64) -> f64 {
        let aligned = if !self.mission.controller.modulated {
            1.0
        } else if alignment.cosine < 0.0 {
            f64::midpoint(alignment.cosine, 1.0)
        } else {
            1.0 - (omega / self.turn).abs() / 2.0
        };
        self.speed * aligned * self.slow_near_target(distance)
    }

    /// Returns the share of the speed at this distance from the target.
    fn slow_near_target(&self, distance: f64) -> f64 {
        (distance / self.mission.controller.slow_radius_m).min(1.0)
    }
}

#[cfg(test)]
mod tests;
