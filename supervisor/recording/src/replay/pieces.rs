//! Assembly of a generation's input entries from pieces, see [`common::inputs`].

use common::inputs::LONGEST_ENTRY;
use thiserror::Error;

#[derive(Default)]
pub(crate) struct Pieces {
    next: u32,
    bytes: Vec<u8>,
    /// Number of consumed bytes.
    given: usize,
}

/// Pieces out of sequence or without valid entries.
#[derive(Debug, PartialEq, Eq, Error)]
pub(crate) enum Broken {
    #[error(
        "its first {0} pieces of `inputs` are not recorded; attach the recorder before the stage starts"
    )]
    NoBeginning(u32),
    #[error("{1} pieces of `inputs` are missing after piece {0}: the recorder lost them")]
    Missing(u32, u32),
    #[error("piece {0} of its `inputs` follows piece {1}; the recording is damaged")]
    OutOfOrder(u32, u32),
    #[error("its `inputs` contain an invalid entry of {0} bytes")]
    NoEntry(usize),
}

impl Pieces {
    pub(crate) fn push(&mut self, sequence: u32, piece: &[u8]) -> Result<(), Broken> {
        match (self.next, sequence.checked_sub(self.next)) {
            (_, Some(0)) => {}
            (0, _) => return Err(Broken::NoBeginning(sequence)),
            (next, Some(missing)) => return Err(Broken::Missing(next - 1, missing)),
            (next, None) => return Err(Broken::OutOfOrder(sequence, next - 1)),
        }
        self.next = sequence.saturating_add(1);
        self.bytes.drain(..self.given);
        self.given = 0;
        self.bytes.extend_from_slice(piece);
        Ok(())
    }

    pub(crate) fn entry(&mut self) -> Result<Option<Vec<u8>>, Broken> {
        let rest = &self.bytes[self.given..];
        let Some((length, rest)) = rest.split_first_chunk() else {
            return Ok(None);
        };
        let length = u32::from_le_bytes(*length) as usize;
        if length > LONGEST_ENTRY {
            return Err(Broken::NoEntry(length));
        }
        let Some(body) = rest.get(..length) else {
            return Ok(None);
        };
        let body = body.to_vec();
        self.given += 4 + length;
        assert!(self.given <= self.bytes.len());
        Ok(Some(body))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_come_out_whole_wherever_the_pieces_were_cut() {
        let entries: [&[u8]; 3] = [b"first", b"", b"the third"];
        let mut stream = Vec::new();
        for entry in entries {
            stream.extend_from_slice(&(entry.len() as u32).to_le_bytes());
            stream.extend_from_slice(entry);
        }
        for size in 1..=stream.len() {
            let mut pieces = Pieces::default();
            let mut found = Vec::new();
            for (sequence, piece) in stream.chunks(size).enumerate() {
                pieces.push(sequence as u32, piece).unwrap();
                while let Some(entry) = pieces.entry().unwrap() {
                    found.push(entry);
                }
            }
            assert_eq!(found, entries);
        }
    }

    #[test]
    fn a_piece_that_is_missing_is_told() {
        let mut pieces = Pieces::default();
        assert_eq!(pieces.push(2, b""), Err(Broken::NoBeginning(2)));
        pieces.push(0, b"").unwrap();
        assert_eq!(pieces.push(4, b""), Err(Broken::Missing(0, 3)));
        assert_eq!(pieces.push(0, b""), Err(Broken::OutOfOrder(0, 0)));
        let mut pieces = Pieces::default();
        pieces.push(0, &u32::MAX.to_le_bytes()).unwrap();
        assert!(pieces.entry().is_err());
    }
}
