//! Encoding of payloads outside shared memory: little-endian CDR of ROS 2 (OMG DDS-XTYPES 1.3, XCDR
//! version 1), which every reader of recordings supports.
//!
//! Numbers are aligned to their size, counted from the first byte after the header. Structs and
//! arrays add no bytes. A slice begins with its length, a `u32`.

/// Header of every message: little-endian CDR, no options.
pub const HEADER: [u8; 4] = [0, 1, 0, 0];

#[derive(Debug)]
pub struct Encoder<'a> {
    bytes: &'a mut Vec<u8>,
    origin: usize,
}

impl<'a> Encoder<'a> {
    pub fn new(bytes: &'a mut Vec<u8>) -> Self {
        bytes.extend_from_slice(&HEADER);
        let origin = bytes.len();
        Self { bytes, origin }
    }

    pub(super) fn number<const N: usize>(&mut self, number: [u8; N]) {
        const { assert!(N.is_power_of_two() && N <= 8) };
        let past = (self.bytes.len() - self.origin) % N;
        if past != 0 {
            self.bytes.extend_from_slice(&[0; 8][..N - past]);
        }
        debug_assert!((self.bytes.len() - self.origin).is_multiple_of(N));
        self.bytes.extend_from_slice(&number);
    }

    pub(super) fn bytes(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }
}

/// Sequential reader of numbers; returns `None` if too few bytes are left.
#[derive(Clone, Debug)]
pub struct Decoder<'a> {
    rest: &'a [u8],
    length: usize,
}

impl<'a> Decoder<'a> {
    /// Returns `None` if `message` has another encoding.
    pub fn new(message: &'a [u8]) -> Option<Self> {
        let rest = message.strip_prefix(&HEADER)?;
        Some(Self { rest, length: rest.len() })
    }

    pub(super) fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        let past = (self.length - self.rest.len()) % N;
        let padding = if past == 0 { 0 } else { N - past };
        let (number, rest) = self.rest.get(padding..)?.split_first_chunk()?;
        self.rest = rest;
        Some(*number)
    }

    pub(super) fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (bytes, rest) = self.rest.split_at_checked(count)?;
        self.rest = rest;
        Some(bytes)
    }

    pub(super) const fn left(&self) -> usize {
        self.rest.len()
    }
}
