//! CDR in RTPS of the OMG: plain, version 1, either byte order. One pass over a message's fields
//! reads or writes it. Reads check bounds, and lengths from the wire are untrusted.

use thiserror::Error;

use crate::msg::Release;

/// Most bytes of a text; ROS uses texts for frame names.
pub const LONGEST_TEXT: usize = 256;
/// Length of the encoding's name before the message.
pub(crate) const ENCAPSULATION: usize = 4;

pub type Result<T = (), E = Malformed> = std::result::Result<T, E>;

#[derive(Debug, PartialEq, Eq, Error)]
pub enum Malformed {
    #[error("its encoding is {0:#06x} instead of plain CDR; set the robot's middleware to XCDR1")]
    Encoding(u16),
    #[error("it ends early; check the type of the topic")]
    Short,
    #[error("a list has {0} elements, and the limit is {1}; check the type of the topic")]
    Long(usize, usize),
    #[error("a flag has the value {0} instead of 0 or 1; check the type of the topic")]
    Bool(u8),
    #[error("a string lacks its terminator; check the type of the topic")]
    Text,
    #[error(
        "the message fits {0} layouts of ROS releases instead of one; check the other node's ROS release"
    )]
    Layouts(usize),
}

impl From<Malformed> for String {
    fn from(error: Malformed) -> Self {
        error.to_string()
    }
}

pub trait Pass {
    fn release(&self) -> Release;

    /// Passes a number, least significant byte first.
    fn number<const N: usize>(&mut self, bytes: &mut [u8; N]) -> Result;

    /// Returns the number of elements of a list, which has `length` before the pass and at most
    /// `most`.
    fn length(&mut self, length: usize, most: usize) -> Result<usize>;
}

pub trait Cdr: Sized {
    /// Passes its fields. Lists and texts have at most `most` elements.
    fn pass<P: Pass>(&mut self, pass: &mut P, most: usize) -> Result;

    /// Reads a message in the newest layout that fits; fields appended by later releases are
    /// ignored.
    fn decode(payload: &[u8]) -> Result<Self>
    where
        Self: Default,
    {
        let read = |release| read(payload, release).map(|(message, _)| message);
        let older = || Release::ALL.into_iter().find_map(|(_, release)| read(release).ok());
        read(Release::Common).or_else(|error| older().ok_or(error))
    }

    /// Reads a message in the only layout that consumes all of `payload`, and returns the releases
    /// with it, the newest first.
    fn decode_whole(payload: &[u8]) -> Result<(Vec<Release>, Self)>
    where
        Self: Clone + Default,
    {
        let whole = |(_, release)| {
            let (message, is_whole) = read::<Self>(payload, release).ok()?;
            is_whole.then_some((release, message))
        };
        let (releases, mut found): (_, Vec<_>) =
            Release::ALL.into_iter().rev().filter_map(whole).unzip();
        found.dedup_by_key(|message| message.clone().encode());
        let [found] = found.try_into().map_err(|all: Vec<_>| Malformed::Layouts(all.len()))?;
        Ok((releases, found))
    }

    fn encode(self) -> Vec<u8> {
        self.encode_for(Release::Common)
    }

    fn encode_for(mut self, release: Release) -> Vec<u8> {
        let mut writer = Writer { bytes: vec![0, 1, 0, 0], release };
        // Encoding never yields a malformed message.
        let _ = self.pass(&mut writer, usize::MAX);
        writer.bytes
    }
}

/// Decodes a message and returns whether it ends the payload. RTPS pads a payload to a multiple of
/// 4 bytes.
pub(crate) fn read<T: Cdr + Default>(payload: &[u8], release: Release) -> Result<(T, bool)> {
    let (header, bytes) = payload.split_at_checked(ENCAPSULATION).ok_or(Malformed::Short)?;
    let is_big = match [header[0], header[1]] {
        [0, order @ (0 | 1)] => order == 0,
        other => return Err(Malformed::Encoding(u16::from_be_bytes(other))),
    };
    let mut reader = Reader { bytes, at: 0, is_big, release };
    let mut message = T::default();
    message.pass(&mut reader, usize::MAX)?;
    Ok((message, bytes.len() < reader.at + ENCAPSULATION))
}

