//! Lines that the processes of a run append to their logs, in the run directory.

use std::{
    collections::HashMap,
    fs::{self, File},
    io::Read as _,
    os::unix::fs::FileExt as _,
    path::{Path, PathBuf},
};

/// Most bytes that are read of one log at once.
const AT_ONCE: usize = 1 << 16;

#[derive(Debug)]
pub struct LogFiles {
    directory: PathBuf,
    /// The position in each log, and its incomplete last line.
    read: HashMap<PathBuf, (u64, Vec<u8>)>,
}

impl LogFiles {
    /// Follow logs from their beginning, or only from their present ends on.
    pub fn follow(directory: &Path, from_the_beginning: bool) -> Self {
        let mut files = Self { directory: directory.to_path_buf(), read: HashMap::new() };
        if !from_the_beginning {
            for file in files.files() {
                let length = file.metadata().map_or(0, |file| file.len());
                files.read.insert(file, (length, Vec::new()));
            }
        }
        files
    }

    fn files(&self) -> Vec<PathBuf> {
        let entries = fs::read_dir(&self.directory).into_iter().flatten().flatten();
        let files = entries.map(|entry| entry.path());
        files.filter(|file| file.extension().is_some_and(|extension| extension == "log")).collect()
    }

    /// Call `each` with the process and the text of every new line. A log that cannot be read is tried again later.
    pub fn take(&mut self, each: &mut dyn FnMut(&str, &str)) {
        for file in self.files() {
            let process = file.file_stem().map(|name| name.to_string_lossy().into_owned());
            let (at, partial) = self.read.entry(file.clone()).or_default();
            let Ok(log) = File::open(&file) else {
                continue;
            };
            let mut bytes = vec![0; AT_ONCE];
            let Ok(length) = log.read_at(&mut bytes, *at) else {
                continue;
            };
            *at += length as u64;
            partial.extend_from_slice(&bytes[..length]);
            let whole = partial.iter().rposition(|&byte| byte == b'\n');
            let Some(whole) = whole.or((partial.len() > AT_ONCE).then(|| partial.len() - 1)) else {
                continue;
            };
            let lines: Vec<u8> = partial.drain(..=whole).collect();
            for line in String::from_utf8_lossy(&lines).lines() {
                each(process.as_deref().unwrap_or_default(), line);
            }
        }
    }
}

/// The text of `file`, at most `most` bytes.
pub(crate) fn text(file: &Path, most: u64) -> Option<String> {
    let mut text = String::new();
    File::open(file).ok()?.take(most).read_to_string(&mut text).ok()?;
    Some(text)
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
            let mut lines = Vec::new();
            files.take(&mut |process, line| lines.push(format!("{process}: {line}")));
            lines
        };
        log.write_all(b"one\ntw").unwrap();
        assert_eq!(take(), ["mapper: one"]);
        log.write_all(b"o\n").unwrap();
        assert_eq!(take(), ["mapper: two"]);
        assert!(take().is_empty());
    }
}
