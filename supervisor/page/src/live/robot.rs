//! The thread that reads the bus. It waits as any consumer does, and goes on when runs end and begin.

use std::{
    fs::File,
    io,
    os::unix::fs::FileExt as _,
    path::PathBuf,
    thread,
    time::{Duration, Instant},
};

use axum::body::Bytes;
use common::{
    bus::{AnyReader, Bus, BusError, Reader},
    domain::Domain,
    follower::{Event, Follower},
    process_usage::Processes,
    run::Run,
    samples::{FieldCell, FieldHeader, TargetPoint, TargetSample},
    topics,
};
use glam::DVec2;
use planner::step::Planner;
use recording::log_files::LogFiles;
use supervisor::simulator::GROUND_TRUTH;

use super::shared::Shared;
use crate::{
    about::about,
    blob::{self, Shown},
    collector::Collector,
};

/// The interval at which a run that has ended or begun, or the end of this process, is noticed when nothing is published.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// The least interval at which maps and fields are packed.
const PACK_EVERY: Duration = Duration::from_millis(500);
const LOGS_EVERY: Duration = Duration::from_millis(500);
/// The time after which a bus that cannot be used is tried again.
const AGAIN_AFTER: Duration = Duration::from_secs(1);
/// Most bytes of the ground truth that are read at once; the bytes behind them are skipped.
const TRUTH_AT_ONCE: usize = 1 << 16;
/// The most cells of a map for which a field is computed to a target that is only looked at.
const PREVIEW_MOST_CELLS: usize = 512 * 512;

struct Readers {
    /// The readers of [`Collector::TOPICS`].
    messages: Vec<(&'static str, Box<dyn AnyReader>)>,
    /// The reader of the field, which is read only while somebody watches.
    field: Reader<FieldHeader, FieldCell>,
}

impl Readers {
    fn open(bus: &Bus) -> Result<Self, BusError> {
        let names = Collector::TOPICS.map(|topic| topic.spec().name);
        let found = names.into_iter().filter_map(|name| {
            let mut all = topics::TABLE.iter();
            all.find(|topic| topic.spec().name == name).map(|topic| (name, topic))
        });
        let messages = found.map(|(name, topic)| Ok((name, topic.recorder_reader(bus)?)));
        Ok(Self {
            messages: messages.collect::<Result<_, BusError>>()?,
            field: bus.reader(&topics::FIELD)?,
        })
    }

    fn take(&mut self, collector: &mut Collector, watched: bool) -> Result<(), BusError> {
        let mut message = Vec::new();
        for (topic, reader) in &mut self.messages {
            while reader.next_message(&mut message)?.is_some() {
                // A message that does not match its topic is not shown.
                let _ = collector.take(topic, &message);
            }
        }
        while let Some(field) = self.field.next_slice()? {
            if watched {
                collector.field(field.header(), &field);
            }
        }
        Ok(())
    }
}

/// The data of one run.
struct Reading {
    collector: Collector,
    processes: Processes,
    logs: LogFiles,
    logs_read: Instant,
    truth: Truth,
    packed: Option<Instant>,
}

impl Reading {
    /// The run of `domain`; none if its run file cannot be read.
    fn begin(domain: &Domain, shared: &Shared) -> Option<Self> {
        // The link leads to another directory when the next run begins.
        let directory = domain.run_directory().canonicalize().ok()?;
        let run = Run::load(&directory).ok()?;
        shared.lock().begin(&about(&run), run.mission.robot.address.is_none());
        Some(Self {
            collector: Collector::new(&run.mission),
            processes: Processes::default(),
            logs: LogFiles::follow(&directory, true),
            logs_read: Instant::now(),
            truth: Truth { file: directory.join(GROUND_TRUTH), read: 0, partial: Vec::new() },
            packed: None,
        })
    }

