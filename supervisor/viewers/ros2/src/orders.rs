//! Threads that carry out requests without delaying publication. Targets wait for the supervisor
//! and stops for rest, in separate threads.

use std::{
    io,
    sync::mpsc::{Receiver, Sender, SyncSender, TrySendError, channel, sync_channel},
    thread,
    time::Instant,
};

use common::{
    domain::RobotName,
    samples::{DEAD_MAN, TargetPoint},
};
use glam::DVec2;
use mission_control::{
    Refused,
    operator::{self, OperatorError},
};
use ros2::{
    msg::{ComputePathToPoseResult, NavigateToPoseResult},
    participant::Request,
};

use crate::{action::Refusal, goals::Uuid};

const MOST_WAITING: usize = 16;

#[derive(Clone, Debug)]
pub enum Order {
    /// Go to a target. With `resumes`, first resume a robot that stands for a canceled goal.
    Go {
        to: TargetPoint,
        resumes: bool,
        why: Why,
    },
    /// Stand, for an operator or for a canceled goal.
    Stand {
        is_cancel: bool,
    },
    Resume,
    /// Set the pose, with deviations in metres and radians.
    Place(TargetPoint, [f64; 2]),
    /// Joystick deflection and its time.
    Hand(DVec2, Instant),
}

#[derive(Clone, Debug)]
pub enum Why {
    Topic,
    /// Action client. The goal's target follows the one numbered `after`.
    Action {
        request: Request,
        id: Uuid,
        after: u64,
    },
}

pub type Done = (Order, Result<(), Refusal>);

pub struct Orders {
    robot: RobotName,
    targets: SyncSender<Order>,
    stops: SyncSender<Order>,
    hands: SyncSender<Order>,
    done: Receiver<Done>,
    refused: Sender<Done>,
}

impl Orders {
    pub fn new(robot: &RobotName) -> io::Result<Self> {
        let (refused, done) = channel();
        let worker = |name: &str, most| {
            let (orders, waiting) = sync_channel::<Order>(most);
            let (robot, done) = (robot.clone(), refused.clone());
            thread::Builder::new().name(name.to_owned()).spawn(move || {
                for order in waiting {
                    let result = perform(&robot, &order).map_err(|error| refusal(&error));
                    if done.send((order, result)).is_err() {
                        break;
                    }
                }
            })?;
            Ok::<_, io::Error>(orders)
        };
        Ok(Self {
            robot: robot.clone(),
            targets: worker("targets", MOST_WAITING)?,
            stops: worker("stops", MOST_WAITING)?,
            hands: worker("hands", 1)?,
            done,
            refused,
        })
    }

    pub fn give(&self, order: Order) {
        // The order may queue behind an earlier stop until the robot is at rest.
        if let Order::Stand { .. } = order {
            operator::stop_at_once(&self.robot);
        }
        let worker = match order {
            Order::Go { .. } | Order::Place(..) => &self.targets,
            Order::Stand { .. } | Order::Resume => &self.stops,
            // The next deflection follows at once.
            Order::Hand(..) => return drop(self.hands.try_send(order)),
        };
        if let Err(TrySendError::Full(order) | TrySendError::Disconnected(order)) =
            worker.try_send(order)
        {
            let _ = self.refused.send((order, Err("too many orders wait already".into())));
        }
    }

    pub fn done(&self) -> Option<Done> {
        self.done.try_recv().ok()
    }
}

fn refusal(error: &OperatorError) -> Refusal {
    let code = match error {
        OperatorError::Refused(Refused { code: "target-outside", .. }) => {
            ComputePathToPoseResult::GOAL_OUTSIDE_MAP
        }
        OperatorError::Refused(Refused { code: "target-in-hazard", .. }) => {
            ComputePathToPoseResult::GOAL_OCCUPIED
        }
        _ => NavigateToPoseResult::UNKNOWN,
    };
    Refusal { code, text: error.to_string() }
}

fn perform(robot: &RobotName, order: &Order) -> Result<(), OperatorError> {
    match order {
        Order::Go { to, resumes, .. } => {
            if *resumes {
                operator::resume(robot)?;
            }
            match operator::send_to(robot, &[*to], false) {
                // A car goes there without a target heading.
                Err(OperatorError::Refused(Refused { code: "no-heading", .. })) => {
                    operator::send_to(robot, &[TargetPoint { has_heading: 0, ..*to }], false)
                }
                result => result,
            }
        }
        Order::Stand { .. } => operator::stand(robot).map(|_| ()),
        Order::Resume => operator::resume(robot),
        Order::Place(place, deviations) => operator::place(robot, *place, *deviations),
        Order::Hand(_, at) if at.elapsed() > DEAD_MAN => Ok(()),
        Order::Hand(stick, _) => operator::drive_by_hand(robot, *stick),
    }
}
