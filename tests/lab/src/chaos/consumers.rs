//! The consumers of one mission: processes that are hit and restarted.

use std::{
    ffi::OsStr,
    fs::{self, File},
    os::unix::ffi::OsStrExt as _,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use processes::{death::log_tail, process::Process};
use rustix::process::{Pid, Signal, kill_process_group};

use crate::chaos::{
    consumer::{Consumer, RECORD},
    kind::Kind,
    options::Options,
    report::Report,
};
use crate::error::{OrCannot as _, Result};

/// The time for a consumer to end. A recorder writes its last chunk within milliseconds; a user's program may take longer.
const ENDS_WITHIN: Duration = Duration::from_secs(5);

#[derive(Default)]
pub struct Consumers {
    all: Vec<Running>,
    /// Directory of recordings and of the consumers' standard error.
    pub directory: PathBuf,
    /// Recordings of the run's own recorder that was hit.
    pub hit_recordings: Vec<PathBuf>,
}

struct Running {
    /// None for the recorder that the run itself starts. It is not restarted within its run.
    consumer: Option<Consumer>,
    /// The process; none if it ended by itself, and for the run's recorder except while that is frozen.
    process: Option<Process>,
    starts: u32,
    frozen_until: Option<Instant>,
    said: PathBuf,
}

impl Consumers {
    /// Start all. Their files go into the new `directory`.
    pub fn start(options: &Options, directory: PathBuf, report: &mut Report) -> Result<Self> {
        fs::create_dir(&directory).or_cannot("make a directory")?;
        let mut all = Vec::new();
        for (place, consumer) in options.consumers()?.into_iter().enumerate() {
            let said = directory.join(format!("stderr-{place}"));
            let mut running =
                Running { consumer, process: None, starts: 0, frozen_until: None, said };
            running.start(&directory, report)?;
            all.push(running);
        }
        Ok(Self { all, directory, hit_recordings: Vec::new() })
    }

    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Thaw the frozen consumers whose pause is over; count those that ended by themselves.
    pub fn maintain(&mut self, report: &mut Report) -> Result {
        for running in &mut self.all {
            if running.frozen_until.is_some_and(|until| Instant::now() >= until) {
                running.thaw();
            }
            if running.consumer.is_some()
                && let Some(process) = &mut running.process
                && let Some(cause) = process.try_reap().or_cannot("reap")?
            {
                running.process = None;
                running.frozen_until = None;
                let said = log_tail(&running.said, 0);
                let counts = report.consumer(running.name());
                counts.ended_by_itself += 1;
                counts.last_end = Some(format!("{cause}: {}", said.lines().last().unwrap_or("-")));
            }
        }
        Ok(())
    }

    /// Hit the consumer at `index`: kill and restart it, or freeze it for `pause`. Returns its name and the number of its starts in this
    /// mission, or none if no signal was sent, because it is frozen already, or had ended by itself and is restarted. `supervisor` is the
    /// run's process.
    pub fn hit(
        &mut self,
        index: usize,
        kind: Kind,
        pause: Duration,
        supervisor: u32,
        report: &mut Report,
    ) -> Result<Option<(String, Option<u32>)>> {
        let freezes = kind == Kind::Freeze;
        let Some(running) = self.all.get_mut(index) else { return Ok(None) };
        if freezes && running.frozen_until.is_some() {
            return Ok(None);
        }
        let starts = running.consumer.is_some().then_some(running.starts);
        if starts.is_none() {
            running.thaw();
            let Some((recorder, recording)) = run_recorder(supervisor) else { return Ok(None) };
            self.hit_recordings.push(recording);
            running.process = Some(recorder);
        } else if running.process.is_none() {
            running.start(&self.directory, report)?;
            return Ok(None);
        }
        running.signal(kind.signal());
        let name = running.name().to_owned();
        if freezes {
            running.frozen_until = Some(Instant::now() + pause);
            report.consumer(&name).frozen += 1;
        } else {
            // Dropping the process reaps it.
            running.process = None;
            running.frozen_until = None;
            report.consumer(&name).killed += 1;
            running.start(&self.directory, report)?;
        }
        Ok(Some((name, starts)))
    }

    /// Note that the mission is over, and let all consumers write their files and end.
    pub fn end(&mut self) {
        for running in &mut self.all {
            running.thaw();
            running.signal(Signal::TERM);
        }
        for process in self.all.iter_mut().filter_map(|running| running.process.as_mut()) {
            process.end(ENDS_WITHIN);
        }
        self.all.clear();
    }
}

impl Running {
    fn name(&self) -> &str {
        self.consumer.as_ref().map_or("run's recorder", |consumer| &consumer.name)
    }

    /// Start or restart the consumer, unless it is the run's own recorder.
    fn start(&mut self, directory: &Path, report: &mut Report) -> Result {
        let Some(consumer) = &self.consumer else { return Ok(()) };
        let mut command = consumer.command();
        self.starts += 1;
        if consumer.name == RECORD {
            command.arg("--out").arg(directory.join(format!("record-{}.mcap", self.starts)));
        }
        let said = File::options().create(true).append(true).open(&self.said);
        command.stderr(said.or_cannot("write what a consumer says")?);
        self.process = Some(Process::spawn(command).or_cannot("start a consumer")?);
        report.consumer(self.name()).started += 1;
        Ok(())
    }

    /// Signal the process, if it is not reaped yet, and those that it started.
    fn signal(&self, signal: Signal) {
        let process = self.process.as_ref();
        if let Some(pid) = process.and_then(|it| Pid::from_raw(it.id().cast_signed())) {
            // A process that has ended needs no signal.
            let _ = kill_process_group(pid, signal);
        }
    }

    fn thaw(&mut self) {
        if self.frozen_until.take().is_some() {
            self.signal(Signal::CONT);
        }
        if self.consumer.is_none() {
            // The recorder is a child of the run, which reaps it.
            self.process = None;
        }
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
