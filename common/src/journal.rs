//! Large state that survives a SIGKILL: occasional snapshots, and the entries since.
//!
//! The state is the fold of its entries. Appending one is a small write at any size of the state;
//! a new process folds those after the snapshot.
//!
//! An entry is `number | length | version | crc32 | body`, little-endian. Like a [`Checkpoint`],
//! the journal refuses a whole one of another version. A kill during an append leaves a torn tail,
//! which is cut off. A kill between a snapshot and the emptying of the journal leaves entries that
//! the snapshot includes, as their numbers show.
//!
//! Opening reserves space in case the disk fills up. An end mark empties the journal, because
//! truncation would release the space.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::{
    checkpoint::{
        Checkpoint, CheckpointError, VERSION, checksum, encode_after, open_reserved, other_version,
    },
    file::{FileError, Store},
};

/// Least and greatest number of entries before a snapshot.
const SNAPSHOT_AFTER: (u64, u64) = (8, 128);
/// Bytes of state per additional entry before a snapshot. A new process folds an entry in about the
/// time to write them.
const BYTES_FOR_AN_ENTRY: u64 = 20_480;
/// number u64, length u24, version u8, crc32 u32.
const HEADER: usize = 16;
/// End mark. No header is all zeros, because the checksum of zeros is not 0.
const END: [u8; HEADER] = [0; HEADER];
/// Most bytes of an entry: twice the mapper's with a scan of the most beams.
const LONGEST: usize = 131_072;
/// Most bytes of the number of the next entry, which precedes the state in a snapshot.
const NUMBER: usize = 10;

#[derive(Debug)]
pub struct Journal {
    snapshots: Checkpoint,
    file: Store,
    path: PathBuf,
    end: u64,
    number: u64,
    first: u64,
    snapshot_after: u64,
}

#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Restored<S, E> {
    pub state: Option<S>,
    /// Oldest first.
    pub entries: Vec<E>,
}

impl Journal {
    /// Opens or creates the snapshot at `path`, for encoded states of at most `capacity` bytes, and
    /// the journal beside it. It has space for entries of `entry_bytes` until the next snapshot.
    pub fn open<S: DeserializeOwned, E: DeserializeOwned>(
        path: &Path,
        capacity: usize,
        entry_bytes: usize,
    ) -> Result<(Self, Restored<S, E>), CheckpointError> {
        let (snapshots, snapshot) = Checkpoint::open::<(u64, S)>(path, capacity + NUMBER)?;
        let path = path.with_extension("journal");
        let snapshot_after = snapshot_after(capacity);
        let file = open_reserved(&path, snapshot_after * (HEADER + entry_bytes) as u64)?;
        let (first, state) = snapshot.unzip();
        let first = first.unwrap_or_default();
        let mut journal =
            Self { snapshots, file, path, end: 0, number: first, first, snapshot_after };
        let entries = journal.read()?;
        Ok((journal, Restored { state, entries }))
    }

    /// Cuts the file after the last whole entry. Fails on a whole one of another version.
    fn read<E: DeserializeOwned>(&mut self) -> Result<Vec<E>, CheckpointError> {
        let bytes = self.file.read(0, u64::MAX);
        let bytes = bytes.map_err(FileError::of("read checkpoint", &self.path))?;
        let mut entries = Vec::new();
        let mut rest = &bytes[..];
        let foreign = |problem| CheckpointError::Foreign { file: self.path.clone(), problem };
        while let Some((number, version, body, after)) = entry(rest) {
            if version != VERSION {
                return Err(foreign(other_version(version)));
            }
            // The snapshot includes lower numbers. Entries after a gap cannot be folded.
            if number == self.number {
                let entry = postcard::from_bytes(body);
                let undecoded = |error| foreign(format!("an entry cannot be decoded: {error}"));
                entries.push(entry.map_err(undecoded)?);
                self.number += 1;
            } else if number > self.number {
                break;
            }
            rest = after;
        }
        self.end = (bytes.len() - rest.len()) as u64;
        // A whole tail stays, because cutting it may wait for the disk.
        if !rest.is_empty() && !rest.starts_with(&END) {
            self.write(&END)?;
        }
        Ok(entries)
    }

    fn write(&self, bytes: &[u8]) -> Result<(), CheckpointError> {
        let written = self.file.write(bytes, self.end);
        Ok(written.map_err(FileError::of("write checkpoint", &self.path))?)
    }

    /// Fails if the entry is too long, or cannot be encoded or written.
    pub fn append<E: Serialize>(&mut self, entry: &E) -> Result<(), CheckpointError> {
        let mut bytes = encode_after(vec![0; HEADER], entry, LONGEST, &self.path)?;
        const { assert!(LONGEST < 1 << 24 && HEADER == 8 + 3 + 1 + 4) };
        let length = bytes.len() - HEADER;
        bytes.extend_from_slice(&END);
        bytes[..8].copy_from_slice(&self.number.to_le_bytes());
        bytes[8..11].copy_from_slice(&(length as u32).to_le_bytes()[..3]);
        bytes[11] = VERSION;
        let end = HEADER + length;
        let crc = checksum(&bytes[..end], 12);
        bytes[12..16].copy_from_slice(&crc.to_le_bytes());
        self.write(&bytes)?;
        self.end += end as u64;
        self.number += 1;
        Ok(())
    }

    /// Returns whether a snapshot is due. Take it when no process waits: it writes the whole state.
    pub const fn is_long(&self) -> bool {
        self.number - self.first >= self.snapshot_after
    }

