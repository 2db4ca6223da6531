//! `cargo run --example log_pose -- x80` prints the poses of a robot through restarts of stages and
//! runs.
#![allow(clippy::print_stdout, reason = "a program for a terminal")]

use std::{env, time::Duration};

use firsthand_client::{
    domain::Domain,
    follower::{Event, Follower},
    topics,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let robot = env::args().nth(1).unwrap_or("x80".to_owned()).parse()?;
    let mut robot = Follower::new(Domain::of(robot), "log-pose", &topics::POSE, |bus| {
        bus.reader(&topics::POSE)
    });
    loop {
        match robot.wait(Duration::from_secs(1))? {
            Event::Connected => println!("the robot runs"),
            Event::Disconnected => println!("the robot has ended"),
            Event::Nothing => {}
            Event::Samples(poses) => {
                while let Some(pose) = poses.next_sample()? {
                    let seconds = pose.stamp.seconds();
                    println!("{seconds:.2} s ({:.3}, {:.3})", pose.x_m, pose.y_m);
                }
            }
        }
    }
}
