//! Where two recordings part: the first tick in which a stage published something else, and what it had read by then.

use std::fmt;

use common::topics::{self, AnyTopic};
use recording::{Message, Recording, RecordingError};
use serde::Serialize;

use crate::values;

/// The topics of a tick, in the order in which one follows from the other.
static COMPARED: [&dyn AnyTopic; 6] = [
    &topics::RANGE,
    &topics::WHEELS,
    &topics::POSE,
    &topics::GRID,
    &topics::GUIDANCE,
    &topics::COMMAND,
];
/// What a process measures of itself, or how often it was replaced: no two runs have the same.
const OWN: [&str; 6] = [
    "stamp.generation",
    "stamp.sequence",
    "full_solve_ns",
    "local_update_ns",
    "full_solves",
    "local_updates",
];

/// Where two recordings part.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Parting {
    /// Lines of the run file that differ: mission, seed, clock. Where the robot answers and what it is called are left out.
    pub run: Vec<String>,
    /// The builds, where they differ.
    pub builds: Option<[String; 2]>,
    /// The first difference.
    pub first: Option<First>,
    /// Ticks that both have.
    pub ticks: u64,
}

/// The first difference.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct First {
    /// The tick.
    pub tick: u64,
    /// Its mission time, seconds.
    pub time_s: f64,
    /// The first of the topics of that tick that differs.
    pub topic: &'static str,
    /// Who wrote it.
    pub writer: &'static str,
    /// The first field that does.
    pub field: String,
    /// Its value in both.
    pub values: [String; 2],
}

/// Find where `first` and `second` part.
///
/// # Errors
/// When a file cannot be read.
pub fn diff(first: &Recording, second: &Recording) -> Result<Parting, RecordingError> {
    let mut parting = Parting {
        run: run_differences(first.run_text(), second.run_text()),
        ..Parting::default()
    };
    if first.build() != second.build() {
        parting.builds = Some([first, second].map(|recording| recording.build().to_owned()));
    }
    for topic in COMPARED {
        let (found, ticks) = first_in(topic, first, second)?;
        parting.ticks = parting.ticks.max(ticks);
        if let Some(found) = found
            && parting
                .first
                .as_ref()
                .is_none_or(|held| found.tick < held.tick)
        {
            parting.first = Some(found);
        }
    }
    Ok(parting)
}

fn run_differences(first: &str, second: &str) -> Vec<String> {
    let own = |line: &&str| {
        !["robot =", "address =", "epoch_ns ="]
            .iter()
            .any(|key| line.starts_with(key))
    };
    let (first, second): (Vec<_>, Vec<_>) = (
        first.lines().filter(own).collect(),
        second.lines().filter(own).collect(),
    );
    let only = |mark: &'static str, lines: &[&str], others: &[&str]| -> Vec<String> {
        let lines = lines.iter().filter(|line| !others.contains(line));
        lines.map(|line| format!("{mark} {line}")).collect()
    };
    let mut lines = only("-", &first, &second);
    lines.extend(only("+", &second, &first));
    lines
}

/// The last sample of each tick on one topic.
struct Ticks<I> {
    messages: I,
    /// Read already: of the next tick.
    next: Option<Message>,
    slices: bool,
}

impl<I: Iterator<Item = Result<Message, RecordingError>>> Ticks<I> {
    fn tick(&mut self) -> Result<Option<Message>, RecordingError> {
        let mut last = self.next.take();
        for message in self.messages.by_ref() {
            let message = message?;
            // The whole map, published again for new readers, may come in any tick.
            if self.slices && is_keyframe(&message) {
                continue;
            }
            match &last {
                Some(held) if tick_of(held) < tick_of(&message) => {
                    self.next = Some(message);
                    break;
                }
                // An earlier tick is given again.
                _ => last = Some(message),
            }
        }
        Ok(last)
    }
}

fn tick_of(message: &Message) -> u64 {
    number(message, 4)
}

fn number(message: &Message, at: usize) -> u64 {
    let bytes = message.data.get(at..).and_then(|rest| rest.first_chunk());
    bytes.map_or(0, |bytes| u64::from_le_bytes(*bytes))
}

/// `keyframe` of a grid's part: behind stamp, version and five numbers.
fn is_keyframe(message: &Message) -> bool {
    message.data.get(4 + 24 + 8 + 20) == Some(&1)
}

fn first_in(
    topic: &'static dyn AnyTopic,
    first: &Recording,
    second: &Recording,
) -> Result<(Option<First>, u64), RecordingError> {
    let ticks = |recording: &Recording| -> Result<_, RecordingError> {
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
        // A sample that a recorder lost says nothing.
        match tick_of(a).cmp(&tick_of(b)) {
            std::cmp::Ordering::Less => left = one.tick()?,
            std::cmp::Ordering::Greater => right = other.tick()?,
            std::cmp::Ordering::Equal => {
                both += 1;
                if let Some(found) = difference(topic, a, b) {
                    return Ok((Some(found), both));
                }
                (left, right) = (one.tick()?, other.tick()?);
            }
        }
    }
    Ok((None, both))
}

fn difference(topic: &'static dyn AnyTopic, a: &Message, b: &Message) -> Option<First> {
    // Behind the stamp's generation and sequence.
    if a.data.get(..20) == b.data.get(..20) && a.data.get(28..) == b.data.get(28..) {
        return None;
    }
    let own = |(field, _): &(String, String)| !OWN.iter().any(|own| field.ends_with(own));
    let one: Vec<_> = values::of(topic, &a.data).into_iter().filter(own).collect();
    let other: Vec<_> = values::of(topic, &b.data).into_iter().filter(own).collect();
    let differs = one.iter().zip(&other).find(|(one, other)| one != other);
    let (field, values) = match differs {
        Some(((field, one), (_, other))) => (field.clone(), [one.clone(), other.clone()]),
        None if one.len() == other.len() => return None,
        None => (
            "number of elements".to_owned(),
            [one.len(), other.len()].map(|count| count.to_string()),
        ),
    };
    Some(First {
        tick: tick_of(a),
        time_s: number(a, 12) as f64 * 1e-9,
        topic: topic.spec().name,
        writer: topic.spec().writer,
        field,
        values,
    })
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
            return writeln!(to, "equal in the {} ticks that both have", self.ticks);
        };
        let [one, other] = &first.values;
        writeln!(
            to,
            "they part at tick {}, {:.3} s: {} of {}, field {}\n  first  {one}\n  second {other}",
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