    /// Give browsers the new data.
    fn publish(&mut self, shared: &Shared) {
        let Self { collector, processes, logs, logs_read, packed, .. } = self;
        if logs_read.elapsed() >= LOGS_EVERY {
            *logs_read = Instant::now();
            logs.take(&mut |process, line| collector.log(process, line));
        }
        let usage = processes.look(&collector.processes(), Instant::now());
        collector.used(usage);
        let (rows, events) = (collector.take_rows(), collector.take_events());
        let state = collector.take_state();
        let is_due = packed.is_none_or(|packed| packed.elapsed() >= PACK_EVERY);
        let (mut map, mut field) = (None, None);
        if is_due && shared.is_watched() {
            (map, field) = (collector.take_map(), collector.take_field());
            if map.is_some() || field.is_some() {
                *packed = Some(Instant::now());
            }
        }
        let wanted = shared.lock().wanted.take();
        let preview = wanted.and_then(|target| preview(collector, DVec2::from(target)));
        let mut shown = shared.lock();
        shown.link = collector.link_says();
        rows.iter().for_each(|row| shown.row(row));
        for event in events {
            shown.event(&serde_json::json!(event));
        }
        if let Some(state) = state {
            shown.state.set(state.to_string().into());
        }
        if let Some(map) = map {
            shown.map.set(Bytes::from(map));
        }
        if let Some(field) = field {
            shown.field.set(Bytes::from(field));
        }
        if let Some(preview) = preview {
            shown.preview.set(Bytes::from(preview));
        }
    }
}

/// The field to `target` on the map that the robot believes, as its planner computes it.
fn preview(collector: &Collector, target: DVec2) -> Option<Vec<u8>> {
    let (header, cells) = collector.belief()?;
    let frame = header.part.frame();
    if cells.len() > PREVIEW_MOST_CELLS || frame.cell_at(target).is_none_or(|at| frame.is_rim(at)) {
        return None;
    }
    let mut planner = Planner::new(collector.mission());
    let sent = TargetSample {
        number: 1,
        last: 1,
        target: TargetPoint::at(target),
        ..TargetSample::default()
    };
    planner.take_target(&sent).ok()?;
    planner.take_grid(&header, cells).ok()?;
    let cells = planner.snapshot()?.cells();
    Some(blob::field(Shown::Preview, frame, &cells, target, collector.now_s()))
}

/// The lines that a simulated robot writes about itself.
struct Truth {
    file: PathBuf,
    read: u64,
    partial: Vec<u8>,
}

impl Truth {
    /// Take the newest lines; without the file there are none.
    fn take(&mut self, collector: &mut Collector) -> io::Result<()> {
        let file = File::open(&self.file)?;
        let length = file.metadata()?.len();
        let skipped = length.saturating_sub(TRUTH_AT_ONCE as u64);
        if self.read < skipped {
            (self.read, self.partial) = (skipped, Vec::new());
        }
        let mut bytes = vec![0; length.saturating_sub(self.read) as usize];
        let count = file.read_at(&mut bytes, self.read)?;
        self.read += count as u64;
        self.partial.extend_from_slice(&bytes[..count]);
        let whole = self.partial.iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1);
        let lines: Vec<u8> = self.partial.drain(..whole).collect();
        for line in String::from_utf8_lossy(&lines).lines() {
            collector.truth(line);
        }
        Ok(())
    }
}

/// Show the robot of `domain` in `shared`, from run to run, until `ended` returns true.
pub(super) fn follow(domain: &Domain, shared: &Shared, ended: &mut dyn FnMut() -> bool) {
    let mut follower = Follower::new(domain.clone(), "page", &topics::LINK, Readers::open)
        .also_on([&topics::ROSTER as _, &topics::DEATHS as _]);
    let mut reading = None;
    while !ended() {
        let taken = match follower.wait(LOOK_EVERY) {
            Ok(Event::Connected) => {
                reading = None;
                Ok(())
            }
            Ok(Event::Disconnected) => {
                shared.lock().connected = false;
                Ok(())
            }
            Ok(Event::Nothing) => Ok(()),
            Ok(Event::Samples(readers)) => {
                reading = reading.or_else(|| Reading::begin(domain, shared));
                match &mut reading {
                    Some(Reading { collector, truth, .. }) => {
                        // A robot that is not simulated writes no ground truth.
                        let _ = truth.take(collector);
                        readers.take(collector, shared.is_watched())
                    }
                    None => Ok(()),
                }
            }
            Err(error) => Err(error),
        };
        let problem = taken.err().map(|error| error.to_string()).unwrap_or_default();
        if problem != shared.lock().problem {
            if !problem.is_empty() {
                tracing::error!(problem, "the robot cannot be shown; it is tried again");
            }
            shared.lock().problem.clone_from(&problem);
        }
        if !problem.is_empty() {
            thread::park_timeout(AGAIN_AFTER);
        }
        if let Some(reading) = &mut reading {
            reading.publish(shared);
        }
    }
}
