//! Reader of the file. It validates all content, and holds one chunk in memory.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, BufReader, Read as _},
    iter,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use common::{
    bus::{Layout, Payload, Stamped, Topic, decode_sample, decode_slice},
    file::FileError,
    run::{Run, RunError},
};
use mcap::{
    McapError,
    records::{MessageHeader, Record},
    sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions},
};

use crate::{
    error::{RecordingError, Result},
    file::{LOST, RUN},
    places::parts,
    schema,
};

/// Most bytes of a record or chunk, more than the recorder writes.
const LONGEST_RECORD: usize = 1 << 28;

#[derive(Debug, PartialEq, Eq)]
pub enum End {
    Complete,
    /// The recorder was killed, or the disk was full: the file ends after a whole chunk.
    Cut {
        after: Duration,
        problem: String,
    },
}

#[derive(Debug)]
pub struct Recording {
    pub path: PathBuf,
    pub run_text: String,
    /// Run file: mission, clock, robot.
    pub run: Run,
    pub build: String,
    pub machine: String,
    /// Attach time of the recorder; empty in older recordings.
    pub began: String,
    pub end: End,
    pub counts: BTreeMap<String, u64>,
    pub lost: BTreeMap<String, u64>,
}

#[derive(Debug)]
pub struct Message {
    pub topic: Arc<str>,
    /// Name of its schema; empty without one.
    pub kind: Arc<str>,
    /// Mission time, as nanoseconds since 1970.
    pub log_ns: u64,
    /// Counted by its writer.
    pub sequence: u32,
    pub data: Vec<u8>,
}

impl Recording {
    /// Reads run, counts and end of the recording at `path`, a file or a run's directory. Streams
    /// the file once.
    pub fn open(path: &Path) -> Result<Self> {
        if path.is_dir() {
            return match &parts(path)[..] {
                [only] => Self::open(only),
                [] => Err(RecordingError::NoRecording(path.to_path_buf())),
                [.., last] => Err(RecordingError::Several {
                    directory: path.to_path_buf(),
                    last: last.clone(),
                }),
            };
        }
        let mut records = Records::open(path)?;
        let mut about = None;
        let mut counts = BTreeMap::new();
        let mut lost = BTreeMap::new();
        let (mut from, mut to) = (u64::MAX, 0_u64);
        let problem = loop {
            match records.next() {
                Ok(Some(Record::Metadata(found))) if found.name == RUN => {
                    about.get_or_insert(found.metadata);
                }
                Ok(Some(Record::Message { header, data })) => {
                    let [topic, _] = records.topic(&header)?;
                    if &*topic == LOST {
                        lost = losses(&data).unwrap_or(lost);
                    }
                    *counts.entry(topic.to_string()).or_default() += 1;
                    from = from.min(header.log_time);
                    to = to.max(header.log_time);
                }
                Ok(Some(_)) => {}
                Ok(None) => break None,
                Err(Stop::Cut(problem)) => break Some(problem),
                Err(Stop::Error(error)) => return Err(error),
            }
        };
        let foreign =
            |problem: String| RecordingError::Foreign { file: path.to_path_buf(), problem };
        let Some(mut about) = about else {
            return Err(foreign(problem.unwrap_or_else(|| "it names no run".to_owned())));
        };
        let mut about = |key| about.remove(key).unwrap_or_default();
        let run_text: String = about("run_toml");
        let run = Run::parse(&run_text, path).map_err(|error| match error {
            RunError::Content { problem, .. } => {
                foreign(format!("its run cannot be read: {problem}"))
            }
            other => other.into(),
        })?;
        Ok(Self {
            path: path.to_path_buf(),
            run_text,
            run,
            build: about("build"),
            machine: about("machine"),
            began: about("began"),
            end: problem.map_or(End::Complete, |problem| End::Cut {
                after: Duration::from_nanos(to.saturating_sub(from)),
                problem,
            }),
            counts,
            lost,
        })
    }

