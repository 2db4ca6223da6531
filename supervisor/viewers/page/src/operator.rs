//! The subcommands of an operator, for the page.

use common::{domain::RobotName, samples::TargetPoint};
use glam::DVec2;
use mission_control::operator;
use rustix::process::Signal;

use crate::orders::Operator;

pub struct RobotOperator {
    pub robot: RobotName,
}

/// The confirmation, or the reason why the request was not carried out.
fn told(done: Result<(), impl ToString>, confirmed: &str) -> Result<String, String> {
    done.map(|()| confirmed.to_owned()).map_err(|error| error.to_string())
}

impl Operator for RobotOperator {
    fn stop(&self) -> Result<String, String> {
        match operator::stand(&self.robot) {
            Ok(None) => Ok("the robot rests".to_owned()),
            Ok(Some(why)) => Ok(format!("the robot rests; its supervisor was not told: {why}")),
            Err(error) => Err(error.to_string()),
        }
    }

    fn resume(&self) -> Result<String, String> {
        told(operator::resume(&self.robot), "the supervisor lets the robot go on")
    }

    fn restart(&self, stage: &str) -> Result<String, String> {
        let stage = console::operator::known(stage).map_err(|error| error.to_string())?;
        let done = operator::restart(&self.robot, stage);
        told(done, "the supervisor starts a new generation")
    }

    fn kill(&self, stage: &str) -> Result<String, String> {
        let done = console::operator::known(stage)
            .and_then(|stage| console::operator::send(&self.robot, stage, Signal::KILL));
        told(done, "the process is killed")
    }

    fn go_to(&self, targets: &[[f64; 2]]) -> Result<String, String> {
        let points: Vec<_> =
            targets.iter().map(|&place| TargetPoint::at(DVec2::from(place))).collect();
        let done = operator::send_to(&self.robot, &points, false);
        told(done, "the supervisor sends the robot there")
    }

    fn hand(&self, stick: [f64; 2]) -> Result<String, String> {
        told(operator::drive_by_hand(&self.robot, stick.into()), "")
    }

    fn go_back(&self) -> Result<String, String> {
        told(operator::send_back(&self.robot), "the supervisor sends the robot there")
    }
}
