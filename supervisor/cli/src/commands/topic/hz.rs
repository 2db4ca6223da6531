use std::time::{Duration, Instant};

use clap::Args;
use common::{
    bus::{Bus, BusError},
    domain::RobotName,
    follower::{Event, Follower},
    topics,
};

use super::echo::readable;
use console::{
    failure::Result,
    output::json_lines,
    rates::{self, TopicRates},
    stream::{LOOK_EVERY, Stream},
    waiting::Waiting,
};

/// Print the rates of topics each second.
///
/// Also prints longest gaps and ages, and compares with the table of topics.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Print only this topic (`firsthand topic list`).
    topic: Option<String>,
    /// Name of the robot.
    #[arg(long, default_value_t)]
    robot: RobotName,
    /// Print one JSON object per line.
    #[arg(long)]
    json: bool,
    /// End after N seconds with the robot.
    #[arg(short, long, value_name = "N")]
    number: Option<u64>,
}

const REPORT_EVERY: Duration = Duration::from_secs(1);

pub fn main(arguments: &Arguments) -> Result {
    let topics = match &arguments.topic {
        Some(name) => vec![readable(name)?],
        None => topics::TABLE.to_vec(),
    };
    let mut stream = Stream::open()?;
    let domain = arguments.robot.domain();
    let open = |bus: &Bus| {
        let now = Instant::now();
        topics
            .iter()
            .map(|topic| {
                let rates = TopicRates::new(topic.spec(), now);
                Ok((topic.any_reader(bus)?, rates))
            })
            .collect::<Result<Vec<_>, BusError>>()
    };
    // Topics that wake no reader are read when the link ends the tick.
    let mut follower =
        Follower::new(domain, "hz", &topics::LINK, open).also_on(topics.iter().copied());
    let mut waiting = Waiting::default();
    let mut left = arguments.number.unwrap_or(u64::MAX);
    let mut due = None;
    while left > 0 && !stream.has_ended() {
        let event = follower.wait(LOOK_EVERY)?;
        waiting.tell(&event, &arguments.robot);
        match event {
            Event::Connected => due = Some(Instant::now() + REPORT_EVERY),
            Event::Disconnected => due = None,
            Event::Nothing => {}
            Event::Samples(readers) => {
                for (reader, rates) in readers {
                    while let Some((author, stamp)) = reader.next_stamp()? {
                        rates.add(author, stamp, Instant::now());
                    }
                }
            }
        }
        if due.is_some_and(|due| Instant::now() >= due)
            && let Some(readers) = follower.topics()
        {
            let now = Instant::now();
            let reports: Vec<_> = readers.iter_mut().map(|(_, rates)| rates.report(now)).collect();
            let table = || rates::table(&reports) + "\n";
            stream.write(&if arguments.json { json_lines(&reports)? } else { table() })?;
            due = Some(Instant::now() + REPORT_EVERY);
            left -= 1;
        }
    }
    Ok(())
}
