use common::{domain::RobotName, samples::TargetPoint};
use console::{
    failure::Result,
    operator::{known, send},
};
use glam::DVec2;
use mission_control::operator;
use rustix::process::Signal;

use crate::orders::Order;

const IS_SENT: &str = "the supervisor sends the robot there";

pub fn perform(robot: &RobotName, order: &Order) -> Result<String, String> {
    confirmed(robot, order).map_err(|error| error.to_string())
}

fn confirmed(robot: &RobotName, order: &Order) -> Result<String> {
    let confirmation = match order {
        Order::Stop => match operator::stand(robot)? {
            None => "the robot rests",
            Some(why) => {
                return Ok(format!(
                    "the robot rests, but the order did not reach its supervisor: {why}"
                ));
            }
        },
        Order::Resume => {
            operator::resume(robot)?;
            "the supervisor lets the robot continue"
        }
        Order::Restart { stage } => {
            operator::restart(robot, known(stage)?)?;
            "the supervisor starts a new generation"
        }
        Order::Kill { stage } => {
            send(robot, known(stage)?, Signal::KILL)?;
            "the process is killed"
        }
        Order::GoTo { targets } => {
            let points = targets.iter().map(|&place| TargetPoint::at(DVec2::from(place)));
            operator::send_to(robot, &points.collect::<Vec<_>>(), false)?;
            IS_SENT
        }
        Order::GoBack => {
            operator::send_back(robot)?;
            IS_SENT
        }
        Order::Hand { ahead, left } => {
            operator::drive_by_hand(robot, DVec2::new(*ahead, *left))?;
            ""
        }
        Order::Preview { .. } => "",
    };
    Ok(confirmation.to_owned())
}
