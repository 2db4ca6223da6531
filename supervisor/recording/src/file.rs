//! Writer of the MCAP file.

use std::{
    collections::{BTreeMap, HashMap},
    fs::{self, File},
    io::{self, BufWriter},
    path::{Path, PathBuf},
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use common::{
    bus::Stamp,
    clock::{MissionClock, MissionTime, monotonic_ns},
    file::FileError,
    run::Run,
    topics::{AnyTopic, EVERY_STAGE, OPERATOR, Spec},
};
use mcap::{
    Compression, Summary, WriteOptions, Writer,
    records::{MessageHeader, Metadata},
};

use crate::{
    error::{RecordingError, Result},
    schema,
    viewers::{self, Channel},
};

/// Size at which a chunk is written before [`CHUNK_EVERY`], bytes.
const CHUNK_BYTES: u64 = 1 << 19;
/// Maximum interval of chunks, the loss of a killed recorder.
const CHUNK_EVERY: Duration = Duration::from_secs(1);
pub(crate) const RUN: &str = "run";
pub(crate) const LOST: &str = "recorder";
const LOST_SCHEMA: &[u8] = br#"{"title": "firsthand.Recorder", "type": "object", "properties": {"lost": {"type": "object"}}}"#;

pub(crate) struct RecordingFile {
    output: Output,
    /// Start of the mission, nanoseconds since 1970.
    began_ns: u64,
    clock: Option<MissionClock>,
    newest: MissionTime,
    chunk_began: Instant,
}

pub fn now_ns() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as u64)
}

