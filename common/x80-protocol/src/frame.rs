use thiserror::Error;

use super::{crc::crc8, did};

pub(super) const HEADER: [u8; 2] = [0x5e, 0x02];
const END: [u8; 2] = [0x5e, 0x0d];
/// Header, RID, SN, DID, LEN.
pub(super) const BEFORE_DATA: usize = 6;
/// 255 data bytes with all that surrounds them.
pub const MAX_FRAME_BYTES: usize = BEFORE_DATA + 255 + 1 + END.len();

/// How robot and host are numbered. A receiver answers as it was addressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Addressing {
    /// Host 00, motion board 01, multimedia board 08: most robots.
    #[default]
    Numbered,
    /// Host B8, robot 8B: some robots.
    Lettered,
}

impl Addressing {
    #[must_use]
    pub const fn robot(self) -> u8 {
        match self {
            Self::Numbered => 0x01,
            Self::Lettered => 0x8b,
        }
    }

    #[must_use]
    pub const fn host(self) -> u8 {
        match self {
            Self::Numbered => 0x00,
            Self::Lettered => 0xb8,
        }
    }

    /// None if `rid` is not a robot's.
    #[must_use]
    pub const fn of_robot(rid: u8) -> Option<Self> {
        match rid {
            0x01 | 0x08 => Some(Self::Numbered),
            0x8b => Some(Self::Lettered),
            _ => None,
        }
    }

    /// The multimedia board acknowledges, and neither moves nor measures.
    #[must_use]
    pub const fn is_multimedia(rid: u8) -> bool {
        rid == 0x08
    }

    /// None if `rid` is not a host's.
    #[must_use]
    pub const fn of_host(rid: u8) -> Option<Self> {
        match rid {
            0x00 => Some(Self::Numbered),
            0xb8 => Some(Self::Lettered),
            _ => None,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    pub rid: u8,
    /// Everybody sends 0.
    pub sn: u8,
    pub did: u8,
    pub data: &'a [u8],
}

impl Frame<'_> {
    /// Cuts data beyond 255 bytes off: LEN is one byte.
    pub fn encode(&self, out: &mut Vec<u8>) {
        let data = &self.data[..self.data.len().min(255)];
        out.extend_from_slice(&HEADER);
        let checked_from = out.len();
        out.extend_from_slice(&[self.rid, self.sn, self.did, data.len() as u8]);
        out.extend_from_slice(data);
        let crc = crc8(&out[checked_from..]);
        out.push(crc);
        out.extend_from_slice(&END);
    }
}

/// Both sides send them with DID 255.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SystemSignal {
    /// Code 0.
    Ping,
    /// Code 1. Acknowledging these would never end.
    Ack,
}

impl SystemSignal {
    pub(super) fn parse(data: &[u8]) -> Result<Self, MessageError> {
        match data.first() {
            Some(0) => Ok(Self::Ping),
            Some(1) => Ok(Self::Ack),
            Some(&value) => Err(MessageError::Value { did: did::SYSTEM, what: "signal", value }),
            None => Err(length(did::SYSTEM, data, "1")),
        }
    }

    pub(super) const fn byte(self) -> u8 {
        match self {
            Self::Ping => 0,
            Self::Ack => 1,
        }
    }
}

/// The CRC was right. A receiver can continue after any of these errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum MessageError {
    #[error("no message has DID {did}; pass the frame over, or add the DID to the wire module")]
    UnknownDid { did: u8 },
    #[error("DID {did} came with {found} data bytes instead of {expected}; pass the frame over")]
    Length { did: u8, found: usize, expected: &'static str },
    #[error("DID {did}: {value} is no {what}; pass the frame over")]
    Value { did: u8, what: &'static str, value: u8 },
}

pub(super) const fn length(did: u8, data: &[u8], expected: &'static str) -> MessageError {
    MessageError::Length { did, found: data.len(), expected }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_beyond_what_len_can_say_never_make_a_broken_frame() {
        let mut bytes = Vec::new();
        let frame = Frame { rid: 1, sn: 0, did: 9, data: &[7; 300] };
        frame.encode(&mut bytes);
        assert_eq!(bytes.len(), MAX_FRAME_BYTES);
        assert_eq!(bytes[5], 255);
        assert_eq!(bytes[6 + 255], crc8(&bytes[2..6 + 255]));
    }
}