    /// Returns sentences about the data missing from the recording.
    pub fn gaps(&self) -> Vec<String> {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        let mut gaps = Vec::new();
        if let End::Cut { after, problem } = &self.end {
            let after_s = after.as_secs_f64();
            gaps.push(format!(
                "{name} is cut off after {after_s:.1} s: {problem}. Later data is missing."
            ));
        }
        let lost: u64 = self.lost.values().sum();
        if lost > 0 {
            gaps.push(format!("The recorder of {name} lost {lost} samples."));
        }
        gaps
    }

    /// Returns the messages of the topics in `wanted`, or of all if empty, in file order up to a
    /// cut.
    pub fn messages(
        &self,
        wanted: &[&str],
    ) -> Result<impl Iterator<Item = Result<Message>> + use<>> {
        let wanted: Vec<_> = wanted.iter().map(|&topic| topic.to_owned()).collect();
        messages(&self.path, move |topic, _| {
            wanted.is_empty() || wanted.iter().any(|name| *name == *topic)
        })
    }

    pub fn samples<P: Payload + Stamped + Layout>(
        &self,
        topic: &'static Topic<P>,
    ) -> Result<impl Iterator<Item = Result<P>> + use<P>> {
        self.decoded(&[topic.spec().name], |message| decode_sample(&message.data))
    }

    /// Returns the headers and slices of `topic` in file order.
    pub fn slices<H: Payload + Stamped + Layout, T: Payload + Layout>(
        &self,
        topic: &'static Topic<H, T>,
    ) -> Result<impl Iterator<Item = Result<(H, Vec<T>)>> + use<H, T>> {
        self.decoded(&[topic.spec().name], |message| decode_slice(&message.data))
    }

    /// Returns what `decode` makes of the messages of the topics in `wanted`, in file order up to a
    /// cut. Its `None` is the error of a malformed message.
    pub fn decoded<S, D: FnMut(Message) -> Option<S>>(
        &self,
        wanted: &[&str],
        mut decode: D,
    ) -> Result<impl Iterator<Item = Result<S>> + use<S, D>> {
        let file = self.path.clone();
        Ok(self.messages(wanted)?.map(move |message| {
            let message = message?;
            let topic = Arc::clone(&message.topic);
            decode(message).ok_or_else(|| RecordingError::Message {
                file: file.clone(),
                topic: topic.to_string(),
            })
        }))
    }
}

/// Returns the messages of any MCAP file whose topics and kinds are `wanted`, in file order up to a
/// cut.
pub fn messages<W: Fn(&str, &str) -> bool>(
    path: &Path,
    wanted: W,
) -> Result<impl Iterator<Item = Result<Message>> + use<W>> {
    let mut records = Some(Records::open(path)?);
    Ok(iter::from_fn(move || {
        let read = records.as_mut().map_or(Ok(None), |records| records.message(&wanted));
        if !matches!(read, Ok(Some(_))) {
            records = None;
        }
        read.transpose()
    }))
}

fn losses(message: &[u8]) -> Option<BTreeMap<String, u64>> {
    let mut recorder: BTreeMap<String, _> = serde_json::from_slice(message).ok()?;
    recorder.remove("lost")
}

enum Stop {
    /// The rest is incomplete or damaged.
    Cut(String),
    Error(RecordingError),
}

struct Records {
    path: PathBuf,
    file: BufReader<File>,
    reader: LinearReader,
    schemas: BTreeMap<u16, Arc<str>>,
    /// Topics and the names of their schemas.
    channels: BTreeMap<u16, [Arc<str>; 2]>,
}

