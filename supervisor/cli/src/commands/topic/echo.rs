use clap::Args;
use common::{
    domain::RobotName,
    follower::{Event, Follower},
    topics::{self, AnyTopic},
};

use super::sample_text;
use console::{
    failure::{Refused, Result},
    stream::{LOOK_EVERY, Stream},
    waiting::Waiting,
};

/// Print the samples of a topic until Ctrl-C, across runs.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Topic (`firsthand topic list`).
    topic: String,
    /// Name of the robot.
    #[arg(long, default_value_t)]
    robot: RobotName,
    /// Print one JSON object per line, with all array elements.
    ///
    /// A number that is not finite is null.
    #[arg(long)]
    json: bool,
    /// Print all array elements in text, instead of the first 16.
    #[arg(long)]
    whole: bool,
    /// End after N samples.
    #[arg(short, long, value_name = "N")]
    number: Option<u64>,
}

pub fn main(arguments: &Arguments) -> Result {
    let topic = readable(&arguments.topic)?;
    let mut stream = Stream::open()?;
    let domain = arguments.robot.domain();
    // Topics that wake no reader are read when the link ends the tick.
    let mut follower =
        Follower::new(domain, "echo", &topics::LINK, |bus| topic.any_reader(bus)).also_on([topic]);
    let mut waiting = Waiting::default();
    let mut message = Vec::new();
    let mut left = arguments.number.unwrap_or(u64::MAX);
    while left > 0 && !stream.has_ended() {
        let event = follower.wait(LOOK_EVERY)?;
        waiting.tell(&event, &arguments.robot);
        let Event::Samples(samples) = event else { continue };
        while left > 0
            && !stream.has_ended()
            && samples.next_message(&mut message)?.is_some()
            && let Some((header, elements)) = topic.decoded(&message)
        {
            let fields = sample_text::fields(header, elements);
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
    topics::find(name).ok_or_else(|| {
        let names: Vec<_> = topics::TABLE.iter().map(|topic| topic.spec().name).collect();
        Refused::new(
            "unknown-topic",
            format!("there is no topic {name:?}; there are {}", names.join(", ")),
        )
        .into()
    })
}
