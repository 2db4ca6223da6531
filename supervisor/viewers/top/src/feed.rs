use std::time::{Duration, Instant};

use common::{
    bus::{AnyReader, Bus, BusError},
    process_usage::Processes,
};
use console::rates::TopicRates;
use processes::stages;
use robot_state::{Feed, Sample, TOPICS};

use super::view::View;

const COUNT_FOR: Duration = Duration::from_secs(1);

pub struct ScreenFeed {
    feed: Feed,
    outputs: Vec<Output>,
    processes: Processes,
    counted: Instant,
}

struct Output {
    stage: &'static str,
    reader: Box<dyn AnyReader>,
    rates: TopicRates,
}

impl ScreenFeed {
    pub fn open(bus: &Bus) -> Result<Self, BusError> {
        let now = Instant::now();
        let outputs = stages::TABLE
            .iter()
            .filter_map(|stage| Some((stage.name, *stage.wiring.outputs.first()?)))
            .map(|(stage, topic)| {
                Ok(Output {
                    stage,
                    reader: topic.any_reader(bus)?,
                    rates: TopicRates::new(topic.spec(), now),
                })
            });
        Ok(Self {
            feed: Feed::open(bus, TOPICS)?,
            outputs: outputs.collect::<Result<_, BusError>>()?,
            processes: Processes::default(),
            counted: now,
        })
    }

    pub fn update(&mut self, view: &mut View) -> Result<(), BusError> {
        let mut has_roster = false;
        self.feed.read(&mut |sample| {
            has_roster |= matches!(sample, Sample::Roster(..));
            view.apply(&sample);
        })?;
        if has_roster {
            view.usage = self.processes.look(&view.state.processes(), Instant::now());
        }
        let now = Instant::now();
        let due = now.saturating_duration_since(self.counted) >= COUNT_FOR;
        for Output { stage, reader, rates } in &mut self.outputs {
            while let Some((author, stamp)) = reader.next_stamp()? {
                rates.add(author, stamp, now);
            }
            if due {
                view.rates_hz.insert(*stage, rates.report(now).rate_hz);
            }
        }
        if due {
            self.counted = now;
        }
        Ok(())
    }
}
