//! Merges log files by the time at the start of each line.

use std::{
    fs::{self, File},
    io::{self, BufRead as _, BufReader, Read as _},
    path::{Path, PathBuf},
};

const LOG: &str = ".log";
/// Bytes at which a line of any length is cut.
const LONGEST_LINE: u64 = 64 << 10;
/// Length of a time such as 2026-11-21T06:04:22.729158Z.
const TIME: usize = 27;

pub struct Logs {
    directory: PathBuf,
    /// Process to read, or `None` for all.
    process: Option<String>,
    logs: Vec<Log>,
}

struct Log {
    process: String,
    file: BufReader<File>,
    end: u64,
    position: u64,
    unfinished: Vec<u8>,
    /// Next line: time, process and text.
    head: Option<String>,
    /// UTC time of the newest line, as written, or that of the line before it.
    time: String,
}

impl Logs {
    pub fn of(directory: &Path, process: Option<&str>) -> Self {
        Self {
            directory: directory.to_path_buf(),
            process: process.map(str::to_owned),
            logs: Vec::new(),
        }
    }

    pub fn processes(directory: &Path) -> io::Result<Vec<String>> {
        let mut processes = Vec::new();
        for entry in fs::read_dir(directory)? {
            let file = entry?.file_name();
            if let Some(process) = file.to_str().and_then(|file| file.strip_suffix(LOG)) {
                processes.push(process.to_owned());
            }
        }
        processes.sort();
        Ok(processes)
    }

    /// Begins a round up to the current ends of the logs, read by [`Logs::next_line`].
    pub fn look(&mut self) -> io::Result<()> {
        for process in Self::processes(&self.directory)? {
            let wanted = self.process.as_ref().is_none_or(|only| *only == process);
            if wanted && self.logs.iter().all(|log| log.process != process) {
                let file = File::open(self.directory.join(format!("{process}{LOG}")))?;
                self.logs.push(Log {
                    process,
                    file: BufReader::new(file),
                    end: 0,
                    position: 0,
                    unfinished: Vec::new(),
                    head: None,
                    time: String::new(),
                });
            }
        }
        // Reading all lengths first keeps the order across rounds.
        for log in &mut self.logs {
            log.end = log.file.get_ref().metadata()?.len();
        }
        self.logs.iter_mut().try_for_each(Log::advance)
    }

    pub fn next_line(&mut self) -> io::Result<Option<String>> {
        let Some(log) = self
            .logs
            .iter_mut()
            .filter(|log| log.head.is_some())
            .min_by(|one, other| one.time.cmp(&other.time))
        else {
            return Ok(None);
        };
        let line = log.head.take();
        log.advance()?;
        Ok(line)
    }
}

impl Log {
    fn advance(&mut self) -> io::Result<()> {
        if self.head.is_some() {
            return Ok(());
        }
        let room = LONGEST_LINE.saturating_sub(self.unfinished.len() as u64);
        let most = room.min(self.end.saturating_sub(self.position));
        let read = (&mut self.file).take(most).read_until(b'\n', &mut self.unfinished)?;
        self.position += read as u64;
        let finished = self.unfinished.ends_with(b"\n");
        if !finished && (self.unfinished.len() as u64) < LONGEST_LINE {
            return Ok(());
        }
        let line = String::from_utf8_lossy(&self.unfinished);
        let line = line.trim_end_matches('\n');
        let text = match split_time(line) {
            Some((time, text)) => {
                time.clone_into(&mut self.time);
                text
            }
            None => line,
        };
        let text: String = text.chars().filter(|letter| !letter.is_control()).collect();
        self.head = Some(format!("{:TIME$} {:<14} {text}", self.time, self.process));
        self.unfinished.clear();
        Ok(())
    }
}

fn split_time(line: &str) -> Option<(&str, &str)> {
    let (time, text) = line.split_at_checked(TIME)?;
    let is_time = time.ends_with('Z') && time.as_bytes()[10] == b'T' && text.starts_with(' ');
    is_time.then(|| (time, text.trim_start()))
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    fn append(directory: &Path, file: &str, text: &str) {
        let file = File::options().create(true).append(true).open(directory.join(file));
        file.unwrap().write_all(text.as_bytes()).unwrap();
    }

    fn round(logs: &mut Logs) -> Vec<String> {
        logs.look().unwrap();
        let lines = std::iter::from_fn(|| logs.next_line().unwrap());
        let parted = lines.map(|line| {
            let (process, text) = line[TIME + 1..].split_at(14);
            format!("{} {}", process.trim_end(), text.trim_start())
        });
        parted.collect()
    }

    const AT: &str = "2026-11-21T06:04:22.72915";

    #[test]
    fn lines_of_all_processes_come_in_the_order_of_their_times() {
        let directory = tempfile::tempdir().unwrap();
        let directory = directory.path();
        append(directory, "b.log", &format!("{AT}1Z  INFO one\n{AT}4Z  WARN four\nand more\n"));
        append(
            directory,
            "a.log",
            &format!("{AT}2Z  INFO two\n{AT}3Z  INFO thr\u{1b}ee\n{AT}5Z  IN"),
        );
        append(directory, "c.checkpoint", "no log");
        let mut logs = Logs::of(directory, None);
        let lines = ["b INFO one", "a INFO two", "a INFO three", "b WARN four", "b and more"];
        assert_eq!(round(&mut logs), lines);
        append(directory, "a.log", "FO five\n");
        append(directory, "new.log", &format!("{AT}6Z  INFO six\n"));
        assert_eq!(round(&mut logs), ["a INFO five", "new INFO six"]);
        assert_eq!(round(&mut logs), Vec::<String>::new());
        let mut one = Logs::of(directory, Some("new"));
        assert_eq!(round(&mut one), ["new INFO six"]);
        assert_eq!(Logs::processes(directory).unwrap(), ["a", "b", "new"]);
    }

    #[test]
    fn a_line_without_end_is_cut() {
        let directory = tempfile::tempdir().unwrap();
        append(directory.path(), "a.log", &"x".repeat(3 * LONGEST_LINE as usize / 2));
        let mut logs = Logs::of(directory.path(), None);
        let lines = round(&mut logs);
        assert_eq!(lines.len(), 1);
        assert_eq!(lines[0].len() as u64, LONGEST_LINE + 2);
    }
}
