//! Recorded samples of a tick: tick, time, and difference of two.

use common::{
    bus::{Stamp, decode_sample},
    clock::MissionTime,
    topics::{self, AnyTopic},
};
use serde::Serialize;

use crate::replay::values;

/// Compared topics of a tick, in causal order.
pub(crate) static COMPARED: [&dyn AnyTopic; 6] = [
    &topics::RANGES,
    &topics::WHEELS,
    &topics::POSE,
    &topics::GRID,
    &topics::GUIDANCE,
    &topics::COMMAND,
];
/// Fields that differ in every run: a process's own measurements and counts of restarts.
const OWN: [&str; 4] = ["stamp.generation", "stamp.sequence", "full_solve_ns", "full_solves"];

#[derive(Debug, PartialEq, Serialize)]
pub struct First {
    pub tick: u64,
    pub time_s: f64,
    /// First topic of that tick that differs.
    pub topic: &'static str,
    pub writer: &'static str,
    pub field: String,
    pub values: [String; 2],
}

pub(crate) fn stamp_of(message: &[u8]) -> Stamp {
    decode_sample(message).unwrap_or_default()
}

pub(crate) fn tick_of(message: &[u8]) -> u64 {
    stamp_of(message).tick
}

pub(crate) fn time_of(message: &[u8]) -> MissionTime {
    stamp_of(message).time()
}

/// Returns whether a grid's message is a keyframe; the flag follows stamp, version and five
/// numbers.
pub(crate) fn is_keyframe(message: &[u8]) -> bool {
    message.get(4 + 24 + 8 + 20) == Some(&1)
}

/// Returns the first difference of two samples of a tick on `topic`, apart from process-specific
/// fields.
pub(crate) fn difference(topic: &'static dyn AnyTopic, a: &[u8], b: &[u8]) -> Option<First> {
    // The stamp's generation and sequence are left out.
    if a.get(..20) == b.get(..20) && a.get(28..) == b.get(28..) {
        return None;
    }
    let (field, values) = values::first_difference(topic, [a, b], &OWN)?;
    Some(First {
        tick: tick_of(a),
        time_s: time_of(a).seconds(),
        topic: topic.spec().name,
        writer: topic.spec().writer,
        field,
        values,
    })
}
