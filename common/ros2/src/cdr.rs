//! CDR as the OMG's RTPS carries it: plain, version 1, either byte order. Each read checks its bounds, and no length
//! from the wire is trusted.

use thiserror::Error;

/// Bytes; ROS uses texts for the names of frames.
const LONGEST_TEXT: usize = 256;
/// The bytes before the message name its encoding.
pub(crate) const ENCAPSULATION: usize = 4;

#[derive(Debug, PartialEq, Eq, Error)]
pub enum Malformed {
    #[error("encoding {0:#06x} instead of plain CDR; set the robot's middleware to XCDR1")]
    Encoding(u16),
    #[error("it ends early; is the topic of this type?")]
    Short,
    #[error("{0} elements in a list, and {1} are the most; is the topic of this type?")]
    Long(u32, usize),
}

/// For those who only say why a message is refused.
impl From<Malformed> for String {
    fn from(error: Malformed) -> Self {
        error.to_string()
    }
}

#[derive(Clone, Debug)]
pub struct Reader<'a> {
    /// Alignment counts from its start.
    bytes: &'a [u8],
    at: usize,
    is_big: bool,
}

impl<'a> Reader<'a> {
    /// `payload` begins with its encapsulation; fails if that names another encoding.
    pub fn new(payload: &'a [u8]) -> Result<Self, Malformed> {
        let (header, bytes) = payload.split_at_checked(ENCAPSULATION).ok_or(Malformed::Short)?;
        match [header[0], header[1]] {
            [0, order @ (0 | 1)] => Ok(Self { bytes, at: 0, is_big: order == 0 }),
            other => Err(Malformed::Encoding(u16::from_be_bytes(other))),
        }
    }

    /// Most significant first, after padding to a multiple of `N`.
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

    pub fn f64s<const N: usize>(&mut self) -> Result<[f64; N], Malformed> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.f64()?;
        }
        Ok(numbers)
    }

    /// Fails if the bytes end early, or the list has more than `most` numbers.
    pub fn list(&mut self, most: usize) -> Result<Vec<f32>, Malformed> {
        let length = self.length(most)?;
        (0..length).map(|_| self.f32()).collect()
    }

    /// Fails if there are fewer bytes.
    pub fn raw(&mut self, count: usize) -> Result<&'a [u8], Malformed> {
        let bytes = self.bytes.get(self.at..).and_then(|rest| rest.get(..count));
        let bytes = bytes.ok_or(Malformed::Short)?;
        self.at += count;
        Ok(bytes)
    }

    /// Whether nothing but padding follows: RTPS pads a payload to a multiple of 4 bytes.
    pub fn is_at_end(&self) -> bool {
        self.bytes.len() < self.at + ENCAPSULATION
    }

    /// Leaves out the zero byte that ends it, and what is not UTF-8. Fails if the bytes end early, or the text is too
    /// long.
    pub fn text(&mut self) -> Result<&'a str, Malformed> {
        let length = self.length(LONGEST_TEXT)?;
        let text = self.raw(length)?.split(|byte| *byte == 0).next().unwrap_or_default();
        Ok(str::from_utf8(text).unwrap_or_default())
    }

    /// Fails if it is more than `most`.
    pub fn length(&mut self, most: usize) -> Result<usize, Malformed> {
        let length = self.u32()?;
        usize::try_from(length)
            .ok()
            .filter(|length| *length <= most)
            .ok_or(Malformed::Long(length, most))
    }
}

/// The least significant byte comes first.
#[derive(Clone, Debug)]
pub struct Writer(Vec<u8>);

impl Default for Writer {
    fn default() -> Self {
        Self(vec![0, 1, 0, 0])
    }
}

impl Writer {
    fn primitive<const N: usize>(&mut self, bytes: [u8; N]) -> &mut Self {
        let end = (self.0.len() - ENCAPSULATION).next_multiple_of(N) + ENCAPSULATION;
        self.0.resize(end, 0);
        self.0.extend(bytes);
        self
    }

    pub fn f64s(&mut self, numbers: &[f64]) -> &mut Self {
        numbers.iter().fold(self, |writer, number| writer.f64(*number))
    }

    pub fn raw(&mut self, bytes: &[u8]) -> &mut Self {
        self.0.extend(bytes);
        self
    }

    /// A zero byte ends it.
    pub fn text(&mut self, text: &str) -> &mut Self {
        self.length(text.len() + 1).raw(text.as_bytes()).u8(0)
    }

    pub fn length(&mut self, elements: usize) -> &mut Self {
        self.u32(u32::try_from(elements).unwrap_or(u32::MAX))
    }

    pub fn list<T>(
        &mut self,
        elements: impl IntoIterator<Item = T, IntoIter: ExactSizeIterator>,
        mut write: impl FnMut(&mut Self, T),
    ) -> &mut Self {
        let elements = elements.into_iter();
        self.length(elements.len());
        for element in elements {
            write(self, element);
        }
        self
    }

    /// Nothing more can be written to the message.
    pub fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.0)
    }
}

macro_rules! numbers {
    ($($number:ident)*) => {
        impl Reader<'_> {
            $(pub fn $number(&mut self) -> Result<$number, Malformed> {
                self.primitive().map($number::from_be_bytes)
            })*
        }

        impl Writer {
            $(pub fn $number(&mut self, number: $number) -> &mut Self {
                self.primitive(number.to_le_bytes())
            })*
        }
    };
}

numbers! { u8 u16 i16 u32 i32 i64 f32 f64 }
