//! Recorder: a consumer that attaches to a robot at any time, records all topics, and follows the
//! robot from run to run.
//!
//! It holds only the next chunk. On a slow disk or a busy machine, samples that overflow the bus's
//! buffers are lost and counted. No stage waits for it. A run waits for its own recorder at its
//! end, and in lockstep from time to time.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    io::{self, Read as _},
    os::fd::BorrowedFd,
    path::{Path, PathBuf},
    time::{Duration, Instant, SystemTime},
};

use common::{
    bus::{AnyReader, Bus, BusError, Logged},
    clock::MissionClock,
    domain::{Domain, RobotName},
    file,
    follower::{Event, Follower},
    run::{self, Run},
    topics::{self, AnyTopic},
};

use httpdate::fmt_http_date;

use crate::{
    budget::Budget,
    error::Result,
    file::RecordingFile,
    log_files::LogFiles,
    losses::Losses,
    places::{self, numbered},
    viewers::{self, Drawn},
};

/// Maximum interval of checks for a run. A late recorder misses the first samples.
const LOOK_EVERY: Duration = Duration::from_millis(10);
/// Maximum interval of bus reads. Events wake the recorder before a buffer is full, except for
/// scans. The scan buffer lasts 0.4 s with a laser at 40 Hz at four times its pace.
const READ_EVERY: Duration = Duration::from_millis(100);
const LOGS_EVERY: Duration = Duration::from_millis(250);
const LONGEST_RUN_FILE: u64 = 1 << 24;
/// Niceness of a recorder beside stages that answer a robot.
const NICE: i32 = 5;

#[derive(Clone)]
pub struct Options {
    pub domain: Domain,
    /// Path of the first file. The next run's is called `F-2.mcap`.
    pub out: PathBuf,
    /// Topics to record; `None` for those that the table logs.
    pub topics: Option<Vec<&'static dyn AnyTopic>>,
    /// Whether to record topics that the table logs only with fields.
    pub fields: bool,
    /// Directory of the only run to record; `None` to follow the robot from run to run.
    pub run: Option<PathBuf>,
    /// Maximum bytes of all files; the oldest are removed.
    pub budget: Option<u64>,
}

impl Options {
    /// Returns the topics with the inputs first, as [`CurrentRun::take`] needs them.
    fn sorted_topics(&self) -> Vec<&'static dyn AnyTopic> {
        let logged = |topic: &&&'static dyn AnyTopic| match topic.spec().logged {
            Logged::Yes => true,
            Logged::No => false,
            Logged::WithFields => self.fields,
        };
        let mut topics = match &self.topics {
            Some(topics) => topics.clone(),
            None => topics::TABLE.iter().filter(logged).copied().collect(),
        };
        topics.sort_by_key(|topic| topic.spec().name != topics::INPUTS.spec().name);
        topics
    }
}

/// Events for the caller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Happened<'a> {
    Attached(&'a Path),
    /// All samples before the caller's request are taken.
    CaughtUp,
    /// A file is complete, with this number of lost samples.
    Complete(&'a Path, u64),
}

/// Request of the caller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    Record,
    CatchUp,
    Stop,
}

pub trait Wishes {
    fn next_wish(&mut self) -> Wish;

    /// Returns descriptors that become readable on another request.
    fn descriptors(&self) -> Vec<BorrowedFd<'_>>;
}

