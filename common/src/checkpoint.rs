//! State that survives a SIGKILL: a small file of two slots, written in turn.
//!
//! Each slot is `magic | sequence | length | crc32 | body`, little-endian. A save overwrites the
//! older slot, so a kill leaves one whole, as the checksum shows. Saves are not synced: the kernel
//! keeps a killed process's writes, and a power failure resets the encoder counts anyway. Opening
//! reserves space for both slots, so saves succeed on a full disk.
//!
//! The magic ends with the version of the states. A whole state of another version or type is
//! refused rather than silently lost.

use std::path::{Path, PathBuf};

use serde::{Serialize, de::DeserializeOwned};
use thiserror::Error;

use crate::file::{FileError, Store};

#[derive(Debug, Error)]
pub enum CheckpointError {
    #[error("{0}; check that the run directory is writable and has space")]
    File(#[from] FileError),
    #[error(
        "checkpoint {file} holds at most {capacity} bytes, and the state has {length}; report this fault of the stage"
    )]
    TooLarge { file: PathBuf, capacity: usize, length: usize },
    #[error(
        "checkpoint {file} was written by another version of this program ({problem}); use that version, which `run.toml` beside it names, or start a new run"
    )]
    Foreign { file: PathBuf, problem: String },
    #[error("cannot encode checkpoint {file}: {source}; report this fault of the stage")]
    Encode { file: PathBuf, source: postcard::Error },
}

/// "firsthand checkpoint", before the version.
const MAGIC: [u8; 3] = *b"FHC";
/// Format version. Raise it when the encoding of any process's state or journal entry changes.
pub const VERSION: u8 = b'3';
/// magic u32, sequence u64, length u32, crc32 u32.
const HEADER: usize = 20;

#[derive(Debug)]
pub struct Checkpoint {
    file: Store,
    path: PathBuf,
    capacity: usize,
    sequence: u64,
    buffer: Vec<u8>,
}

impl Checkpoint {
    /// Opens or creates the checkpoint at `path`, for encoded states of at most `capacity` bytes,
    /// and restores the newest.
    ///
    /// # Errors
    /// If the file cannot be read or created, or holds a whole state of another version or type.
    pub fn open<T: DeserializeOwned>(
        path: &Path,
        capacity: usize,
    ) -> Result<(Self, Option<T>), CheckpointError> {
        let file = open_reserved(path, 2 * (HEADER + capacity) as u64)?;
        let mut checkpoint =
            Self { file, path: path.to_path_buf(), capacity, sequence: 0, buffer: Vec::new() };
        let slots = [checkpoint.read_slot(0)?, checkpoint.read_slot(1)?];
        let newest = slots.into_iter().flatten().max_by_key(|(sequence, _)| *sequence);
        let (sequence, state) = newest.unzip();
        checkpoint.sequence = sequence.unwrap_or_default();
        Ok((checkpoint, state))
    }

    fn slot_offset(&self, slot: u64) -> u64 {
        slot * (HEADER + self.capacity) as u64
    }

    fn read_slot<T: DeserializeOwned>(
        &self,
        slot: u64,
    ) -> Result<Option<(u64, T)>, CheckpointError> {
        let bytes = self
            .file
            .read(self.slot_offset(slot), (HEADER + self.capacity) as u64)
            .map_err(FileError::of("read checkpoint", &self.path))?;
        decode(&bytes)
            .map_err(|problem| CheckpointError::Foreign { file: self.path.clone(), problem })
    }

    pub fn save<T: Serialize>(&mut self, state: &T) -> Result<(), CheckpointError> {
        const { assert!(HEADER == MAGIC.len() + 1 + 8 + 4 + 4) };
        let sequence = self.sequence + 1;
        let mut bytes = std::mem::take(&mut self.buffer);
        bytes.clear();
        bytes.resize(HEADER, 0);
        let mut bytes = encode_after(bytes, state, self.capacity, &self.path)?;
        let length = bytes.len() - HEADER;
        assert!(length <= self.capacity);
        bytes[..3].copy_from_slice(&MAGIC);
        bytes[3] = VERSION;
        bytes[4..12].copy_from_slice(&sequence.to_le_bytes());
        bytes[12..16].copy_from_slice(&(length as u32).to_le_bytes());
        let crc = checksum(&bytes, 16);
        bytes[16..20].copy_from_slice(&crc.to_le_bytes());
        self.file
            .write(&bytes, self.slot_offset(sequence % 2))
            .map_err(FileError::of("write checkpoint", &self.path))?;
        self.sequence = sequence;
        self.buffer = bytes;
        Ok(())
    }
}

pub(crate) fn encode_after<T: Serialize>(
    header: Vec<u8>,
    state: &T,
    capacity: usize,
    path: &Path,
) -> Result<Vec<u8>, CheckpointError> {
    let start = header.len();
    let file = || path.to_path_buf();
    let bytes = postcard::to_extend(state, header)
        .map_err(|source| CheckpointError::Encode { file: file(), source })?;
    let length = bytes.len() - start;
    if length > capacity {
        return Err(CheckpointError::TooLarge { file: file(), capacity, length });
    }
    Ok(bytes)
}

/// Computes the checksum of all `bytes` except its own four, `at` this offset.
pub(crate) fn checksum(bytes: &[u8], at: usize) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&bytes[..at]);
    hasher.update(&bytes[at + 4..]);
    hasher.finalize()
}

