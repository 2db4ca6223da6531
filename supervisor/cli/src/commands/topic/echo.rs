use clap::Args;
use common::{
    domain::{Domain, RobotName},
    follower::{Event, Follower},
    topics::{self, AnyTopic},
};

use super::sample_text;
use console::{
    failure::{Refused, Result},
    stream::{LOOK_EVERY, Stream},
    waiting::Waiting,
};

/// Print the samples of a topic as they come, from run to run of the robot, until Ctrl-C.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The topic (`firsthand topic list`).
    topic: String,
    /// Name of the robot.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// One JSON object a line, with all elements of arrays; a number that is not finite is null.
    #[arg(long)]
    json: bool,
    /// Show all elements of arrays in text, not only the first 16.
    #[arg(long)]
    whole: bool,
    /// End after N samples.
    #[arg(short, long, value_name = "N")]
    number: Option<u64>,
}

pub fn main(arguments: &Arguments) -> Result {
    let topic = readable(&arguments.topic)?;
    let mut stream = Stream::open()?;
    let domain = Domain::of(arguments.robot.clone());
    // Some topics wake no reader. Their samples are read when the link ends the tick.
    let mut follower = Follower::new(domain, "echo", topic, |bus| topic.any_reader(bus))
        .also_on([&topics::LINK as &'static dyn AnyTopic]);
    let mut waiting = Waiting::default();
    let mut left = arguments.number.unwrap_or(u64::MAX);
    while left > 0 && !stream.has_ended() {
        let event = follower.wait(LOOK_EVERY)?;
        waiting.tell(&event, &arguments.robot);
        let Event::Samples(samples) = event else { continue };
        while left > 0
            && !stream.has_ended()
            && let Some(sample) = samples.next_sample()?
        {
            let fields = sample_text::fields(sample.value(), sample.elements());
            // The writer may need the sample's place while a slow reader takes the text.
            drop(sample);
            let text = if arguments.json {
                sample_text::json(fields)? + "\n"
            } else {
                sample_text::text(&fields, arguments.whole) + "---\n"
            };
            stream.write(&text)?;
            left -= 1;
        }
    }
    Ok(())
}

pub fn readable(name: &str) -> Result<&'static dyn AnyTopic> {
    let mut all = topics::TABLE.iter();
    all.find(|topic| topic.spec().name == name).copied().ok_or_else(|| {
        let names: Vec<_> = topics::TABLE.iter().map(|topic| topic.spec().name).collect();
        let message = format!("there is no topic {name:?}; there are {}", names.join(", "));
        Refused::new("unknown-topic", message).into()
    })
}