fn open_readers(topics: &[&'static dyn AnyTopic], bus: &Bus) -> Result<Readers, BusError> {
    let read = |topic: &&'static dyn AnyTopic| Ok((*topic, topic.recorder_reader(bus)?));
    topics.iter().map(read).collect()
}

type TopicReader = (&'static dyn AnyTopic, Box<dyn AnyReader>);
type Readers = Vec<TopicReader>;

/// Records until the caller requests a stop, or a single run ends.
pub fn record(
    options: &Options,
    wishes: &mut dyn Wishes,
    tell: &mut dyn FnMut(Happened<'_>),
) -> Result {
    let chosen = options.sorted_topics();
    let open = |bus: &Bus| open_readers(&chosen, bus);
    let domain = options.domain.clone();
    // LINK ends a tick; three more topics wake the recorder. INPUTS marks the start of a
    // generation, which may be killed soon. The others prevent losses at their processes' ends and
    // overflow of buffers without events.
    let mut follower = Follower::new(domain, "recorder", &topics::LINK, open).also_on([
        &topics::INPUTS as &'static dyn AnyTopic,
        &topics::WIRE,
        &topics::FAULTS,
    ]);
    let mut current: Option<CurrentRun> = None;
    let mut files = 0;
    let mut supervisor = None;
    let (mut joins, mut left) = (false, false);
    let earlier = options.run.as_deref().map(places::parts).unwrap_or_default();
    let mut budget = options.budget.map(|bytes| Budget::new(bytes, earlier));
    loop {
        let wish = wishes.next_wish();
        let stopped = wish == Wish::Stop;
        const { assert!(LOOK_EVERY.as_millis() < READ_EVERY.as_millis()) };
        let patience = match wish {
            Wish::Record if current.is_some() && !joins => READ_EVERY,
            Wish::Record => LOOK_EVERY,
            Wish::CatchUp | Wish::Stop => Duration::ZERO,
        };
        match follower.wait_also_for(&wishes.descriptors(), patience)? {
            Event::Connected => (joins, left) = (true, false),
            Event::Disconnected => (joins, left) = (false, true),
            Event::Samples(_) | Event::Nothing => {}
        }
        // A bus exists before its run.
        let linked = || fs::read_link(options.domain.run_directory()).ok();
        if joins && let Some(run) = options.run.clone().or_else(linked) {
            joins = false;
            let holder = options.domain.supervisor().ok().flatten();
            if options.run.is_some() && supervisor.is_some() && supervisor != holder {
                if let Some(ended) = current.take() {
                    ended.finish(tell)?;
                }
                return Ok(());
            }
            supervisor = holder;
            // A bus recreated within the run continues the file.
            if let Some(ended) = current.take_if(|current| current.directory != run) {
                let file = ended.finish(tell)?;
                if let Some(budget) = &mut budget {
                    budget.complete(file);
                }
            }
            match &mut current {
                Some(current) => current.losses.joined_again(),
                None => {
                    files += 1;
                    current =
                        Some(CurrentRun::begin(options, &numbered(&options.out, files), run)?);
                }
            }
            if let Some(current) = &current {
                tell(Happened::Attached(&current.path));
                give_way(current.run.as_ref());
            }
        }
        if let Some(run) = &mut current {
            if let Some(readers) = follower.topics() {
                run.take(readers)?;
            }
            run.take_logs(stopped)?;
            run.file.flush_if_due()?;
            let age = run.began.elapsed();
            if let Some(budget) = budget.as_mut().filter(|budget| budget.ends(&run.path, age)) {
                // New readers get whole maps, with which the next file begins.
                if let Ok(Some(mut before)) = follower.reopen() {
                    run.take(&mut before)?;
                }
                files += 1;
                let next = match &options.run {
                    Some(directory) => places::next_place(directory),
                    None => numbered(&options.out, files),
                };
                budget.complete(run.go_on_in(&next, &chosen)?);
            }
        }
        if wish == Wish::CatchUp {
            tell(Happened::CaughtUp);
        }
        // A supervisor removes its bus some time before it ends.
        let run_over = left && !options.domain.is_supervised();
        left &= !run_over;
        if (stopped || run_over)
            && let Some(ended) = current.take()
        {
            ended.finish(tell)?;
        }
        if stopped || run_over && options.run.is_some() {
            return Ok(());
        }
    }
}

/// Recording of a run on a simulated machine.
pub struct Tape {
    options: Options,
    readers: Readers,
    current: Option<CurrentRun>,
}

impl Tape {
    /// Makes the recording `out` of the run in `directory` once that begins.
    pub fn new(robot: &RobotName, directory: PathBuf, out: PathBuf) -> Self {
        let options = Options {
            domain: robot.domain(),
            run: Some(directory),
            out,
            topics: None,
            fields: true,
            budget: None,
        };
        Self { options, readers: Vec::new(), current: None }
    }

    /// Reads from `bus`, which replaces an earlier one, from now on.
    pub fn attach(&mut self, bus: &Bus) -> Result {
        if let Some(current) = &mut self.current {
            current.take(&mut self.readers)?;
            current.losses.joined_again();
        }
        self.readers = open_readers(&self.options.sorted_topics(), bus)?;
        Ok(())
    }

    pub fn take(&mut self) -> Result {
        let directory = self.options.run.clone().unwrap_or_default();
        if self.current.is_none() && file::exists(&directory.join(run::FILE_NAME)) {
            self.current = Some(CurrentRun::begin(&self.options, &self.options.out, directory)?);
        }
        self.current.as_mut().map_or(Ok(()), |current| current.take(&mut self.readers))
    }

    pub fn finish(self) -> Result {
        self.current.map_or(Ok(()), |current| current.finish(&mut |_| {}).map(drop))
    }
}

/// Yields to stages that answer a robot, once attached. In lockstep no robot waits, and a slow
/// recorder would lose samples.
fn give_way(run: Option<&Run>) {
    let in_lockstep = run.is_some_and(|run| matches!(run.clock, MissionClock::Ticks { .. }));
    if !in_lockstep && rustix::process::getpriority_process(None).is_ok_and(|nice| nice < NICE) {
        // Otherwise the recorder competes with the stages.
        let _ = rustix::process::setpriority_process(None, NICE);
    }
}

struct CurrentRun {
    path: PathBuf,
    began: Instant,
    directory: PathBuf,
    run: Option<Run>,
    about: BTreeMap<String, String>,
    file: RecordingFile,
    drawn: Drawn,
    losses: Losses,
    logs: LogFiles,
    logs_taken: Instant,
    message: Vec<u8>,
}

impl CurrentRun {
    fn begin(options: &Options, path: &Path, directory: PathBuf) -> Result<Self> {
        let text = file::text(&directory.join(run::FILE_NAME), LONGEST_RUN_FILE);
        let run: Option<Run> = text.as_ref().and_then(|text| toml::from_str(text).ok());
        let about = [
            ("robot", options.domain.robot.to_string()),
            ("build", build()),
            ("machine", machine()),
            ("began", fmt_http_date(SystemTime::now())),
            ("run_toml", text.unwrap_or_default()),
        ];
        let mut about = BTreeMap::from(about.map(|(key, value)| (key.to_owned(), value)));
        if let Some(run) = &run {
            about.insert("mission".to_owned(), run.mission.name.clone());
            about.insert("seed".to_owned(), run.mission.seed.to_string());
        }
        let topics = options.sorted_topics();
        let file = RecordingFile::create(path, &topics, run.as_ref(), about.clone())?;
        let whole = options.run.is_some();
        let logs = LogFiles::follow(&directory, whole);
        Ok(Self {
            path: path.to_path_buf(),
            began: Instant::now(),
            directory,
            about,
            file,
            drawn: Drawn::new(run.as_ref().map(|run| run.mission.clone())),
            run,
            losses: Losses::new(whole),
            logs,
            logs_taken: Instant::now(),
            message: Vec::new(),
        })
    }

    /// Continues in another, self-contained file. Returns the completed file.
    fn go_on_in(&mut self, path: &Path, topics: &[&'static dyn AnyTopic]) -> Result<PathBuf> {
        let next = RecordingFile::create(path, topics, self.run.as_ref(), self.about.clone())?
            .continuing(&self.file);
        std::mem::replace(&mut self.file, next).finish()?;
        self.file.lost(self.losses.counts())?;
        self.began = Instant::now();
        Ok(std::mem::replace(&mut self.path, path.to_path_buf()))
    }

    /// Takes all samples. A process that ends takes unread samples along, so the first reader, that
    /// of the inputs, is reconnected before each other one: outputs are recorded only after their
    /// causes.
    fn take(&mut self, readers: &mut Readers) -> Result {
        let Some((first, others)) = readers.split_first_mut() else { return Ok(()) };
        for other in others {
            self.take_from(first)?;
            self.take_from(other)?;
        }
        self.take_from(first)?;
        if let Some(lost) = self.losses.grown() {
            self.file.lost(lost)?;
        }
        Ok(())
    }

    fn take_from(&mut self, (topic, reader): &mut TopicReader) -> Result {
        let (file, spec) = (&mut self.file, topic.spec());
        while let Some(stamp) = reader.next_message(&mut self.message)? {
            if !self.losses.came(spec, &stamp, &self.message) {
                continue;
            }
            let log_ns = file.sample(spec, &stamp, &self.message)?;
            let mut written = Ok(());
            self.drawn.message(spec.name, &self.message, log_ns, &mut |topic, message| {
                if written.is_ok() {
                    written = file.message(topic, log_ns, message);
                }
            });
            written?;
        }
        Ok(())
    }

    fn take_logs(&mut self, now: bool) -> Result {
        if !now && self.logs_taken.elapsed() < LOGS_EVERY {
            return Ok(());
        }
        self.logs_taken = Instant::now();
        let now_ns = self.file.now_ns();
        self.logs.take().into_iter().try_for_each(|(process, line)| {
            self.file.message(viewers::LOG, now_ns, &viewers::log(&process, &line, now_ns))
        })
    }

    fn finish(mut self, tell: &mut dyn FnMut(Happened<'_>)) -> Result<PathBuf> {
        self.take_logs(true)?;
        self.file.finish()?;
        tell(Happened::Complete(&self.path, self.losses.total()));
        Ok(self.path)
    }
}

fn build() -> String {
    let crc = File::open("/proc/self/exe").and_then(checksum).unwrap_or_default();
    format!("{}, executable crc32 {crc:08x}", env!("CARGO_PKG_VERSION"))
}

fn checksum(mut file: File) -> io::Result<u32> {
    let (mut crc, mut piece) = (crc32fast::Hasher::new(), vec![0; 1 << 16]);
    loop {
        match file.read(&mut piece)? {
            0 => return Ok(crc.finalize()),
            length => crc.update(&piece[..length]),
        }
    }
}

fn machine() -> String {
    let text = |file| fs::read_to_string(file).unwrap_or_default();
    let (name, system) = (text("/proc/sys/kernel/hostname"), text("/proc/sys/kernel/osrelease"));
    let processors = std::thread::available_parallelism().map_or(0, std::num::NonZero::get);
    format!(
        "{}, Linux {} {}, {processors} processors",
        name.trim(),
        system.trim(),
        std::env::consts::ARCH
    )
}

#[cfg(test)]
mod tests {
    use std::{
        sync::atomic::{AtomicUsize, Ordering::Relaxed},
        thread,
    };

    use processes::domain::DomainLock;

    use super::*;

    const PATIENCE: Duration = Duration::from_secs(30);

    impl<F: FnMut() -> Wish> Wishes for F {
        fn next_wish(&mut self) -> Wish {
            self()
        }

        fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
            Vec::new()
        }
    }

    #[test]
    fn a_recording_ends_though_its_supervisor_ends_long_after_it_removed_the_bus() {
        let domain = Domain::of("rec-late".parse().unwrap());
        let mut lock = DomainLock::acquire(domain.clone(), 1).unwrap();
        let out = tempfile::tempdir().unwrap();
        lock.link_to_run(out.path(), domain.run_directory()).unwrap();
        let options = Options {
            domain: domain.clone(),
            out: out.path().join("late.mcap"),
            topics: None,
            fields: false,
            run: None,
            budget: None,
        };
        let [rounds, attached, complete] = [const { AtomicUsize::new(0) }; 3];
        let reaches = |counter: &AtomicUsize, count| {
            let began = Instant::now();
            while counter.load(Relaxed) < count && began.elapsed() < PATIENCE {
                thread::yield_now();
            }
            counter.load(Relaxed) >= count
        };
        thread::scope(|scope| {
            let recorder = scope.spawn(|| {
                let began = Instant::now();
                let mut wish = || {
                    rounds.fetch_add(1, Relaxed);
                    // A stopped recorder also completes its file, so it is stopped only after a
                    // failure.
                    let failed = began.elapsed() > PATIENCE * 4;
                    let over = failed || complete.load(Relaxed) > 0;
                    if over { Wish::Stop } else { Wish::Record }
                };
                record(&options, &mut wish, &mut |happened| {
                    match happened {
                        Happened::Attached(_) => attached.fetch_add(1, Relaxed),
                        Happened::Complete(..) => complete.fetch_add(1, Relaxed),
                        Happened::CaughtUp => 0,
                    };
                })
            });
            assert!(reaches(&attached, 1));
            fs::remove_file(domain.middleware_config()).unwrap();
            assert!(reaches(&rounds, rounds.load(Relaxed) + 5));
            assert_eq!(complete.load(Relaxed), 0, "the supervisor has not ended");
            drop(lock);
            assert!(reaches(&complete, 1), "the recording goes on");
            recorder.join().unwrap().unwrap();
        });
    }
}
