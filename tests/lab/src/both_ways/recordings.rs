//! Comparison of two recordings of a mission, topic by topic, to the byte.

use std::{
    collections::{BTreeMap, HashSet},
    hash::{DefaultHasher, Hash as _, Hasher as _},
};

use common::{
    bus::{Stamp, decode_slice},
    grid::{Part, Replica},
    samples::GridHeader,
    topics::{self, AnyTopic},
};
use recording::{Recording, RecordingError, replay::first_difference};

type Result<T> = std::result::Result<T, RecordingError>;

/// Places in a sample, after the encoding's header: its tick, its number, and what follows its
/// stamp.
const TICK: usize = 4;
const SEQUENCE: std::ops::Range<usize> = 24..28;
const VALUE: usize = 28;

enum Compared {
    /// Samples of each tick in order, without these fields. The sequence number is left out, and a
    /// repeated sample counts once: the link gives a tick again that is unanswered for 100 ms.
    Samples(&'static [&'static str]),
    /// Cells after each tick. Keyframes come also when a new reader has connected.
    Map,
    /// Values in order without stamps: the supervisor restates them by the wall clock.
    Values,
    Not,
}

/// A new topic is compared to the byte.
fn compared(topic: &dyn AnyTopic) -> Compared {
    match topic.spec().name {
        "grid" => Compared::Map,
        "guidance" => Compared::Samples(&["full_solve_ns"]),
        "target" | "following" | "zones" | "place" | "directive" | "complaints" => Compared::Values,
        // Requests, deaths and the roster have process numbers and times of their own.
        "orders" | "deaths" | "roster"
        // The wall clock decides heartbeats, latencies and pings.
        | "health" | "link" | "wire" | "inputs"
        // It says how far the supervisor has read.
        | "tick_limit"
        // The newest frame, once the link has nothing else to do. No stage reads it.
        | "infrared" | "power" | "surroundings"
        // A run does not record them, or no process of the robot publishes them.
        | "field" | "requests" | "faults" | "mirror" => Compared::Not,
        _ => Compared::Samples(&[]),
    }
}

/// By topic.
type Samples = BTreeMap<String, Vec<Vec<u8>>>;

/// Returns the first difference of two recordings in the first `ticks` ticks, in the order of the
/// topics' table.
pub fn difference(both: [&Recording; 2], ticks: u64) -> Result<Option<String>> {
    for recording in both {
        if let Some(gap) = recording.gaps().into_iter().next() {
            return Ok(Some(gap));
        }
    }
    let [one, many] = [samples(both[0])?, samples(both[1])?];
    Ok(topics::TABLE.iter().find_map(|topic| {
        let name = topic.spec().name;
        let both = [&one, &many].map(|it| it.get(name).map_or(&[][..], Vec::as_slice));
        let found = match compared(*topic) {
            Compared::Samples(left_out) => {
                let both = both.map(|it| of_ticks(it, ticks));
                unequal(*topic, &both, left_out)
            }
            Compared::Values => unequal(*topic, &both.map(values), &["stamp"]),
            Compared::Map => first_unequal(&both.map(|it| maps(it, ticks)))
                .map(|at| format!("another map in the {at}. tick with one")),
            Compared::Not => None,
        };
        found.map(|found| format!("{name}, {found}"))
    }))
}

fn samples(recording: &Recording) -> Result<Samples> {
    let mut samples = Samples::new();
    for message in recording.messages(&[])? {
        let message = message?;
        samples.entry(message.topic.to_string()).or_default().push(message.data);
    }
    Ok(samples)
}

fn tick_of(sample: &[u8]) -> u64 {
    let tick = sample.get(TICK..).and_then(|rest| rest.first_chunk());
    tick.map_or(0, |tick| u64::from_le_bytes(*tick))
}

/// Returns the samples of the first ticks, each once, without their numbers.
fn of_ticks(samples: &[Vec<u8>], ticks: u64) -> Vec<Vec<u8>> {
    let mut known = HashSet::new();
    let unnumbered = samples.iter().filter(|sample| tick_of(sample) < ticks).map(|sample| {
        let mut sample = sample.clone();
        if let Some(number) = sample.get_mut(SEQUENCE) {
            number.fill(0);
        }
        sample
    });
    unnumbered.filter(|sample| known.insert(sample.clone())).collect()
}

