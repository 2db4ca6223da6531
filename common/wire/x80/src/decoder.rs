//! Decoder of bytes to frames. Bytes may arrive in any pieces, with noise between frames and wrong
//! CRCs.
//!
//! A frame is found by its header, LEN and CRC. End bytes matter only where CRC-8 is too weak: one
//! noisy header in 256 passes and would swallow the frames after it. A frame with wrong end bytes
//! is therefore accepted only if no frame with right end bytes begins inside it.

use std::cell::Cell;

use super::{
    crc::crc8,
    frame::{BEFORE_DATA, Frame, HEADER, MAX_FRAME_BYTES},
};

/// Largest datagram, plus a frame begun in the one before.
const CAPACITY: usize = 65_536 + MAX_FRAME_BYTES;
/// Bound of known messages. A header that claims more is likely noise, and must not delay the
/// complete frames after it.
const LONGEST_PLAUSIBLE: usize = 64;

/// CRC work in bytes after one push. Sound frames need their own length; a flood of false headers
/// would need a thousand times as much.
const MOST_WORK: usize = 1 << 20;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DecoderTally {
    pub frames: u64,
    pub bad_crc: u64,
    pub noise_bytes: u64,
    /// Bytes dropped unread because of overflow or too many false headers.
    pub dropped_bytes: u64,
}

/// Frame decoder: [`Decoder::push`] the bytes, then take every [`Decoder::next_frame`].
///
/// It buffers at most 64 KiB and a frame. A push beyond that drops the oldest bytes; too much work
/// on false headers drops all. An incomplete frame waits for its rest, as do the bytes after a
/// false header until its claimed length has arrived.
#[derive(Clone, Debug, Default)]
pub struct Decoder {
    buffer: Vec<u8>,
    start: usize,
    tally: DecoderTally,
    /// CRC work in bytes since the last push.
    work: Cell<usize>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Candidate {
    /// Right CRC of LEN data bytes; `end` is the offset after it.
    Sound {
        end: usize,
        ending: Ending,
    },
    /// Incomplete frame whose header announces `len` bytes of data.
    Half {
        len: usize,
    },
    Broken,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Ending {
    /// `5E 0D`, or the `5E 13` that one client sends.
    Right,
    /// Other bytes, or an incomplete right end.
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
        assert!(self.buffer.len() <= CAPACITY);
        self.work.set(0);
    }

    /// Returns the next complete frame in order of arrival.
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
                    // Further bytes will show which of the two frames is real.
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
                // Only the header is skipped, because the next frame may begin inside the broken
                // one.
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
        assert!(
            frame.starts_with(&HEADER) && frame.len() == BEFORE_DATA + usize::from(frame[5]) + 1
        );
        debug_assert_eq!(crc8(&frame[HEADER.len()..end - 1]), frame[end - 1]);
        Some(Frame {
            rid: frame[2],
            sn: frame[3],
            did: frame[4],
            data: &frame[BEFORE_DATA..end - 1],
        })
    }

    /// Discards the buffered bytes as noise, because the next ones do not continue them.
    pub fn reset(&mut self) {
        self.skip(self.buffer.len() - self.start);
    }

    pub fn tally(&self) -> DecoderTally {
        self.tally
    }

    fn skip(&mut self, bytes: usize) {
        self.start += bytes;
        self.tally.noise_bytes += bytes as u64;
        assert!(self.start <= self.buffer.len());
    }
}

/// Returns the offset of the first header, or of a last byte that may begin one.
fn header_in(bytes: &[u8]) -> Option<usize> {
    let whole = bytes.windows(2).position(|pair| pair == HEADER);
    whole.or_else(|| bytes.last().is_some_and(|&last| last == HEADER[0]).then(|| bytes.len() - 1))
}

/// Classifies `bytes`, which start with a header or the beginning of one.
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
    /// Sound frame at this offset.
    Frame(usize),
    Unknown,
}

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