struct Reader<'a> {
    /// Payload; alignment counts from its start.
    bytes: &'a [u8],
    at: usize,
    is_big: bool,
    release: Release,
}

impl Pass for Reader<'_> {
    fn release(&self) -> Release {
        self.release
    }

    fn number<const N: usize>(&mut self, bytes: &mut [u8; N]) -> Result {
        let start = self.at.next_multiple_of(N);
        *bytes = *self.bytes.get(start..).and_then(<[u8]>::first_chunk).ok_or(Malformed::Short)?;
        self.at = start + N;
        if self.is_big {
            bytes.reverse();
        }
        Ok(())
    }

    fn length(&mut self, _: usize, most: usize) -> Result<usize> {
        let mut length = 0_u32;
        length.pass(self, most)?;
        match length as usize {
            length if length > most => Err(Malformed::Long(length, most)),
            // Each element has at least one byte.
            length if length > self.bytes.len() - self.at => Err(Malformed::Short),
            length => Ok(length),
        }
    }
}

struct Writer {
    bytes: Vec<u8>,
    release: Release,
}

impl Pass for Writer {
    fn release(&self) -> Release {
        self.release
    }

    fn number<const N: usize>(&mut self, bytes: &mut [u8; N]) -> Result {
        let end = (self.bytes.len() - ENCAPSULATION).next_multiple_of(N) + ENCAPSULATION;
        self.bytes.resize(end, 0);
        self.bytes.extend(*bytes);
        Ok(())
    }

    fn length(&mut self, length: usize, most: usize) -> Result<usize> {
        u32::try_from(length).unwrap_or(u32::MAX).pass(self, most)?;
        Ok(length)
    }
}

macro_rules! numbers {
    ($($number:ident)*) => {$(
        impl Cdr for $number {
            fn pass<P: Pass>(&mut self, pass: &mut P, _: usize) -> Result {
                let mut bytes = self.to_le_bytes();
                pass.number(&mut bytes)?;
                *self = Self::from_le_bytes(bytes);
                Ok(())
            }
        }
    )*};
}

numbers! { u8 i8 u16 i16 u32 i32 u64 i64 f32 f64 }

impl Cdr for bool {
    fn pass<P: Pass>(&mut self, pass: &mut P, most: usize) -> Result {
        let mut byte = u8::from(*self);
        byte.pass(pass, most)?;
        *self = byte == 1;
        if byte > 1 { Err(Malformed::Bool(byte)) } else { Ok(()) }
    }
}

/// Text, with a final zero byte on the wire; some implementations omit it for an empty text.
/// Invalid UTF-8 is replaced.
impl Cdr for String {
    fn pass<P: Pass>(&mut self, pass: &mut P, most: usize) -> Result {
        let mut bytes = [self.as_bytes(), &[0]].concat();
        bytes.pass(pass, most)?;
        if bytes.pop().unwrap_or_default() != 0 {
            return Err(Malformed::Text);
        }
        *self = Self::from_utf8_lossy(&bytes).into_owned();
        Ok(())
    }
}

impl<T: Cdr, const N: usize> Cdr for [T; N] {
    fn pass<P: Pass>(&mut self, pass: &mut P, most: usize) -> Result {
        self.iter_mut().try_for_each(|element| element.pass(pass, most))
    }
}

/// Grows as its elements arrive.
impl<T: Cdr + Default> Cdr for Vec<T> {
    fn pass<P: Pass>(&mut self, pass: &mut P, most: usize) -> Result {
        let length = pass.length(self.len(), most)?;
        self.truncate(length);
        for at in 0..length {
            if at == self.len() {
                self.push(T::default());
            }
            self[at].pass(pass, LONGEST_TEXT)?;
        }
        Ok(())
    }
}
