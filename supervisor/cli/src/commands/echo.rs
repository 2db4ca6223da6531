//! `firsthand echo`: the samples of a topic, as they come.

use std::process::ExitCode;

use clap::Args;
use common::{
    bus::ReadableTopic,
    domain::{Domain, RobotName},
    follower::{Event, Follower},
    topics::{self, AnyTopic},
};
use console::sample_text;

use super::{
    Failure,
    error_code::Refused,
    stream::{LOOK_EVERY, Stream},
};
use crate::progress_line::write_stderr;

/// Print the samples of a topic as they come, from run to run of the robot, until Ctrl-C.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// The topic (`firsthand topics`).
    topic: String,
    /// Name of the robot.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// One JSON object a line, with all elements of arrays; a number that is not finite is null.
    #[arg(long)]
    json: bool,
    /// As text, show all elements of arrays, and not the first 16 only.
    #[arg(long)]
    whole: bool,
    /// End after N samples.
    #[arg(short, long, value_name = "N")]
    number: Option<u64>,
}

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let topic = readable(&arguments.topic)?;
    let mut stream = Stream::open()?;
    let domain = Domain::of(arguments.robot.clone());
    // What wakes nobody is there when the tick ends.
    let mut follower = Follower::new(domain, "echo", topic, |bus| topic.any_reader(bus))
        .also_on([&topics::LINK as &'static dyn AnyTopic]);
    let mut waiting = Waiting::default();
    let mut left = arguments.number.unwrap_or(u64::MAX);
    while left > 0 && !stream.has_ended() {
        match follower.wait(LOOK_EVERY)? {
            Event::Connected => waiting.on_connected(),
            Event::Disconnected => waiting.on_disconnected(&arguments.robot),
            Event::Nothing => waiting.nothing(&arguments.robot),
            Event::Samples(samples) => {
                while left > 0
                    && !stream.has_ended()
                    && let Some(sample) = samples.take()?
                {
                    let text = if arguments.json {
                        sample_text::json(&*sample)? + "\n"
                    } else {
                        sample_text::text(&*sample, arguments.whole) + "---\n"
                    };
                    // Its writer may need the place while a slow reader takes the text.
                    drop(sample);
                    stream.write(&text)?;
                    left -= 1;
                }
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// A topic of the table.
pub(super) fn readable(name: &str) -> Result<&'static dyn ReadableTopic, Failure> {
    let mut all = topics::READABLE.iter();
    all.find(|topic| topic.spec().name == name)
        .copied()
        .ok_or_else(|| {
            let names: Vec<_> = topics::TABLE
                .iter()
                .map(|topic| topic.spec().name)
                .collect();
            let message = format!("there is no topic {name:?}; there are {}", names.join(", "));
            Refused::new("unknown-topic", message).into()
        })
}

/// Says on standard error that a robot is waited for, once each time.
#[derive(Default)]
pub(super) struct Waiting {
    here: bool,
    said: bool,
}

impl Waiting {
    /// The robot is there.
    pub(super) const fn on_connected(&mut self) {
        (self.here, self.said) = (true, false);
    }

    /// Its run has ended.
    pub(super) fn on_disconnected(&mut self, robot: &RobotName) {
        self.here = false;
        self.say(robot, "has ended its run");
    }

    /// Nothing came.
    pub(super) fn nothing(&mut self, robot: &RobotName) {
        if !self.here {
            self.say(robot, "is not running here");
        }
    }

    fn say(&mut self, robot: &RobotName, what: &str) {
        if !std::mem::replace(&mut self.said, true) {
            write_stderr(&format!(
                "firsthand: robot {robot} {what}; waiting for it\n"
            ));
        }
    }
}