/// Returns the samples whose value differs from the one before, with empty stamps.
fn values(samples: &[Vec<u8>]) -> Vec<Vec<u8>> {
    let mut values: Vec<Vec<u8>> = samples.to_vec();
    for value in &mut values {
        if let Some(stamp) = value.get_mut(TICK..VALUE) {
            stamp.fill(0);
        }
    }
    values.dedup();
    values
}

/// Returns each tick with its map: its header, and a hash of its cells.
fn maps(samples: &[Vec<u8>], ticks: u64) -> Vec<(u64, String, u64)> {
    let mut maps = BTreeMap::new();
    let mut replica = Replica::default();
    for sample in samples {
        let Some((mut header, cells)) = decode_slice::<GridHeader, u8>(sample) else { continue };
        replica.apply(&header.part, &cells);
        let tick = header.stamp.tick;
        let mut hasher = DefaultHasher::new();
        (replica.version(), replica.cells()).hash(&mut hasher);
        (header.stamp, header.part) = (Stamp::default(), Part::default());
        maps.insert(tick, (tick, format!("{header:?}"), hasher.finish()));
    }
    maps.into_values().filter(|(tick, ..)| *tick < ticks).collect()
}

fn first_unequal<T: PartialEq>([one, many]: &[Vec<T>; 2]) -> Option<usize> {
    (0..one.len().max(many.len())).find(|&at| one.get(at) != many.get(at))
}

/// Returns the first difference of two lists of samples, apart from the fields in `left_out`.
fn unequal(topic: &dyn AnyTopic, both: &[Vec<Vec<u8>>; 2], left_out: &[&str]) -> Option<String> {
    let mut pairs = both[0].iter().zip(&both[1]).filter(|(one, many)| one != many);
    let found = pairs.find_map(|(one, many)| {
        let (field, [in_one, in_many]) = first_difference(topic, [one, many], left_out)?;
        Some(format!("tick {}, {field}: {in_one} and {in_many}", tick_of(one)))
    });
    let [one, many] = both.each_ref().map(Vec::len);
    found.or_else(|| (one != many).then(|| format!("{one} samples and {many}")))
}

#[cfg(test)]
mod tests {
    use common::{
        bus::{encode_sample, encode_slice},
        grid::GridFrame,
        samples::PoseSample,
    };

    use super::*;

    fn pose(tick: u64, sequence: u32, x_m: f64) -> Vec<u8> {
        let stamp = Stamp { tick, sequence, ..Stamp::default() };
        let mut sample = Vec::new();
        encode_sample(&PoseSample { stamp, x_m, ..PoseSample::default() }, &mut sample);
        sample
    }

    #[test]
    fn a_bit_of_a_sample_is_found_and_a_repeated_tick_and_the_end_are_no_difference() {
        let found = |one: &[Vec<u8>], many: &[Vec<u8>]| {
            unequal(&topics::POSE, &[of_ticks(one, 2), of_ticks(many, 2)], &[])
        };
        let one = [pose(0, 0, 0.5), pose(1, 1, 0.7), pose(2, 2, 0.8)];
        let again = [pose(0, 0, 0.5), pose(0, 1, 0.5), pose(1, 2, 0.7)];
        assert_eq!(found(&one, &again), None);
        let last_bit = [pose(0, 0, 0.5), pose(1, 1, 0.7_f64.next_up())];
        let said = found(&one, &last_bit).unwrap();
        assert_eq!(said, "tick 1, x_m: 0.7 and 0.7000000000000001");
        assert_eq!(found(&one, &one[..1]).unwrap(), "2 samples and 1");
    }

    #[test]
    fn a_cell_of_a_map_is_found_and_a_further_keyframe_is_no_difference() {
        let keyframe = |tick, cell| {
            let part = Part::whole(GridFrame { cells: 1, ..GridFrame::default() }, 1);
            let stamp = Stamp { tick, ..Stamp::default() };
            let header = GridHeader { stamp, part, ..GridHeader::default() };
            let mut sample = Vec::new();
            encode_slice(&header, &[cell], &mut sample);
            sample
        };
        let one = maps(&[keyframe(0, 0_u8)], 1);
        assert_eq!(one, maps(&[keyframe(0, 0), keyframe(0, 0)], 1));
        assert_ne!(one, maps(&[keyframe(0, 1)], 1));
    }
}
