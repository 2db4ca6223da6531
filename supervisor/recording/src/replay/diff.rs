//! First tick in which a stage published different values in two recordings, and its inputs so far.

use std::fmt;

use common::topics::AnyTopic;
use serde::Serialize;

use crate::{
    Message, Recording, Result,
    replay::samples::{COMPARED, First, difference, is_keyframe, tick_of},
};

#[derive(Debug, Default, Serialize)]
pub struct Parting {
    /// Differing lines of the run file: mission, seed, clock, without the robot's name and address.
    pub run: Vec<String>,
    pub builds: Option<[String; 2]>,
    pub first: Option<First>,
    /// Ticks present in both recordings.
    pub ticks: u64,
}

pub fn diff(first: &Recording, second: &Recording) -> Result<Parting> {
    let mut parting =
        Parting { run: run_differences(&first.run_text, &second.run_text), ..Parting::default() };
    if first.build != second.build {
        parting.builds = Some([first, second].map(|recording| recording.build.clone()));
    }
    for topic in COMPARED {
        let (found, ticks) = first_in(topic, first, second)?;
        parting.ticks = parting.ticks.max(ticks);
        if let Some(found) = found
            && parting.first.as_ref().is_none_or(|held| found.tick < held.tick)
        {
            parting.first = Some(found);
        }
    }
    Ok(parting)
}

fn run_differences(first: &str, second: &str) -> Vec<String> {
    let own = |line: &&str| {
        !["robot =", "address =", "epoch_ns ="].iter().any(|key| line.starts_with(key))
    };
    let (first, second): (Vec<_>, Vec<_>) =
        (first.lines().filter(own).collect(), second.lines().filter(own).collect());
    let only = |mark: &'static str, lines: &[&str], others: &[&str]| -> Vec<String> {
        lines
            .iter()
            .filter(|line| !others.contains(line))
            .map(|line| format!("{mark} {line}"))
            .collect()
    };
    let mut lines = only("-", &first, &second);
    lines.extend(only("+", &second, &first));
    lines
}

struct Ticks<I> {
    messages: I,
    /// Sample of the next tick, already read.
    next: Option<Message>,
    slices: bool,
}

impl<I: Iterator<Item = Result<Message>>> Ticks<I> {
    fn tick(&mut self) -> Result<Option<Message>> {
        let mut last = self.next.take();
        for message in self.messages.by_ref() {
            let message = message?;
            // A keyframe for new readers may come in any tick.
            if self.slices && is_keyframe(&message.data) {
                continue;
            }
            match &last {
                Some(held) if tick_of(&held.data) < tick_of(&message.data) => {
                    self.next = Some(message);
                    break;
                }
                // An earlier tick was published again.
                _ => last = Some(message),
            }
        }
        Ok(last)
    }
}

fn first_in(
    topic: &'static dyn AnyTopic,
    first: &Recording,
    second: &Recording,
) -> Result<(Option<First>, u64)> {
    let ticks = |recording: &Recording| -> Result<_> {
        Ok(Ticks {
            messages: recording.messages(&[topic.spec().name])?,
            next: None,
            slices: topic.layout().1.is_some(),
        })
    };
    let (mut one, mut other) = (ticks(first)?, ticks(second)?);
    let (mut left, mut right) = (one.tick()?, other.tick()?);
    let mut both = 0;
    while let (Some(a), Some(b)) = (&left, &right) {
        match tick_of(&a.data).cmp(&tick_of(&b.data)) {
            std::cmp::Ordering::Less => left = one.tick()?,
            std::cmp::Ordering::Greater => right = other.tick()?,
            std::cmp::Ordering::Equal => {
                both += 1;
                if let Some(found) = difference(topic, &a.data, &b.data) {
                    return Ok((Some(found), both));
                }
                (left, right) = (one.tick()?, other.tick()?);
            }
        }
    }
    Ok((None, both))
}

impl fmt::Display for Parting {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        for line in &self.run {
            writeln!(to, "run: {line}")?;
        }
        if let Some([first, second]) = &self.builds {
            writeln!(to, "builds: {first}; {second}")?;
        }
        let Some(first) = &self.first else {
            return writeln!(to, "equal in all {} common ticks", self.ticks);
        };
        let [one, other] = &first.values;
        writeln!(
            to,
            "they differ first at tick {}, {:.3} s: {} of {}, field {}\n  first  {one}\n  second {other}",
            first.tick, first.time_s, first.topic, first.writer, first.field
        )?;
        let before: Vec<_> = COMPARED
            .iter()
            .map(|topic| topic.spec().name)
            .take_while(|topic| *topic != first.topic)
            .collect();
        if before.is_empty() {
            writeln!(to, "the robot's sensors differ first")
        } else {
            writeln!(to, "equal in that tick: {}", before.join(", "))
        }
    }
}