/// Returns `None` for an unwritten or torn slot. An error says why a whole one is foreign.
fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<Option<(u64, T)>, String> {
    let Some(&version) = bytes.strip_prefix(&MAGIC).and_then(<[u8]>::first) else {
        return Ok(None);
    };
    if version != VERSION {
        return Err(other_version(version));
    }
    let Some((sequence, body)) = whole(bytes) else {
        return Ok(None);
    };
    let state = postcard::from_bytes(body);
    let undecoded = |error| format!("its state cannot be decoded: {error}");
    Ok(Some((sequence, state.map_err(undecoded)?)))
}

pub(crate) fn other_version(found: u8) -> String {
    let [found, known] = [found, VERSION].map(|version| version.escape_ascii().to_string());
    format!("its state has version {found}, not {known}")
}

fn whole(bytes: &[u8]) -> Option<(u64, &[u8])> {
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    let sequence = u64::from_le_bytes(bytes.get(4..12)?.try_into().ok()?);
    let whole = bytes.get(..HEADER + word(12)? as usize)?;
    (word(16)? == checksum(whole, 16)).then(|| (sequence, &whole[HEADER..]))
}

pub(crate) fn open_reserved(path: &Path, length: u64) -> Result<Store, CheckpointError> {
    Ok(Store::open(path, length).map_err(FileError::of("open checkpoint", path))?)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const CAPACITY: usize = 64;

    fn open(path: &Path) -> (Checkpoint, Option<Vec<u32>>) {
        Checkpoint::open(path, CAPACITY).unwrap()
    }

    fn saved(states: &[Vec<u32>]) -> (tempfile::TempDir, PathBuf, Checkpoint) {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("pose");
        let (mut checkpoint, _) = open(&path);
        for state in states {
            checkpoint.save(state).unwrap();
        }
        (directory, path, checkpoint)
    }

    #[test]
    fn a_save_cut_after_any_byte_leaves_the_old_state_or_the_new_one() {
        let (old, new) = (vec![7; 4], vec![9; 4]);
        let (_directory, path, mut checkpoint) = saved(&[vec![1; 6], old.clone()]);
        let before = fs::read(&path).unwrap();
        checkpoint.save(&new).unwrap();
        let after = fs::read(&path).unwrap();
        let slot = checkpoint.slot_offset(1) as usize;
        for cut in 0..=HEADER + CAPACITY {
            let mut torn = before.clone();
            torn.resize(after.len().max(torn.len()), 0);
            let end = (slot + cut).min(after.len());
            torn[slot..end].copy_from_slice(&after[slot..end]);
            fs::write(&path, &torn).unwrap();
            let restored = open(&path).1;
            assert!(
                [&old, &new].map(Some).contains(&restored.as_ref()),
                "cut at {cut}: {restored:?}"
            );
        }
    }

    #[test]
    fn the_newest_state_comes_back_of_processes_that_each_save_a_few_times() {
        let (_directory, path, _) = saved(&[]);
        let mut newest = None;
        for process in 0..6_u32 {
            let (mut checkpoint, restored) = open(&path);
            assert_eq!(restored, newest, "process {process}");
            for save in 0..=process % 3 {
                newest = Some(vec![process, save]);
                checkpoint.save(&vec![process, save]).unwrap();
            }
        }
    }

    #[test]
    fn noise_or_a_state_with_any_bit_changed_after_its_version_is_not_restored() {
        let (_directory, path, _) = saved(&[vec![7; 4], vec![9; 4]]);
        let whole = fs::read(&path).unwrap();
        // The second save filled the first slot, whose length equals that of its state.
        for bit in 8 * 4..8 * (HEADER + 5) {
            let mut changed = whole.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            fs::write(&path, &changed).unwrap();
            assert_eq!(open(&path).1, Some(vec![7; 4]), "bit {bit}");
        }
        fs::write(&path, [0xA5; 300]).unwrap();
        assert_eq!(open(&path).1, None);
    }

    #[test]
    fn a_whole_state_of_another_type_or_version_is_refused_and_not_taken_for_none() {
        let (_directory, path, checkpoint) = saved(&[vec![1]]);
        let refused = Checkpoint::open::<[String; 3]>(&path, CAPACITY).unwrap_err().to_string();
        assert!(refused.contains("cannot be decoded"), "{refused}");
        let mut bytes = fs::read(&path).unwrap();
        let slot = checkpoint.slot_offset(1) as usize;
        bytes[slot + 3] = b'1';
        fs::write(&path, bytes).unwrap();
        let refused = Checkpoint::open::<Vec<u32>>(&path, CAPACITY).unwrap_err().to_string();
        assert!(refused.contains("version 1, not 3"), "{refused}");
    }

    #[test]
    fn room_for_both_slots_is_reserved_at_opening() {
        use std::os::unix::fs::MetadataExt as _;
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("pose");
        let (_checkpoint, _) = Checkpoint::open::<Vec<u32>>(&path, 1 << 20).unwrap();
        let reserved = fs::metadata(&path).unwrap().blocks() * 512;
        assert!(reserved >= 2 << 20, "{reserved} bytes are reserved");
    }

    #[test]
    fn a_state_that_does_not_fit_is_refused_and_the_old_one_stays() {
        let (_directory, path, mut checkpoint) = saved(&[vec![1]]);
        assert!(matches!(
            checkpoint.save(&vec![1_u32; 100]),
            Err(CheckpointError::TooLarge { .. })
        ));
        assert_eq!(open(&path).1, Some(vec![1]));
    }
}
