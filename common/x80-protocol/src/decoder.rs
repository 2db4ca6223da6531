//! Bytes to frames. The bytes may come in any pieces, with noise between frames and with wrong CRCs.
//!
//! A frame is found by its header, LEN and CRC. Its end bytes are checked only where CRC-8 alone is too weak: one
//! noisy header in 256 passes the CRC, and the good frames after it would count as its data. So a frame with wrong
//! end bytes is accepted only if no frame with right end bytes begins inside it.

use std::cell::Cell;

use super::{
    crc::crc8,
    frame::{BEFORE_DATA, Frame, HEADER, MAX_FRAME_BYTES},
};

/// The largest datagram, and a frame begun in the one before.
const CAPACITY: usize = 65_536 + MAX_FRAME_BYTES;
/// No known message is longer: a header that claims more is likely noise, and does not hold back the complete frames
/// behind it while the rest of its own is missing.
const LONGEST_PLAUSIBLE: usize = 64;

/// Bytes whose CRC is computed after one push. Sound frames need as many as they have; a flood of false headers would
/// need a thousand times as many, and hold up whoever decodes.
const MOST_WORK: usize = 1 << 20;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DecoderTally {
    pub frames: u64,
    pub bad_crc: u64,
    pub noise_bytes: u64,
    /// Bytes dropped unread because more came than is held, or too many false headers.
    pub dropped_bytes: u64,
}

/// [`Decoder::push`] what came, then take every [`Decoder::next_frame`].
///
/// It holds at most 64 KiB and a frame. If a push exceeds that, the oldest bytes are dropped; if false headers take
/// too long, all are. An incomplete frame waits for its rest, and so do the bytes after a false header until its
/// claimed length has come.
#[derive(Clone, Debug, Default)]
pub struct Decoder {
    buffer: Vec<u8>,
    start: usize,
    tally: DecoderTally,
    /// Bytes whose CRC was computed since the last push.
    work: Cell<usize>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Candidate {
    /// The CRC of LEN data bytes is right; `end` is the offset after it.
    Sound {
        end: usize,
        ending: Ending,
    },
    /// The rest has not come; the header announces `len` bytes of data.
    Half {
        len: usize,
    },
    Broken,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Ending {
    /// `5E 0D`, or the `5E 13` that one client sends.
    Right,
    /// Other bytes, or only the beginning of right end bytes so far.
    Wrong,
    Missing,
}

impl Decoder {
    pub fn push(&mut self, bytes: &[u8]) {
        self.buffer.drain(..self.start);
        self.start = 0;
        let excess = (self.buffer.len() + bytes.len()).saturating_sub(CAPACITY);
        let from_held = excess.min(self.buffer.len());
        self.buffer.drain(..from_held);
        self.buffer.extend_from_slice(&bytes[excess - from_held..]);
        self.tally.dropped_bytes += excess as u64;
        self.work.set(0);
    }

    /// The next complete frame, in the order they came.
    pub fn next_frame(&mut self) -> Option<Frame<'_>> {
        let end = loop {
            if self.work.get() > MOST_WORK {
                self.tally.dropped_bytes += (self.buffer.len() - self.start) as u64;
                self.start = self.buffer.len();
            }
            let bytes = &self.buffer[self.start..];
            let Some(noise) = header_in(bytes) else {
                self.skip(bytes.len());
                return None;
            };
            let bytes = &bytes[noise..];
            match candidate(bytes, &self.work) {
                Candidate::Sound { end, ending: Ending::Right } => {
                    self.skip(noise);
                    break end;
                }
                Candidate::Sound { end, ending } => match inside(bytes, end, &self.work) {
                    Inside::Nothing => {
                        self.skip(noise);
                        break end;
                    }
                    Inside::Frame(at) if ending == Ending::Wrong => {
                        self.tally.bad_crc += 1;
                        self.skip(noise + at);
                    }
                    // The next bytes show which of the two frames is real.
                    Inside::Frame(_) | Inside::Unknown => {
                        self.skip(noise);
                        return None;
                    }
                },
                Candidate::Half { len } => {
                    self.skip(noise);
                    if len <= LONGEST_PLAUSIBLE {
                        return None;
                    }
                    let bytes = &self.buffer[self.start..];
                    let Inside::Frame(at) = inside(bytes, bytes.len(), &self.work) else {
                        return None;
                    };
                    self.skip(at);
                }
                // Only the header is skipped, because the next frame may begin inside the broken one.
                Candidate::Broken => {
                    self.tally.bad_crc += 1;
                    self.skip(noise + 1);
                }
            }
        };
        self.tally.frames += 1;
        let from = self.start;
        self.start += end;
        if is_end(&self.buffer[self.start..]) == Ending::Right {
            self.start += 2;
        }
        let frame = &self.buffer[from..from + end];
        Some(Frame {
            rid: frame[2],
            sn: frame[3],
            did: frame[4],
            data: &frame[BEFORE_DATA..end - 1],
        })
    }

    /// The next bytes do not continue the held ones, which count as noise.
    pub fn reset(&mut self) {
        self.skip(self.buffer.len() - self.start);
    }

    pub fn tally(&self) -> DecoderTally {
        self.tally
    }

    fn skip(&mut self, bytes: usize) {
        self.start += bytes;
        self.tally.noise_bytes += bytes as u64;
    }
}

/// Offset of the first header, or of a last byte that may begin one.
fn header_in(bytes: &[u8]) -> Option<usize> {
    let whole = bytes.windows(2).position(|pair| pair == HEADER);
    whole.or_else(|| bytes.last().is_some_and(|&last| last == HEADER[0]).then(|| bytes.len() - 1))
}

/// `bytes` starts with a header or the beginning of one.
fn candidate(bytes: &[u8], work: &Cell<usize>) -> Candidate {
    let Some(&len) = bytes.get(BEFORE_DATA - 1) else {
        return Candidate::Half { len: 0 };
    };
    let crc_at = BEFORE_DATA + usize::from(len);
    work.set(work.get() + crc_at);
    match bytes.get(crc_at) {
        None => Candidate::Half { len: usize::from(len) },
        Some(&crc) if crc == crc8(&bytes[HEADER.len()..crc_at]) => {
            Candidate::Sound { end: crc_at + 1, ending: is_end(&bytes[crc_at + 1..]) }
        }
        Some(_) => Candidate::Broken,
    }
}

fn is_end(bytes: &[u8]) -> Ending {
    match bytes {
        [0x5e, 0x0d | 0x13, ..] => Ending::Right,
        [] | [0x5e] => Ending::Missing,
        _ => Ending::Wrong,
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Inside {
    Nothing,
    /// A sound frame begins at this offset.
    Frame(usize),
    Unknown,
}

/// Searches after the start of `bytes` and before `end`.
fn inside(bytes: &[u8], end: usize, work: &Cell<usize>) -> Inside {
    let mut found = Inside::Nothing;
    for at in 1..end.min(bytes.len()) {
        if !HEADER.starts_with(&bytes[at..(at + 2).min(bytes.len())]) {
            continue;
        }
        match candidate(&bytes[at..], work) {
            Candidate::Sound { ending, .. } => match ending {
                Ending::Right => return Inside::Frame(at),
                Ending::Missing => return Inside::Unknown,
                Ending::Wrong => {}
            },
            Candidate::Half { len } if len <= LONGEST_PLAUSIBLE => return Inside::Unknown,
            Candidate::Half { .. } => found = Inside::Unknown,
            Candidate::Broken => {}
        }
    }
    found
}

#[cfg(test)]
mod tests;
