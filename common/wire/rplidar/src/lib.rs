//! Protocol of Slamtec RPLIDARs on a serial line: host requests, and the sensor's answers and
//! standard scans. Source: Slamtec, "Interface Protocol and Application Notes", rev. 2.1, 2019.
//!
//! A measurement has five bytes with only four check bits. A reader without synchronization
//! therefore trusts only a run of measurements with successive angles.

/// First byte of a request, and of an answer's descriptor.
pub const START: u8 = 0xa5;
/// Bit of requests with a payload: its length, its bytes, a checksum.
const HAS_PAYLOAD: u8 = 0x80;
const NODE_BYTES: usize = 5;
const TURN_Q6: u16 = 360 * 64;
/// Successive measurements that synchronize a reader. Each counts once the next has begun well, so
/// that lost bytes cannot also take the first one of the next turn.
const RUN: usize = 4;
/// Greatest angle between successive measurements, 1/64 degree. An A1 corrects angles by the range.
const MOST_STEP_Q6: u16 = 20 * 64;

/// Request by its byte. Standard scans need no others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Request {
    Scan = 0x20,
    /// Scan without waiting for the motor's speed.
    ForceScan = 0x21,
    Stop = 0x25,
    Reset = 0x40,
    Info = 0x50,
    Health = 0x52,
    SampleRate = 0x59,
}

impl Request {
    const ALL: [Self; 7] = [
        Self::Scan,
        Self::ForceScan,
        Self::Stop,
        Self::Reset,
        Self::Info,
        Self::Health,
        Self::SampleRate,
    ];

    pub const fn encode(self) -> [u8; 2] {
        [START, self as u8]
    }
}

#[derive(Clone, Debug, Default)]
pub struct Requests {
    held: Vec<u8>,
}

impl Requests {
    /// Returns the requests that `bytes` complete, without unknown ones.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Request> {
        let mut complete = Vec::new();
        for byte in bytes {
            if self.held.is_empty() && *byte != START {
                continue;
            }
            self.held.push(*byte);
            let length = match self.held[..] {
                [_, name, ..] if name & HAS_PAYLOAD == 0 => 2,
                [_, _, payload, ..] => 4 + usize::from(payload),
                _ => continue,
            };
            if self.held.len() >= length {
                complete.extend(Request::ALL.iter().find(|it| self.held.starts_with(&it.encode())));
                self.held.clear();
            }
        }
        complete
    }
}

/// Sensor's answer. Status is 0 for good, 1 for a warning, 2 for an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    Info([u8; 20]),
    Health {
        status: u8,
        code: u16,
    },
    /// Time between measurements, microseconds.
    SampleRate {
        standard_us: u16,
        express_us: u16,
    },
    /// Measurements follow.
    Scan,
}

/// Descriptor of an answer: start, length, mode and kind.
type Descriptor = [u8; 7];
const INFO: Descriptor = [START, 0x5a, 20, 0, 0, 0x00, 0x04];
const HEALTH: Descriptor = [START, 0x5a, 3, 0, 0, 0x00, 0x06];
const SAMPLE_RATE: Descriptor = [START, 0x5a, 4, 0, 0, 0x00, 0x15];
const SCAN: Descriptor = [START, 0x5a, NODE_BYTES as u8, 0, 0, 0x40, 0x81];

impl Answer {
    pub fn encode(self) -> Vec<u8> {
        let (descriptor, body) = match self {
            Self::Info(info) => (INFO, info.to_vec()),
            Self::Health { status, code } => {
                (HEALTH, [&[status][..], &code.to_le_bytes()].concat())
            }
            Self::SampleRate { standard_us, express_us } => {
                (SAMPLE_RATE, [standard_us, express_us].map(u16::to_le_bytes).concat())
            }
            Self::Scan => (SCAN, Vec::new()),
        };
        [&descriptor[..], &body].concat()
    }

