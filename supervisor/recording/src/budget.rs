//! Disk budget of a recorder. Limits each file to a share and an hour; removes the oldest files.

use std::{collections::VecDeque, fs, path::PathBuf, time::Duration};

/// Files per budget, so that at least three quarters of it hold the newest samples.
const FILES: u64 = 4;
/// Maximum time in one file, so that a user opens only the hour in question.
const LONGEST: Duration = Duration::from_secs(3600);

pub(crate) struct Budget {
    bytes: u64,
    /// Complete files and their sizes, the oldest first.
    complete: VecDeque<(PathBuf, u64)>,
}

fn size(file: &PathBuf) -> u64 {
    fs::metadata(file).map_or(0, |about| about.len())
}

impl Budget {
    /// Creates a budget that includes the `earlier` files, the oldest first.
    pub(crate) fn new(bytes: u64, earlier: impl IntoIterator<Item = PathBuf>) -> Self {
        let complete = earlier.into_iter().map(|file| (file.clone(), size(&file))).collect();
        Self { bytes, complete }
    }

    pub(crate) fn ends(&self, file: &PathBuf, age: Duration) -> bool {
        age >= LONGEST || size(file) >= self.bytes / FILES
    }

    /// Counts a complete `file`, and removes the oldest until the next has room.
    pub(crate) fn complete(&mut self, file: PathBuf) {
        let its = size(&file);
        self.complete.push_back((file, its));
        let mut total: u64 = self.complete.iter().map(|(_, size)| size).sum();
        while total + self.bytes / FILES > self.bytes
            && let Some((oldest, size)) = self.complete.pop_front()
        {
            // Another process may have removed the file.
            let _ = fs::remove_file(&oldest);
            total -= size;
        }
        debug_assert_eq!(total, self.complete.iter().map(|(_, size)| size).sum::<u64>());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_files_are_removed_until_the_next_fits_in_the_budget() {
        let directory = tempfile::tempdir().unwrap();
        let file = |number: usize| directory.path().join(number.to_string());
        let write = |number, bytes| fs::write(file(number), vec![0; bytes]).unwrap();
        write(0, 30);
        let mut budget = Budget::new(100, [file(0)]);
        for number in 1..5 {
            write(number, 24);
            assert!(!budget.ends(&file(number), Duration::ZERO));
            write(number, 25);
            assert!(budget.ends(&file(number), Duration::ZERO));
            budget.complete(file(number));
        }
        let there = [0, 1, 2, 3, 4].map(|number| file(number).exists());
        assert_eq!(there, [false, false, true, true, true]);
    }

    #[test]
    fn a_file_ends_after_an_hour_however_small_it_is() {
        let budget = Budget::new(100, []);
        let none = PathBuf::from("/nonexistent");
        assert!(!budget.ends(&none, LONGEST - Duration::from_secs(1)));
        assert!(budget.ends(&none, LONGEST));
    }
}