impl Records {
    fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(FileError::of("read recording", path))?;
        // A chunk is checked as a whole before its content is used.
        let options = LinearReaderOptions::default()
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LONGEST_RECORD);
        Ok(Self {
            path: path.to_path_buf(),
            file: BufReader::new(file),
            reader: LinearReader::new_with_options(options),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
        })
    }

    fn topic(&self, header: &MessageHeader) -> Result<[Arc<str>; 2]> {
        self.channels.get(&header.channel_id).cloned().ok_or_else(|| RecordingError::Foreign {
            file: self.path.clone(),
            problem: format!("channel {} is not declared", header.channel_id),
        })
    }

    /// Returns the next wanted message; `None` at the end of the file or a cut.
    fn message(&mut self, wanted: impl Fn(&str, &str) -> bool) -> Result<Option<Message>> {
        loop {
            let (header, data) = match self.next() {
                Ok(Some(Record::Message { header, data })) => (header, data),
                Ok(Some(_)) => continue,
                Ok(None) | Err(Stop::Cut(_)) => return Ok(None),
                Err(Stop::Error(error)) => return Err(error),
            };
            let [topic, kind] = self.topic(&header)?;
            if wanted(&topic, &kind) {
                let MessageHeader { log_time: log_ns, sequence, .. } = header;
                let data = data.into_owned();
                return Ok(Some(Message { topic, kind, log_ns, sequence, data }));
            }
        }
    }

    /// Returns the next record apart from schemas and channels; `None` at the end of a complete
    /// file.
    fn next(&mut self) -> Result<Option<Record<'static>>, Stop> {
        while let Some(event) = self.reader.next_event() {
            let cut = |error: McapError| Stop::Cut(error.to_string());
            match event.map_err(cut)? {
                LinearReadEvent::ReadRequest(length) => {
                    let buffer = self.reader.insert(length);
                    let read = loop {
                        match self.file.read(buffer) {
                            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                            read => break read,
                        }
                    };
                    let read = read
                        .map_err(FileError::of("read recording", &self.path))
                        .map_err(|error| Stop::Error(error.into()))?;
                    self.reader.notify_read(read);
                }
                LinearReadEvent::Record { data, opcode } => {
                    match mcap::parse_record(opcode, data).map_err(cut)? {
                        // Its samples would be decoded into wrong fields.
                        Record::Schema { header, data } if schema::differs(&header.name, &data) => {
                            let (file, schema) = (self.path.clone(), header.name);
                            return Err(Stop::Error(RecordingError::Schema { file, schema }));
                        }
                        Record::Channel(channel) => {
                            let kind = self.schemas.get(&channel.schema_id).cloned();
                            let topic = [channel.topic.into(), kind.unwrap_or_default()];
                            self.channels.insert(channel.id, topic);
                        }
                        Record::Schema { header, .. } => {
                            self.schemas.insert(header.id, header.name.into());
                        }
                        record => return Ok(Some(record.into_owned())),
                    }
                }
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use std::io::BufWriter;

    use common::topics;
    use mcap::{Writer, records::Metadata};

    use super::*;

    fn refused(schema_text: &str, run_text: &str) -> RecordingError {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("recording.mcap");
        let mut writer = Writer::new(BufWriter::new(File::create(&path).unwrap())).unwrap();
        let pose = schema::of(&topics::POSE);
        let id = writer.add_schema(&pose.name, "ros2msg", schema_text.as_bytes()).unwrap();
        writer.add_channel(id, "pose", "cdr", &BTreeMap::new()).unwrap();
        let metadata = BTreeMap::from([("run_toml".to_owned(), run_text.to_owned())]);
        writer.write_metadata(&Metadata { name: RUN.to_owned(), metadata }).unwrap();
        writer.finish().unwrap();
        Recording::open(&path).unwrap_err()
    }

    #[test]
    fn a_recording_of_another_version_is_refused_by_what_it_cannot_be_read_for() {
        let own = schema::of(&topics::POSE).text;
        let other = refused(&own.replacen("float64 x_m", "float32 x_m", 1), "");
        assert!(matches!(other, RecordingError::Schema { .. }), "{other}");
        let other = refused(&format!("# More.\n{own}"), "firsthand = '99.0.0'\nrobots = 2");
        assert!(matches!(other, RecordingError::Run(RunError::OtherVersion { .. })), "{other}");
        assert!(other.to_string().contains("99.0.0"), "{other}");
    }
}
