//! The consumers of one mission: processes that are hit and restarted.

use std::{
    ffi::OsStr,
    fs::{self, File},
    io::{Read as _, Seek as _, SeekFrom},
    os::unix::ffi::OsStrExt as _,
    path::{Path, PathBuf},
    process::Stdio,
    time::{Duration, Instant},
};

use common::domain::RobotName;
use processes::process::Process;
use rustix::process::{Pid, Signal, kill_process_group};

use crate::chaos::{consumer::Consumer, kind::Kind, options::Options, report::Report, terminal};
use crate::error::{OrCannot as _, Result};

/// The time for a consumer to end. A recorder writes its last chunk within milliseconds; a user's program may take longer.
const ENDS_WITHIN: Duration = Duration::from_secs(5);
const LONGEST_LINE: u64 = 500;

#[derive(Default)]
pub struct Consumers {
    all: Vec<Running>,
    setting: Option<Setting>,
    /// Recordings of the run's own recorder that was hit.
    hit_recordings: Vec<PathBuf>,
}

struct Setting {
    robot: RobotName,
    /// Directory of recordings and of the consumers' standard error.
    directory: PathBuf,
}

struct Running {
    consumer: Consumer,
    /// The process; none if it ended by itself, and for the run's recorder except while that is frozen.
    process: Option<Process>,
    starts: u32,
    frozen_until: Option<Instant>,
    said: PathBuf,
}

pub struct Hit {
    pub name: String,
    /// The number of starts in this mission; none for the run's recorder.
    pub generation: Option<u32>,
}

impl Consumers {
    /// Start all. Their files go into the new `directory`.
    pub fn start(options: &Options, directory: PathBuf, report: &mut Report) -> Result<Self> {
        let consumers = options.consumers();
        if consumers.is_empty() {
            return Ok(Self::default());
        }
        fs::create_dir(&directory).or_cannot("make a directory")?;
        let setting = Setting { robot: options.asked.robot.clone(), directory };
        let mut all = Vec::new();
        for (place, consumer) in consumers.into_iter().enumerate() {
            let mut running = Running {
                consumer,
                process: None,
                starts: 0,
                frozen_until: None,
                said: setting.directory.join(format!("stderr-{place}")),
            };
            running.start(&setting, report)?;
            all.push(running);
        }
        Ok(Self { all, setting: Some(setting), hit_recordings: Vec::new() })
    }

    pub fn len(&self) -> usize {
        self.all.len()
    }

    pub fn hit_recordings(&self) -> &[PathBuf] {
        &self.hit_recordings
    }

    pub fn other_recordings(&self) -> Vec<PathBuf> {
        let directory = self.setting.as_ref().map(|setting| &setting.directory);
        let entries = directory.and_then(|directory| fs::read_dir(directory).ok());
        let files = entries.into_iter().flatten().flatten();
        let files = files.map(|entry| entry.path());
        let mut recordings: Vec<_> =
            files.filter(|file| file.extension() == Some(OsStr::new("mcap"))).collect();
        recordings.sort();
        recordings
    }

    /// Thaw the frozen consumers whose pause is over; count those that ended by themselves.
    pub fn maintain(&mut self, report: &mut Report) -> Result {
        for running in &mut self.all {
            if running.frozen_until.is_some_and(|until| Instant::now() >= until) {
                running.thaw();
            }
            if running.consumer != Consumer::RunRecorder
                && let Some(process) = &mut running.process
                && let Some(cause) = process.try_reap().or_cannot("reap")?
            {
                running.process = None;
                running.frozen_until = None;
                let said = last_line(&running.said);
                let counts = report.consumer(running.consumer.name());
                counts.ended_by_itself += 1;
                counts.last_end = Some(match said {
                    Some(said) => format!("{cause}: {said}"),
                    None => cause.to_string(),
                });
            }
        }
        Ok(())
    }