    /// Returns the length and the answer, or `None` if `body` is too short.
    fn parse(descriptor: Descriptor, body: &[u8]) -> Option<(usize, Self)> {
        Some(match (descriptor, body) {
            (INFO, _) => (20, Self::Info(*body.first_chunk()?)),
            (HEALTH, [status, low, high, ..]) => {
                (3, Self::Health { status: *status, code: u16::from_le_bytes([*low, *high]) })
            }
            (SAMPLE_RATE, [a, b, c, d, ..]) => {
                let [standard_us, express_us] = [[*a, *b], [*c, *d]].map(u16::from_le_bytes);
                (4, Self::SampleRate { standard_us, express_us })
            }
            (SCAN, _) => (0, Self::Scan),
            _ => return None,
        })
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Node {
    /// Marks the start of a turn.
    pub is_first: bool,
    /// 0 to 63; 0 is no reading.
    pub quality: u8,
    /// Clockwise from the sensor's front, 1/64 degree.
    pub angle_q6: u16,
    /// 1/4 mm; 0 is no reading.
    pub distance_q2: u16,
}

impl Node {
    pub fn encode(self) -> [u8; NODE_BYTES] {
        debug_assert!(self.angle_q6 < TURN_Q6 && self.quality < 64);
        let flags = if self.is_first { 0b01 } else { 0b10 };
        let [angle_low, angle_high] = (self.angle_q6 << 1 | 1).to_le_bytes();
        let [low, high] = self.distance_q2.to_le_bytes();
        [self.quality << 2 | flags, angle_low, angle_high, low, high]
    }

    fn parse(bytes: [u8; NODE_BYTES]) -> Option<Self> {
        let [flags, angle_low, angle_high, low, high] = bytes;
        let is_node = matches!(flags & 0b11, 0b01 | 0b10) && angle_low & 1 == 1;
        is_node.then(|| Self {
            is_first: flags & 1 == 1,
            quality: flags >> 2,
            angle_q6: (u16::from_le_bytes([angle_low, angle_high]) >> 1) % TURN_Q6,
            distance_q2: u16::from_le_bytes([low, high]),
        })
    }

    fn follows(self, earlier: Self) -> bool {
        assert!(self.angle_q6 < TURN_Q6 && earlier.angle_q6 < TURN_Q6);
        let step = (self.angle_q6 + TURN_Q6 - earlier.angle_q6) % TURN_Q6;
        step.min(TURN_Q6 - step) <= MOST_STEP_Q6 && !(self.is_first && earlier.is_first)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Said {
    Answer(Answer),
    Node(Node),
    /// Byte outside any message.
    Noise,
}

#[derive(Clone, Debug, Default)]
pub struct Decoder {
    held: Vec<u8>,
    state: State,
}

#[derive(Clone, Copy, Debug, Default)]
enum State {
    #[default]
    Idle,
    Answers(Descriptor),
    /// Newest measurement; `None` before the first or without synchronization.
    Scans {
        after: Option<Node>,
        is_lost: bool,
    },
}

impl Decoder {
    /// Returns the meaning of `bytes`, including earlier bytes that they complete. It buffers fewer
    /// than 20 bytes.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Said> {
        let mut held = std::mem::take(&mut self.held);
        held.extend_from_slice(bytes);
        let mut said = Vec::new();
        let mut at = 0;
        while let Some((length, meaning)) = held.get(at..).and_then(|rest| self.next_piece(rest)) {
            at += length;
            assert!(at <= held.len());
            said.extend(meaning);
        }
        held.drain(..at);
        self.held = held;
        said
    }

    fn next_piece(&mut self, rest: &[u8]) -> Option<(usize, Option<Said>)> {
        if let State::Answers(descriptor) = self.state {
            let (length, answer) = Answer::parse(descriptor, rest)?;
            self.state = match answer {
                Answer::Scan => State::Scans { after: None, is_lost: false },
                _ => State::Idle,
            };
            return Some((length, Some(Said::Answer(answer))));
        }
        for descriptor in [INFO, HEALTH, SAMPLE_RATE, SCAN] {
            if rest.starts_with(&descriptor) {
                self.state = State::Answers(descriptor);
                return Some((descriptor.len(), None));
            }
            // One byte alone may belong to a measurement.
            if descriptor.starts_with(rest) {
                return None;
            }
        }
        let State::Scans { after, is_lost } = self.state else {
            return Some((1, Some(Said::Noise)));
        };
        let run = if is_lost { RUN } else { 2 };
        let mut node = first_of_run(rest.get(..run * NODE_BYTES)?);
        node.take_if(|node| after.is_some_and(|after| !node.follows(after)));
        self.state = State::Scans { after: node, is_lost: node.is_none() };
        Some(node.map_or((1, Some(Said::Noise)), |node| (NODE_BYTES, Some(Said::Node(node)))))
    }
}

fn first_of_run(bytes: &[u8]) -> Option<Node> {
    let (nodes, _) = bytes.as_chunks();
    let nodes: Option<Vec<_>> = nodes.iter().map(|node| Node::parse(*node)).collect();
    nodes.filter(|nodes| nodes.windows(2).all(|pair| pair[1].follows(pair[0])))?.first().copied()
}
