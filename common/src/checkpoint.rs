//! State that outlives a SIGKILL: a small file of two slots, written in turn.
//!
//! Each slot is `magic | sequence | length | crc32 | body`, little-endian. A save overwrites the older
//! slot, so a kill at any instruction leaves at least one whole; the checksum shows which. Nothing is
//! synced to the disk: the kernel keeps what a killed process has written, and a robot that lost
//! power has lost its encoder counts too.

use std::{
    fs::{File, OpenOptions},
    io,
    os::unix::fs::FileExt,
    path::{Path, PathBuf},
};

use serde::{Serialize, de::DeserializeOwned};
use thiserror::Error;

/// A checkpoint that cannot be used.
#[derive(Debug, Error)]
pub enum CheckpointError {
    /// The file system refused.
    #[error(
        "cannot {action} checkpoint {file}: {source}; is the run directory writable and not full?"
    )]
    File {
        /// What was tried.
        action: &'static str,
        /// The file.
        file: PathBuf,
        /// What the system reports.
        source: io::Error,
    },
    /// More state than the checkpoint was made for.
    #[error(
        "checkpoint {file} holds at most {capacity} bytes, not {length}; this is a fault in the stage"
    )]
    TooLarge {
        /// The file.
        file: PathBuf,
        /// Bytes it holds.
        capacity: usize,
        /// Bytes it was given.
        length: usize,
    },
    /// The state could not be encoded.
    #[error("cannot encode checkpoint {file}: {source}; this is a fault in the stage")]
    Encode {
        /// The file.
        file: PathBuf,
        /// What the encoder reports.
        source: postcard::Error,
    },
}

/// "firsthand checkpoint, first layout".
const MAGIC: u32 = u32::from_le_bytes(*b"FHC1");
/// magic u32, sequence u64, length u32, crc32 u32.
const HEADER: usize = 20;

/// One stage's checkpoint file.
#[derive(Debug)]
pub struct Checkpoint {
    file: File,
    path: PathBuf,
    capacity: usize,
    sequence: u64,
    buffer: Vec<u8>,
}

impl Checkpoint {
    /// Open, or create, the checkpoint at `path` for encoded states of at most `capacity` bytes, and
    /// restore the newest whole one, if there is one of this type.
    ///
    /// # Errors
    /// When the file can be neither read nor made.
    pub fn open<T: DeserializeOwned>(
        path: &Path,
        capacity: usize,
    ) -> Result<(Self, Option<T>), CheckpointError> {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(failed("open", path))?;
        let mut checkpoint = Self {
            file,
            path: path.to_path_buf(),
            capacity,
            sequence: 0,
            buffer: Vec::new(),
        };
        let mut newest: Option<(u64, T)> = None;
        for slot in 0..2 {
            if let Some((sequence, state)) = checkpoint.read_slot(slot)?
                && newest.as_ref().is_none_or(|(held, _)| *held < sequence)
            {
                newest = Some((sequence, state));
            }
        }
        if let Some((sequence, _)) = &newest {
            checkpoint.sequence = *sequence;
        }
        Ok((checkpoint, newest.map(|(_, state)| state)))
    }

    fn slot_offset(&self, slot: u64) -> u64 {
        slot * (HEADER + self.capacity) as u64
    }

    /// A slot's sequence and state; none when it was never written, or torn.
    fn read_slot<T: DeserializeOwned>(
        &self,
        slot: u64,
    ) -> Result<Option<(u64, T)>, CheckpointError> {
        let offset = self.slot_offset(slot);
        let mut bytes = vec![0; HEADER + self.capacity];
        let length =
            read_up_to(&self.file, &mut bytes, offset).map_err(failed("read", &self.path))?;
        Ok(decode(&bytes[..length]))
    }

