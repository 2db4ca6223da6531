use thiserror::Error;

use super::crc::crc8;

pub(super) const HEADER: [u8; 2] = [0x5e, 0x02];
const END: [u8; 2] = [0x5e, 0x0d];
/// Header, RID, SN, DID, LEN.
pub(super) const BEFORE_DATA: usize = 6;
/// Length of a frame with 255 data bytes.
pub const MAX_FRAME_BYTES: usize = BEFORE_DATA + 255 + 1 + END.len();

/// Device numbers of robot and host. A receiver answers with the numbers in use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Addressing {
    /// Host 00, motion board 01, multimedia board 08: most robots.
    #[default]
    Numbered,
    /// Host B8, robot 8B: some robots.
    Lettered,
}

impl Addressing {
    pub const fn robot(self) -> u8 {
        match self {
            Self::Numbered => 0x01,
            Self::Lettered => 0x8b,
        }
    }

    pub const fn host(self) -> u8 {
        match self {
            Self::Numbered => 0x00,
            Self::Lettered => 0xb8,
        }
    }

    pub const fn of_robot(rid: u8) -> Option<Self> {
        match rid {
            0x01 | 0x08 => Some(Self::Numbered),
            0x8b => Some(Self::Lettered),
            _ => None,
        }
    }

    /// Returns whether `rid` is the multimedia board, which only acknowledges.
    pub const fn is_multimedia(rid: u8) -> bool {
        rid == 0x08
    }

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
    /// Always sent as 0.
    pub sn: u8,
    pub did: u8,
    pub data: &'a [u8],
}

impl Frame<'_> {
    /// Encodes the frame, with data cut at 255 bytes: LEN is one byte.
    pub fn encode(&self, out: &mut Vec<u8>) {
        let data = &self.data[..self.data.len().min(255)];
        out.extend_from_slice(&HEADER);
        let checked_from = out.len();
        out.extend_from_slice(&[self.rid, self.sn, self.did, data.len() as u8]);
        out.extend_from_slice(data);
        out.push(crc8(&out[checked_from..]));
        out.extend_from_slice(&END);
        assert_eq!(
            out.len() - checked_from,
            BEFORE_DATA - HEADER.len() + data.len() + 1 + END.len()
        );
    }
}

/// Signals that both sides send with DID 255.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum SystemSignal {
    Ping = 0,
    /// Acknowledging it would never end.
    Ack = 1,
}

impl SystemSignal {
    pub(super) fn parse(data: &[u8]) -> Option<Self> {
        match data.first()? {
            0 => Some(Self::Ping),
            1 => Some(Self::Ack),
            _ => None,
        }
    }
}

/// Well-formed frame without a message of this length or these values. A receiver can continue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("DID {did} has unknown data; skip the frame, or add the DID to the wire module")]
pub struct MessageError {
    pub did: u8,
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