    /// Takes the fold of all entries.
    pub fn snapshot<S: Serialize>(&mut self, state: &S) -> Result<(), CheckpointError> {
        self.snapshots.save(&(self.number, state))?;
        self.first = self.number;
        self.end = 0;
        self.write(&END)
    }
}

fn snapshot_after(capacity: usize) -> u64 {
    const { assert!(0 < SNAPSHOT_AFTER.0 && SNAPSHOT_AFTER.0 < SNAPSHOT_AFTER.1) };
    let (soonest, latest) = SNAPSHOT_AFTER;
    (capacity as u64 / BYTES_FOR_AN_ENTRY).clamp(soonest, latest)
}

fn entry(bytes: &[u8]) -> Option<(u64, u8, &[u8], &[u8])> {
    let number = u64::from_le_bytes(bytes.get(..8)?.try_into().ok()?);
    let &[low, middle, high, version] = bytes.get(8..12)? else { return None };
    let length = u32::from_le_bytes([low, middle, high, 0]) as usize;
    let crc = u32::from_le_bytes(bytes.get(12..16)?.try_into().ok()?);
    if length > LONGEST {
        return None;
    }
    let (whole, after) = bytes.split_at_checked(HEADER + length)?;
    (checksum(whole, 12) == crc).then(|| (number, version, &whole[HEADER..], after))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    type Sum = u64;

    fn open(path: &Path) -> (Journal, Restored<Sum, u64>) {
        Journal::open(path, 64, 4_592).unwrap()
    }

    /// Returns the paths of a snapshot and of its journal, and that journal.
    fn files() -> (tempfile::TempDir, PathBuf, PathBuf, Journal) {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("map.checkpoint");
        let file = path.with_extension("journal");
        let (journal, _) = open(&path);
        (directory, path, file, journal)
    }

    /// Returns the state as a new process restores it.
    fn folded(path: &Path) -> Sum {
        let restored = open(path).1;
        restored.state.unwrap_or_default() + restored.entries.iter().sum::<u64>()
    }

    #[test]
    fn a_new_process_folds_the_entries_into_the_snapshot() {
        let (_directory, path, ..) = files();
        let mut sum = 0;
        for restart in 0..5 {
            let (mut journal, _) = open(&path);
            for entry in 1..=3 {
                journal.append(&entry).unwrap();
                sum += entry;
                if restart == 2 && entry == 2 {
                    journal.snapshot(&sum).unwrap();
                }
            }
            assert_eq!(folded(&path), sum, "restart {restart}");
        }
    }

    #[test]
    fn an_append_cut_after_any_byte_or_with_any_bit_changed_loses_that_entry_and_noise_is_none() {
        let (_directory, path, file, mut journal) = files();
        journal.append(&100_u64).unwrap();
        let before = fs::read(&file).unwrap().len() - HEADER;
        journal.append(&200_u64).unwrap();
        let whole = fs::read(&file).unwrap();
        let end = whole.len() - HEADER;
        for cut in before..=whole.len() {
            fs::write(&file, &whole[..cut]).unwrap();
            let mut sum = if cut >= end { 300 } else { 100 };
            assert_eq!(folded(&path), sum, "cut at {cut}");
            // The next process overwrites the torn tail.
            open(&path).0.append(&7_u64).unwrap();
            sum += 7;
            assert_eq!(folded(&path), sum, "cut at {cut}");
        }
        for bit in 8 * before..8 * end {
            let mut changed = whole.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            fs::write(&file, &changed).unwrap();
            assert_eq!(folded(&path), 100, "bit {bit}");
        }
        fs::write(file, [0xA5; 300]).unwrap();
        assert_eq!(folded(&path), 0);
    }

    #[test]
    fn a_whole_entry_of_another_version_or_type_is_refused_and_not_cut_off() {
        let (_directory, path, file, mut journal) = files();
        journal.append(&100_u64).unwrap();
        let refused = Journal::open::<Sum, [String; 3]>(&path, 64, 4_592).unwrap_err().to_string();
        assert!(
            refused.contains("map.journal") && refused.contains("cannot be decoded"),
            "{refused}"
        );
        let mut bytes = fs::read(&file).unwrap();
        bytes[11] = b'1';
        let end = bytes.len() - END.len();
        let crc = checksum(&bytes[..end], 12).to_le_bytes();
        bytes[12..16].copy_from_slice(&crc);
        fs::write(file, bytes).unwrap();
        let refused = Journal::open::<Sum, u64>(&path, 64, 4_592).unwrap_err().to_string();
        assert!(
            refused.contains("map.journal") && refused.contains("version 1, not 3"),
            "{refused}"
        );
    }

    #[test]
    fn entries_the_snapshot_holds_are_not_folded_twice() {
        let (_directory, path, file, mut journal) = files();
        for entry in 1..=4_u64 {
            journal.append(&entry).unwrap();
        }
        let full = fs::read(&file).unwrap();
        journal.snapshot(&10_u64).unwrap();
        // The process was killed before the journal was emptied.
        fs::write(&file, &full).unwrap();
        assert_eq!(folded(&path), 10);
        open(&path).0.append(&5_u64).unwrap();
        assert_eq!(folded(&path), 15);
    }

    #[test]
    fn a_snapshot_is_due_after_so_many_entries_and_not_before() {
        let (_directory, .., mut journal) = files();
        for entry in 0..snapshot_after(64) {
            assert!(!journal.is_long(), "after {entry}");
            journal.append(&entry).unwrap();
        }
        assert!(journal.is_long());
        journal.snapshot(&0_u64).unwrap();
        assert!(!journal.is_long());
    }
}
