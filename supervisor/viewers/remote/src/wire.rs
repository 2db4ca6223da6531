//! Metadata of samples between machines, and the clock of the other machine.

use serde::{Deserialize, Serialize};

const LONGEST_HELLO: usize = 4096;

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// Number unique to each run and serving process, or 0 without a run.
    pub id: u64,
    /// Monotonic clock of the machine at the time of the answer.
    pub clock_ns: u64,
    pub robot: String,
    pub order: String,
    pub mission_time_s: f64,
}

impl Hello {
    pub fn decoded(bytes: &[u8]) -> Option<Self> {
        if bytes.len() >= LONGEST_HELLO {
            return None;
        }
        serde_json::from_slice(bytes).ok()
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Sent {
    pub id: u64,
    /// Monotonic clock of the robot's machine when it read the sample.
    pub sent_ns: u64,
}

impl Sent {
    pub fn encoded(self) -> Vec<u8> {
        [self.id.to_le_bytes(), self.sent_ns.to_le_bytes()].concat()
    }

    pub fn decoded(bytes: &[u8]) -> Option<Self> {
        let (id, sent_ns) = bytes.split_first_chunk()?;
        let sent_ns = u64::from_le_bytes(sent_ns.try_into().ok()?);
        Some(Self { id: u64::from_le_bytes(*id), sent_ns })
    }
}

/// Inverse of the largest relative drift between two machines' clocks.
const DRIFT: i64 = 10_000;

/// Bound on the other machine's clock, from requests and answers.
///
/// An answer follows its request, which bounds the clock offset from below. Ages are thus upper
/// bounds, even on an asymmetric link.
#[derive(Default)]
pub struct Clock {
    id: u64,
    /// Lower bound of our clock minus theirs, and the time of that bound.
    known: Option<(i64, u64)>,
}

impl Clock {
    /// Applies the answer `hello` to a request of `asked_ns` (our clock).
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

    /// Bounds the age at `now_ns` (ours) of a sample sent at `sent_ns` (theirs).
    pub fn age_ns(&self, now_ns: u64, sent_ns: u64) -> Option<u64> {
        let (least, _) = self.known?;
        let here_ns = i128::from(sent_ns) + i128::from(least);
        u64::try_from((i128::from(now_ns) - here_ns).max(0)).ok()
    }
}
