//! Sorts messages by tick: a delayed recorder reads the samples of several ticks topic by topic.

use std::collections::BTreeMap;

use common::topics;

use crate::{Message, RecordingError, replay::samples::tick_of};

/// The most messages that are held: those of some hundred ticks, which is more than a bus holds for its recorder.
const HELD: usize = 4096;

/// Gives messages by tick, within a tick by the table of topics, within a topic in the order of the file.
pub(super) struct ByTick<I> {
    messages: I,
    held: BTreeMap<(u64, usize, u64), Message>,
    came: u64,
}

impl<I: Iterator<Item = Result<Message, RecordingError>>> ByTick<I> {
    pub(super) const fn new(messages: I) -> Self {
        Self { messages, held: BTreeMap::new(), came: 0 }
    }
}

impl<I: Iterator<Item = Result<Message, RecordingError>>> Iterator for ByTick<I> {
    type Item = Result<Message, RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.held.len() < HELD {
            let message = match self.messages.next() {
                Some(Ok(message)) => message,
                Some(Err(error)) => return Some(Err(error)),
                None => break,
            };
            let place = topics::TABLE.iter().position(|topic| topic.spec().name == &*message.topic);
            let key = (tick_of(&message.data), place.unwrap_or(topics::TABLE.len()), self.came);
            self.came += 1;
            self.held.insert(key, message);
        }
        self.held.pop_first().map(|(_, message)| Ok(message))
    }
}

#[cfg(test)]
mod tests {
    use common::{
        bus::{Stamp, encode_sample},
        samples::PoseSample,
    };

    use super::*;

    fn message(topic: &str, tick: u64) -> Message {
        let mut data = Vec::new();
        let stamp = Stamp { tick, ..Stamp::default() };
        encode_sample(&PoseSample { stamp, ..PoseSample::default() }, &mut data);
        Message { topic: topic.into(), log_ns: 0, sequence: 0, data }
    }

    #[test]
    fn samples_that_were_recorded_topic_by_topic_come_tick_by_tick() {
        let recorded = [("ranges", 1), ("ranges", 2), ("pose", 1), ("pose", 2)];
        let messages = recorded.map(|(topic, tick)| Ok(message(topic, tick)));
        let ordered: Vec<_> = ByTick::new(messages.into_iter())
            .map(|message| message.unwrap())
            .map(|message| (message.topic.to_string(), tick_of(&message.data)))
            .collect();
        let expected = [("ranges", 1), ("pose", 1), ("ranges", 2), ("pose", 2)];
        assert_eq!(ordered, expected.map(|(topic, tick)| (topic.to_owned(), tick)));
    }
}
