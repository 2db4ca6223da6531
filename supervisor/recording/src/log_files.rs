//! New lines in the logs of a run's processes.

use std::{
    collections::HashMap,
    fs::{self, File},
    os::unix::fs::FileExt as _,
    path::{Path, PathBuf},
};

/// Most bytes read of one log at once.
const AT_ONCE: usize = 1 << 16;

/// Reader of the lines appended to a file.
#[derive(Debug, Default)]
pub struct Tail {
    read: u64,
    partial: Vec<u8>,
}

impl Tail {
    /// Returns the new whole lines of `file`, at most 64 KiB at once.
    pub fn lines(&mut self, file: &Path) -> String {
        let mut bytes = vec![0; AT_ONCE];
        let length = File::open(file)
            .and_then(|file| file.read_at(&mut bytes, self.read))
            .unwrap_or_default();
        self.read += length as u64;
        self.partial.extend_from_slice(&bytes[..length]);
        let whole = self.partial.iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1);
        // A line without an end is returned in parts.
        let is_endless = whole == 0 && self.partial.len() > AT_ONCE;
        let given = if is_endless { self.partial.len() } else { whole };
        let lines: Vec<u8> = self.partial.drain(..given).collect();
        debug_assert!(!self.partial.contains(&b'\n'));
        assert!(self.partial.len() <= AT_ONCE);
        String::from_utf8_lossy(&lines).into_owned()
    }

    /// Skips unread content of `file` except its last `most` bytes.
    pub fn skip(&mut self, file: &Path, most: u64) {
        let from = file.metadata().map_or(0, |file| file.len()).saturating_sub(most);
        if self.read < from {
            *self = Self { read: from, partial: Vec::new() };
        }
    }
}

#[derive(Debug)]
pub struct LogFiles {
    directory: PathBuf,
    read: HashMap<PathBuf, Tail>,
}

impl LogFiles {
    /// Follows logs from their beginning, or only from their present ends.
    pub fn follow(directory: &Path, from_the_beginning: bool) -> Self {
        let mut files = Self { directory: directory.to_path_buf(), read: HashMap::new() };
        if !from_the_beginning {
            for file in files.files() {
                files.read.entry(file.clone()).or_default().skip(&file, 0);
            }
        }
        files
    }

    fn files(&self) -> Vec<PathBuf> {
        fs::read_dir(&self.directory)
            .into_iter()
            .flatten()
            .flatten()
            .map(|entry| entry.path())
            .filter(|file| file.extension().is_some_and(|extension| extension == "log"))
            .collect()
    }

    /// Returns process and text of every new line. An unreadable log is retried later.
    pub fn take(&mut self) -> Vec<(String, String)> {
        let mut taken = Vec::new();
        for file in self.files() {
            let lines = self.read.entry(file.clone()).or_default().lines(&file);
            let process = file.file_stem().unwrap_or_default().to_string_lossy();
            taken.extend(lines.lines().map(|line| (process.to_string(), line.to_owned())));
        }
        taken
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write as _;

    #[test]
    fn each_whole_line_is_given_once() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("mapper.log");
        let mut log = File::options().create(true).append(true).open(&path).unwrap();
        let mut files = LogFiles::follow(directory.path(), true);
        let mut take = || {
            let lines = files.take().into_iter();
            lines.map(|(process, line)| format!("{process}: {line}")).collect::<Vec<_>>()
        };
        log.write_all(b"one\ntw").unwrap();
        assert_eq!(take(), ["mapper: one"]);
        log.write_all(b"o\n").unwrap();
        assert_eq!(take(), ["mapper: two"]);
        assert!(take().is_empty());
    }
}