    /// Hit the consumer at `index`: kill and restart it, or freeze it for `pause`. Returns none if no signal was sent, because
    /// it is frozen already, or had ended by itself and is restarted. `supervisor` is the run's process.
    pub fn hit(
        &mut self,
        index: usize,
        kind: Kind,
        pause: Duration,
        supervisor: u32,
        report: &mut Report,
    ) -> Result<Option<Hit>> {
        let (Some(running), Some(setting)) = (self.all.get_mut(index), &self.setting) else {
            return Ok(None);
        };
        if kind == Kind::Freeze && running.frozen_until.is_some() {
            return Ok(None);
        }
        let generation = if running.consumer == Consumer::RunRecorder {
            running.thaw();
            let Some((recorder, recording)) = run_recorder(supervisor) else {
                return Ok(None);
            };
            recorder.signal(kind.signal());
            self.hit_recordings.push(recording);
            running.process = Some(recorder);
            None
        } else {
            let Some(process) = &running.process else {
                running.start(setting, report)?;
                return Ok(None);
            };
            signal_all(process, kind.signal());
            Some(running.starts)
        };
        let name = running.consumer.name().to_owned();
        if kind == Kind::Freeze {
            running.frozen_until = Some(Instant::now() + pause);
            report.consumer(&name).frozen += 1;
        } else {
            // Dropping the process reaps it.
            running.process = None;
            running.frozen_until = None;
            report.consumer(&name).killed += 1;
            running.start(setting, report)?;
        }
        Ok(Some(Hit { name, generation }))
    }

    /// Note that the mission is over, and let all consumers write their files and end.
    pub fn end(&mut self) {
        for running in &mut self.all {
            running.thaw();
            if let Some(process) = &running.process {
                signal_all(process, Signal::TERM);
            }
        }
        for running in &mut self.all {
            if let Some(mut process) = running.process.take() {
                process.end(ENDS_WITHIN);
            }
        }
    }
}

impl Running {
    /// Start or restart the consumer, unless it is the run's own recorder.
    fn start(&mut self, setting: &Setting, report: &mut Report) -> Result {
        let Setting { robot, directory } = setting;
        let recording = directory.join(format!("record-{}.mcap", self.starts + 1));
        let Some(mut command) = self.consumer.command(robot, &recording) else {
            return Ok(());
        };
        let said = File::options().create(true).append(true).open(&self.said);
        let said = said.or_cannot("write what a consumer says")?;
        if self.consumer == Consumer::Top {
            let (reads, draws) = terminal::open().or_cannot("open a terminal")?;
            terminal::read_all(reads);
            let typed = draws.try_clone().or_cannot("open a terminal")?;
            command.stdin(typed).stdout(draws);
        } else {
            command.stdout(Stdio::null());
        }
        command.stderr(said);
        self.process = Some(Process::spawn(command).or_cannot("start a consumer")?);
        self.starts += 1;
        report.consumer(self.consumer.name()).started += 1;
        Ok(())
    }

    fn thaw(&mut self) {
        if self.frozen_until.take().is_none() {
            return;
        }
        if self.consumer == Consumer::RunRecorder {
            // The recorder is a child of the run, which reaps it.
            if let Some(recorder) = self.process.take() {
                recorder.signal(Signal::CONT);
            }
        } else if let Some(process) = &self.process {
            signal_all(process, Signal::CONT);
        }
    }
}

fn last_line(said: &Path) -> Option<String> {
    let mut file = File::open(said).ok()?;
    let length = file.metadata().ok()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(LONGEST_LINE))).ok()?;
    let mut end = Vec::new();
    file.take(LONGEST_LINE).read_to_end(&mut end).ok()?;
    let end = String::from_utf8_lossy(&end);
    let last = end.lines().rfind(|line| !line.trim().is_empty());
    last.map(str::to_owned)
}

/// Signal a child that is not reaped yet, and the processes that it started.
fn signal_all(process: &Process, signal: Signal) {
    if let Some(pid) = Pid::from_raw(process.id().cast_signed()) {
        // A process that has ended needs no signal.
        let _ = kill_process_group(pid, signal);
    }
}

/// The recorder that the run of `supervisor` started, and the file that it writes.
fn run_recorder(supervisor: u32) -> Option<(Process, PathBuf)> {
    let supervisor = supervisor.to_string();
    for pid in crate::robot::processes() {
        let line = crate::robot::command_line(pid);
        let words: Vec<&[u8]> = line.split(|&byte| byte == 0).collect();
        let after = |name: &str| {
            let at = words.iter().position(|word| *word == name.as_bytes())?;
            words.get(at + 1)
        };
        let is_its = words.get(1) == Some(&&b"record"[..])
            && after("--supervisor").is_some_and(|word| *word == supervisor.as_bytes());
        if is_its
            && let Some(recording) = after("--out")
            && let Ok(process) = Process::adopt(pid, "recorder")
        {
            return Some((process, Path::new(OsStr::from_bytes(recording)).to_path_buf()));
        }
    }
    None
}
