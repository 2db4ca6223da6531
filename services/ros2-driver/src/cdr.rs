//! The encoding of messages: CDR as the OMG's RTPS carries it, plain and of version 1, of either byte order. Each read checks its bounds,
//! and no length from the wire is trusted.

use thiserror::Error;

/// The longest text of a message, bytes; ROS uses them for the names of frames.
const LONGEST_TEXT: usize = 256;
/// The bytes before the message that name its encoding.
const ENCAPSULATION: usize = 4;

/// The bytes are not the message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Malformed {
    /// They are encoded in another way.
    #[error("encoding {0:#06x} instead of plain CDR; set the robot's middleware to XCDR1")]
    Encoding(u16),
    /// They end early.
    #[error("it ends early; is the topic of this type?")]
    Short,
    /// A text or a list is too long.
    #[error("{0} elements in a list, and {1} are the most; is the topic of this type?")]
    Long(u32, usize),
}

/// Reads one message.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    /// The message, from which its alignment counts.
    bytes: &'a [u8],
    at: usize,
    is_big: bool,
}

impl<'a> Reader<'a> {
    /// A reader of the message in `payload`, which begins with its encapsulation.
    pub fn new(payload: &'a [u8]) -> Result<Self, Malformed> {
        let (header, bytes) = payload.split_at_checked(ENCAPSULATION).ok_or(Malformed::Short)?;
        match [header[0], header[1]] {
            [0, order @ (0 | 1)] => Ok(Self { bytes, at: 0, is_big: order == 0 }),
            other => Err(Malformed::Encoding(u16::from_be_bytes(other))),
        }
    }

    /// The next `N` bytes, most significant first, after padding to a multiple of `N`.
    fn primitive<const N: usize>(&mut self) -> Result<[u8; N], Malformed> {
        let start = self.at.next_multiple_of(N);
        let bytes = self.bytes.get(start..).and_then(<[u8]>::first_chunk::<N>);
        let mut bytes = *bytes.ok_or(Malformed::Short)?;
        self.at = start + N;
        if !self.is_big {
            bytes.reverse();
        }
        Ok(bytes)
    }

    pub fn u8(&mut self) -> Result<u8, Malformed> {
        self.primitive().map(u8::from_be_bytes)
    }

    pub fn u32(&mut self) -> Result<u32, Malformed> {
        self.primitive().map(u32::from_be_bytes)
    }

    pub fn i32(&mut self) -> Result<i32, Malformed> {
        self.primitive().map(i32::from_be_bytes)
    }

    pub fn f32(&mut self) -> Result<f32, Malformed> {
        self.primitive().map(f32::from_be_bytes)
    }

    pub fn f64(&mut self) -> Result<f64, Malformed> {
        self.primitive().map(f64::from_be_bytes)
    }

    pub fn f64s<const N: usize>(&mut self) -> Result<[f64; N], Malformed> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.f64()?;
        }
        Ok(numbers)
    }

    /// A list of at most `most` numbers.
    pub fn list(&mut self, most: usize) -> Result<Vec<f32>, Malformed> {
        let length = self.length(most)?;
        (0..length).map(|_| self.f32()).collect()
    }

    /// Pass over a text.
    pub fn skip_text(&mut self) -> Result<(), Malformed> {
        let length = self.length(LONGEST_TEXT)?;
        self.at += length;
        if self.at <= self.bytes.len() { Ok(()) } else { Err(Malformed::Short) }
    }

    fn length(&mut self, most: usize) -> Result<usize, Malformed> {
        let length = self.u32()?;
        usize::try_from(length)
            .ok()
            .filter(|length| *length <= most)
            .ok_or(Malformed::Long(length, most))
    }
}

/// Writes one message, the least significant byte first.
#[derive(Clone, Debug)]
pub struct Writer(Vec<u8>);

impl Writer {
    /// A message of nothing yet, after its encapsulation.
    pub fn begin() -> Self {
        Self(vec![0, 1, 0, 0])
    }

    fn primitive<const N: usize>(mut self, bytes: [u8; N]) -> Self {
        let end = (self.0.len() - ENCAPSULATION).next_multiple_of(N) + ENCAPSULATION;
        self.0.resize(end, 0);
        self.0.extend(bytes);
        self
    }

    pub fn u32(self, number: u32) -> Self {
        self.primitive(number.to_le_bytes())
    }

    pub fn f64(self, number: f64) -> Self {
        self.primitive(number.to_le_bytes())
    }

    /// An empty text: a zero byte ends each.
    pub fn empty_text(self) -> Self {
        self.u32(1).primitive([0])
    }

    pub fn bytes(self) -> Vec<u8> {
        self.0
    }
}
