//! Controller: aligns the robot with the guidance, which sets its speed.

use common::{
    bus::Topic,
    clock::MissionTime,
    found_response::FoundResponse,
    geometry::wrap_angle,
    kinematics::Drive,
    mission::{Lead, Mission},
    motion_law::{Alignment, MotionLaw},
    samples::{CommandSample, CommandState, GuidanceSample, GuidanceStatus},
    stage::{Answer, Answering, ForeignState},
    target::Reached,
    topics::{COMMAND, GUIDANCE},
};
use glam::DVec2;

/// Largest distance of a robot that has arrived beside its target.
const MOST_OFF_TARGET_M: f64 = 0.5;

const FACES_WITHIN_RAD: f64 = 5.0 * std::f64::consts::PI / 180.0;

#[derive(Debug)]
pub struct Controller {
    drive: Drive,
    law: MotionLaw,
    lead: Option<Lead>,
    /// Turn near the antipode: 1 left, -1 right.
    side: f64,
    reached: Reached,
    /// Number of the target at which it has arrived, facing the heading; 0 for none.
    arrived: u64,
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
        Self {
            drive: mission.body().drive(),
            law: MotionLaw::new(mission),
            lead: Lead::new(mission),
            side: 1.0,
            reached: Reached::default(),
            arrived: 0,
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
            let Self { side, reached, arrived, found, .. } = *self;
            let stated = std::mem::take(&mut self.mission);
            *self =
                Self { side, reached, arrived, mission: stated, found, ..Answering::new(&mission) };
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
        if self.has_arrived(guidance, distance) {
            return CommandSample { state: CommandState::Arrived.into(), ..command };
        }
        let direction = DVec2::new(guidance.ex, guidance.ey);
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
        let limit = guidance.speed_limit_m_s;
        let twist = if sane {
            self.law.twist(guidance.maneuver(), alignment, distance, limit, &mut self.side)
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

    /// Once arrived, the robot stays so as long as the target is reached, whatever its heading.
    fn has_arrived(&mut self, guidance: &GuidanceSample, distance: f64) -> bool {
        let number = guidance.target_number;
        let beside = guidance.status() == GuidanceStatus::AtTarget && distance <= MOST_OFF_TARGET_M;
        let is_there = self.reached.is(number, distance, self.mission.arrival_tolerance_m, beside);
        let faces = guidance.target.heading().is_none_or(|heading| {
            wrap_angle(heading - guidance.heading_rad).abs() <= FACES_WITHIN_RAD
        });
        let has_arrived = is_there && (faces || self.arrived == number);
        self.arrived = if has_arrived { number } else { 0 };
        has_arrived
    }
}

#[cfg(test)]
mod tests;
