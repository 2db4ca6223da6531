//! The data that a report takes from the recordings.

use common::{
    bus::{Layout, decode_sample, decode_slice},
    grid::{Applied, Replica},
    mission::Mission,
    samples::{
        CommandSample, GridHeader, PoseSample, RangeReading, RangesHeader, Stamp, WheelSample,
    },
    topics::{self, AnyTopic},
};
use recording::{End, Message, Recording, downsampled::Downsampled};
use serde_json::{Map, Value};

use crate::{
    beliefs::Beliefs,
    error::ReportError,
    events::Events,
    measured::Measured,
    source::{self, Source},
};

/// Most samples of a topic that are drawn.
const MOST: usize = 20_000;

pub(crate) struct Content {
    pub(crate) mission: Mission,
    pub(crate) simulated: bool,
    /// Names and values: robot, build, machine and others.
    pub(crate) about: Vec<(&'static str, String)>,
    /// Gaps of the recordings.
    pub(crate) remarks: Vec<String>,
    pub(crate) summary: Map<String, Value>,
    pub(crate) poses: Downsampled<PoseSample, MOST>,
    /// The row of the front sonar.
    front: usize,
    /// Readings of the front sonar.
    pub(crate) ranges: Downsampled<(Stamp, RangeReading), MOST>,
    pub(crate) commands: Downsampled<CommandSample, MOST>,
    pub(crate) wheels: Downsampled<WheelSample, MOST>,
    pub(crate) grid: Replica<u8>,
    /// The header of the newest grid.
    pub(crate) grid_header: GridHeader,
    pub(crate) beliefs: Beliefs,
    pub(crate) events: Events,
    pub(crate) measured: Measured,
}

impl Content {
    pub(crate) fn read(source: &Source) -> Result<Self, ReportError> {
        let first = Recording::open(&source.files[0])?;
        let mut content = Self::of(&first);
        for file in &source.files {
            content.part(&Recording::open(file)?)?;
        }
        Ok(content)
    }

    fn of(recording: &Recording) -> Self {
        let run = &recording.run;
        let simulated = run.mission.robot.address.is_none();
        let mut about =
            vec![("mission", run.mission.name.clone()), ("robot", run.robot.to_string())];
        if simulated {
            about.push(("seed", run.mission.seed.to_string()));
        }
        about.push(("build", recording.build.to_owned()));
        about.push(("machine", recording.machine.to_owned()));
        Self {
            mission: run.mission.clone(),
            simulated,
            about,
            remarks: Vec::new(),
            summary: source::summary(recording).unwrap_or_default(),
            poses: Downsampled::default(),
            front: run.mission.front_row(),
            ranges: Downsampled::default(),
            commands: Downsampled::default(),
            wheels: Downsampled::default(),
            grid: Replica::default(),
            grid_header: GridHeader::default(),
            beliefs: Beliefs::default(),
            events: Events::default(),
            measured: Measured::default(),
        }
    }

    fn part(&mut self, recording: &Recording) -> Result<(), ReportError> {
        let name = recording.path.file_name().unwrap_or_default();
        let name = name.to_string_lossy();
        if let End::Cut { after, problem } = &recording.end {
            self.remarks.push(format!(
                "{name} is cut off after {:.1} s: {problem}. What came later is not in this report.",
                after.as_secs_f64()
            ));
        }
        let lost: u64 = recording.lost.values().sum();
        if lost > 0 {
            self.remarks.push(format!("The recorder of {name} lost {lost} samples."));
        }
        for message in recording.messages(&TOPICS.map(|topic| topic.spec().name))? {
            let message = message?;
            if self.take(&message).is_none() {
                return Err(recording::RecordingError::Message {
                    file: recording.path.to_path_buf(),
                    topic: message.topic.to_string(),
                }
                .into());
            }
        }
        Ok(())
    }

    /// None if the message does not match its topic.
    fn take(&mut self, message: &Message) -> Option<()> {
        fn sample<P: Layout>(message: &Message) -> Option<P> {
            decode_sample(&message.data)
        }
        let is = |topic: &dyn AnyTopic| *message.topic == *topic.spec().name;
        if is(&topics::POSE) {
            let pose = sample(message)?;
            self.events.pose(&pose);
            if self.measured.pose(&pose, &self.mission) {
                self.poses.push(pose);
            }
        } else if is(&topics::RANGES) {
            let (header, readings) = decode_slice::<RangesHeader, RangeReading>(&message.data)?;
            let front = |reading: &&RangeReading| usize::from(reading.sensor) == self.front;
            if let Some(reading) = readings.iter().find(front) {
                self.measured.range(reading, &self.mission);
                self.ranges.push((header.stamp, *reading));
            }
        } else if is(&topics::WHEELS) {
            self.wheels.push(sample(message)?);
        } else if is(&topics::COMMAND) {
            let command = sample(message)?;
            self.measured.command(&command);
            self.events.command(&command);
            self.commands.push(command);
        } else if is(&topics::GUIDANCE) {
            let guidance = sample(message)?;
            self.measured.guidance(&guidance);
            self.events.guidance(&guidance);
        } else if is(&topics::LINK) {
            let link = sample(message)?;
            self.measured.link(&link);
            self.events.link(&link);
        } else if is(&topics::GRID) {
            let (header, cells) = decode_slice::<GridHeader, u8>(&message.data)?;
            if self.grid.apply(&header.part, &cells) != Applied::Missed {
                self.grid_header = header;
                self.beliefs.push(&header, &self.grid);
            }
        } else if is(&topics::HEALTH) {
            self.events.health(&sample(message)?);
        } else if is(&topics::DEATHS) {
            self.events.death(&sample(message)?);
        } else if is(&topics::DIRECTIVE) {
            self.events.directive(&sample(message)?);
        } else if is(&topics::STALLS) {
            self.events.stall(&sample(message)?);
        } else if is(&topics::REQUESTS) {
            self.events.request(&sample(message)?);
        } else if is(&topics::FAULTS) {
            self.events.fault(&sample(message)?);
        }
        Some(())
    }

    pub(crate) fn summed(&self, field: &str) -> Option<f64> {
        self.summary.get(field)?.as_f64()
    }

    /// How the run ended; none if that is not known.
    pub(crate) fn outcome(&self) -> Option<&str> {
        self.summary.get("outcome")?.as_str()
    }

    /// Mission time of the end, seconds.
    pub(crate) fn duration_s(&self) -> f64 {
        self.measured.time_s
    }
}

const TOPICS: [&dyn AnyTopic; 13] = [
    &topics::POSE,
    &topics::RANGES,
    &topics::WHEELS,
    &topics::COMMAND,
    &topics::GUIDANCE,
    &topics::LINK,
    &topics::GRID,
    &topics::HEALTH,
    &topics::DEATHS,
    &topics::DIRECTIVE,
    &topics::STALLS,
    &topics::REQUESTS,
    &topics::FAULTS,
];