    /// Save `state` in place of the older of the two held.
    ///
    /// # Errors
    /// When the file system refuses, or the state is larger than was said at opening.
    pub fn save<T: Serialize>(&mut self, state: &T) -> Result<(), CheckpointError> {
        let sequence = self.sequence + 1;
        let mut bytes = std::mem::take(&mut self.buffer);
        bytes.clear();
        bytes.resize(HEADER, 0);
        let mut bytes =
            postcard::to_extend(state, bytes).map_err(|source| CheckpointError::Encode {
                file: self.path.clone(),
                source,
            })?;
        let length = bytes.len() - HEADER;
        if length > self.capacity {
            return Err(CheckpointError::TooLarge {
                file: self.path.clone(),
                capacity: self.capacity,
                length,
            });
        }
        bytes[0..4].copy_from_slice(&MAGIC.to_le_bytes());
        bytes[4..12].copy_from_slice(&sequence.to_le_bytes());
        bytes[12..16].copy_from_slice(&(length as u32).to_le_bytes());
        let crc = checksum(&bytes);
        bytes[16..20].copy_from_slice(&crc.to_le_bytes());
        self.file
            .write_all_at(&bytes, self.slot_offset(sequence % 2))
            .map_err(failed("write", &self.path))?;
        self.sequence = sequence;
        self.buffer = bytes;
        Ok(())
    }
}

pub(crate) fn failed(
    action: &'static str,
    path: &Path,
) -> impl FnOnce(io::Error) -> CheckpointError {
    let file = path.to_path_buf();
    move |source| CheckpointError::File {
        action,
        file,
        source,
    }
}

/// Over everything but the checksum itself.
fn checksum(bytes: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&bytes[..16]);
    hasher.update(&bytes[HEADER..]);
    hasher.finalize()
}

fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Option<(u64, T)> {
    let word = |at: usize| -> Option<u32> {
        bytes
            .get(at..at + 4)?
            .try_into()
            .ok()
            .map(u32::from_le_bytes)
    };
    let sequence = u64::from_le_bytes(bytes.get(4..12)?.try_into().ok()?);
    let whole = bytes.get(..HEADER + word(12)? as usize)?;
    if word(0)? != MAGIC || word(16)? != checksum(whole) {
        return None;
    }
    Some((sequence, postcard::from_bytes(&whole[HEADER..]).ok()?))
}

fn read_up_to(file: &File, bytes: &mut [u8], offset: u64) -> io::Result<usize> {
    let mut length = 0;
    while length < bytes.len() {
        match file.read_at(&mut bytes[length..], offset + length as u64) {
            Ok(0) => break,
            Ok(read) => length += read,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(length)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAPACITY: usize = 64;

    fn open(path: &Path) -> (Checkpoint, Option<Vec<u32>>) {
        Checkpoint::open(path, CAPACITY).unwrap()
    }

    #[test]
    fn the_newest_state_comes_back() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("pose");
        let (mut checkpoint, none) = open(&path);
        assert_eq!(none, None);
        for last in 1..=5_u32 {
            checkpoint.save(&vec![last; 3]).unwrap();
            assert_eq!(open(&path).1, Some(vec![last; 3]));
        }
    }

    #[test]
    fn a_save_cut_after_any_byte_leaves_the_old_state_or_the_new_one() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("pose");
        let (mut checkpoint, _) = open(&path);
        let (old, new) = (vec![7_u32; 4], vec![9_u32; 4]);
        checkpoint.save(&vec![1_u32; 6]).unwrap();
        checkpoint.save(&old).unwrap();
        let before = std::fs::read(&path).unwrap();
        checkpoint.save(&new).unwrap();
        let after = std::fs::read(&path).unwrap();
        let slot = checkpoint.slot_offset(1) as usize;
        for cut in 0..=HEADER + CAPACITY {
            let mut torn = before.clone();
            torn.resize(after.len().max(torn.len()), 0);
            let end = (slot + cut).min(after.len());
            torn[slot..end].copy_from_slice(&after[slot..end]);
            std::fs::write(&path, &torn).unwrap();
            let restored = open(&path).1;
            assert!(
                restored.as_ref() == Some(&old) || restored.as_ref() == Some(&new),
                "cut at {cut}: {restored:?}"
            );
        }
    }

    #[test]
    fn a_file_of_noise_is_no_state() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("pose");
        std::fs::write(&path, [0xA5; 300]).unwrap();
        assert_eq!(open(&path).1, None);
    }

    #[test]
    fn a_state_that_does_not_fit_is_refused_and_the_old_one_stays() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("pose");
        let (mut checkpoint, _) = open(&path);
        checkpoint.save(&vec![1_u32]).unwrap();
        assert!(matches!(
            checkpoint.save(&vec![1_u32; 100]),
            Err(CheckpointError::TooLarge { .. })
        ));
        assert_eq!(open(&path).1, Some(vec![1]));
    }
}
