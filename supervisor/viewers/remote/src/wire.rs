//! What goes with the samples from machine to machine, and the clock of the other machine.

use serde::{Deserialize, Serialize};

const LONGEST_HELLO: usize = 4096;

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// Another for each run and each serving process; 0 while the robot does not run.
    pub id: u64,
    /// The monotonic clock of the machine at the time of the answer.
    pub clock_ns: u64,
    pub robot: String,
    pub order: String,
    pub mission_time_s: f64,
}

impl Hello {
    /// None if `bytes` are no such answer.
    pub fn decoded(bytes: &[u8]) -> Option<Self> {
        let bytes = bytes.get(..LONGEST_HELLO).map_or(Some(bytes), |_| None)?;
        serde_json::from_slice(bytes).ok()
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Sent {
    pub id: u64,
    /// The monotonic clock of the robot's machine when the sample was read there.
    pub sent_ns: u64,
}

impl Sent {
    pub fn encoded(self) -> Vec<u8> {
        [self.id.to_le_bytes(), self.sent_ns.to_le_bytes()].concat()
    }

    /// None if `bytes` are something else.
    pub fn decoded(bytes: &[u8]) -> Option<Self> {
        let (id, sent_ns) = bytes.split_first_chunk()?;
        let sent_ns = u64::from_le_bytes(sent_ns.try_into().ok()?);
        Some(Self { id: u64::from_le_bytes(*id), sent_ns })
    }
}

/// Clocks of two machines go apart by less than this share of time.
const DRIFT: i64 = 10_000;

/// The other machine's clock, by questions and answers. The answer was given after the question was asked, so every time of that machine
/// was here no earlier than this says, and an age is never told too low, however slow the link is one way.
#[derive(Default)]
pub struct Clock {
    id: u64,
    /// Our clock less theirs at least, and when that was known.
    known: Option<(i64, u64)>,
}

impl Clock {
    /// Note that a question of `asked_ns`, by our clock, was answered with `hello`. In another run it may be another machine.
    pub fn on_answer(&mut self, asked_ns: u64, hello: &Hello) {
        if hello.id != self.id {
            *self = Self { id: hello.id, known: None };
        }
        let now = asked_ns.wrapping_sub(hello.clock_ns).cast_signed();
        let before = self.known.map_or(i64::MIN, |(least, at)| {
            least.saturating_sub(asked_ns.saturating_sub(at).cast_signed() / DRIFT)
        });
        self.known = Some((before.max(now), asked_ns));
    }

    /// The age at most, at `now_ns` by our clock, of what was sent at `sent_ns` by theirs; none before the first answer.
    pub fn age_ns(&self, now_ns: u64, sent_ns: u64) -> Option<u64> {
        let (least, _) = self.known?;
        let here_ns = i128::from(sent_ns) + i128::from(least);
        u64::try_from((i128::from(now_ns) - here_ns).max(0)).ok()
    }
}