impl RecordingFile {
    /// Makes a file `about` a `run`, with channels for `topics` and viewers' drawings.
    ///
    /// The file gets its name once these are written, so a named file is readable.
    pub(crate) fn create(
        path: &Path,
        topics: &[&'static dyn AnyTopic],
        run: Option<&Run>,
        about: BTreeMap<String, String>,
    ) -> Result<Self> {
        let named = |error: io::Error| FileError::of("make recording", path)(error);
        if path.exists() {
            return Err(named(io::ErrorKind::AlreadyExists.into()).into());
        }
        let unfinished = path.with_added_extension("new");
        let mut output = Output::create(&unfinished, "")?;
        output.path = path.to_path_buf();
        let mut recording = Self {
            output,
            began_ns: now_ns(),
            clock: run.map(|run| run.clock),
            newest: MissionTime::default(),
            chunk_began: Instant::now(),
        };
        recording.began_ns -= recording.mission_time().0.min(recording.began_ns);
        for topic in topics {
            let schema::Schema { name, text } = schema::of(*topic);
            let spec = topic.spec();
            let about = [("writer", spec.writer), ("meaning", spec.meaning.trim())];
            recording.output.add(spec.name, &name, "ros2msg", text.as_bytes(), "cdr", &about)?;
        }
        for Channel { topic, schema, descriptors } in viewers::channels(run.map(|run| &run.mission))
        {
            recording.output.add(&topic, schema, "protobuf", descriptors, "protobuf", &[])?;
        }
        recording.output.add(LOST, "firsthand.Recorder", "jsonschema", LOST_SCHEMA, "json", &[])?;
        recording.output.metadata(RUN, about)?;
        recording.flush()?;
        fs::rename(&unfinished, path).map_err(named)?;
        Ok(recording)
    }

    /// Continues the times of the file `before`.
    pub(crate) const fn continuing(mut self, before: &Self) -> Self {
        (self.began_ns, self.newest) = (before.began_ns, before.newest);
        self
    }

    fn mission_time(&self) -> MissionTime {
        match self.clock {
            Some(clock @ MissionClock::Wall { .. }) => clock.at(0, monotonic_ns()),
            _ => self.newest,
        }
    }

    /// Returns the mission time as nanoseconds since 1970.
    pub(crate) fn now_ns(&self) -> u64 {
        self.began_ns.saturating_add(self.mission_time().0)
    }

    /// Adds a topic's sample. Returns its log time.
    pub(crate) fn sample(&mut self, spec: &Spec, stamp: &Stamp, message: &[u8]) -> Result<u64> {
        let mut times = [self.now_ns(); 2];
        // An operator has no mission time; a heartbeat has the previous tick's.
        if ![OPERATOR, EVERY_STAGE].contains(&spec.writer) {
            self.newest = self.newest.max(stamp.time());
            times[1] = self.began_ns.saturating_add(stamp.stamp_ns);
            if !matches!(self.clock, Some(MissionClock::Wall { .. })) {
                times[0] = times[1];
            }
        }
        self.output.write(spec.name, stamp.sequence, times, message)?;
        Ok(times[0])
    }

    pub(crate) fn message(&mut self, topic: &str, log_ns: u64, message: &[u8]) -> Result {
        self.output.write(topic, 0, [log_ns; 2], message)
    }

    pub(crate) fn lost(&mut self, lost: &BTreeMap<&str, u64>) -> Result {
        let json = serde_json::json!({"lost": lost}).to_string();
        self.message(LOST, self.now_ns(), json.as_bytes())
    }

    pub(crate) fn flush_if_due(&mut self) -> Result {
        if self.chunk_began.elapsed() >= CHUNK_EVERY {
            self.flush()?;
        }
        Ok(())
    }

    fn flush(&mut self) -> Result {
        self.chunk_began = Instant::now();
        let Output { writer, path, .. } = &mut self.output;
        writer.flush().map_err(failed(path))
    }

    /// Writes the rest, and the summary, an index.
    pub(crate) fn finish(self) -> Result {
        self.output.finish().map(drop)
    }
}

pub(crate) struct Output {
    writer: Writer<BufWriter<File>>,
    path: PathBuf,
    channels: HashMap<String, u16>,
}

impl Output {
    pub(crate) fn create(path: &Path, profile: &str) -> Result<Self> {
        let file = File::create(path).map_err(FileError::of("make", path))?;
        let writer = WriteOptions::new()
            .profile(profile)
            .library(concat!("firsthand ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES))
            // A complete chunk is written at once and never changed.
            .disable_seeking(true)
            .create(BufWriter::new(file))
            .map_err(failed(path))?;
        Ok(Self { writer, path: path.to_path_buf(), channels: HashMap::new() })
    }

    pub(crate) fn add(
        &mut self,
        topic: &str,
        schema: &str,
        language: &str,
        text: &[u8],
        encoding: &str,
        about: &[(&str, &str)],
    ) -> Result {
        let failed = failed(&self.path);
        let about = about.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
        let added = self
            .writer
            .add_schema(schema, language, text)
            .and_then(|schema| self.writer.add_channel(schema, topic, encoding, &about));
        self.channels.insert(topic.to_owned(), added.map_err(failed)?);
        Ok(())
    }

    pub(crate) fn write(
        &mut self,
        topic: &str,
        sequence: u32,
        [log_time, publish_time]: [u64; 2],
        message: &[u8],
    ) -> Result {
        // This topic is not recorded.
        let Some(&channel_id) = self.channels.get(topic) else {
            return Ok(());
        };
        let header = MessageHeader { channel_id, sequence, log_time, publish_time };
        self.writer.write_to_known_channel(&header, message).map_err(failed(&self.path))
    }

    pub(crate) fn metadata(&mut self, name: &str, metadata: BTreeMap<String, String>) -> Result {
        let record = Metadata { name: name.to_owned(), metadata };
        self.writer.write_metadata(&record).map_err(failed(&self.path))
    }

    pub(crate) fn finish(mut self) -> Result<Summary> {
        self.writer.finish().map_err(failed(&self.path))
    }
}

fn failed(path: &Path) -> impl FnOnce(mcap::McapError) -> RecordingError + use<> {
    let file = path.to_path_buf();
    move |error| {
        let problem = match error {
            mcap::McapError::Io(error) => error.to_string(),
            other => other.to_string(),
        };
        RecordingError::Write { file, problem }
    }
}
