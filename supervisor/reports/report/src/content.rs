//! Recordings of a run as a page and as metrics.

use std::{
    fs::File,
    io::{BufRead as _, BufReader, Lines, Read as _, Take},
    path::{Path, PathBuf},
};

use common::{
    ground_truth::GROUND_TRUTH,
    mission::{Mission, SensorKind},
    samples::RangeReading,
};
use mission_control::{Heard, recovery};
use page::{Collector, Recorded};
use recording::{Message, Recording, RecordingError};
use robot_state::{Kind, Sample, TOPICS};
use serde_json::{Map, Value, json};
use summary::Hearer;

use crate::{beliefs::Beliefs, measured::Measured, metrics, source};

const LOG: &str = "log";
/// Maximum bytes of ground truth: an hour at 10 Hz takes 10 MB.
const LARGEST_TRUTH: u64 = 1 << 28;
/// Least mission time between two maps, seconds.
const MAP_EVERY_S: f64 = 0.5;
/// Maximum rows, states and events of a page, from the beginning of a run; metrics count all.
const MOST: usize = 60_000;
const MOST_MAPS: usize = 2400;

#[derive(Default)]
pub(crate) struct Content {
    pub mission: Mission,
    /// Names and values: robot, build, machine and others.
    about: Vec<(&'static str, String)>,
    pub remarks: Vec<String>,
    pub summary: Map<String, Value>,
    front: Option<usize>,
    pub measured: Measured,
    pub heard: Hearer,
    collector: Collector,
    beliefs: Beliefs,
    page: Recorded,
    truth: Option<Lines<BufReader<Take<File>>>>,
    added: usize,
    maps: usize,
    map_at_s: f64,
    has_fields: bool,
}

impl Content {
    /// Reads the parts of a run in order; there is at least one.
    pub(crate) fn read(files: &[PathBuf]) -> Result<Self, RecordingError> {
        let mut content = Self::of(&Recording::open(&files[0])?);
        for file in files {
            content.part(&Recording::open(file)?)?;
        }
        Ok(content)
    }

    pub(crate) fn of(recording: &Recording) -> Self {
        let run = &recording.run;
        let mut about =
            vec![("mission", run.mission.name.clone()), ("robot", run.robot.to_string())];
        if run.mission.robot.address.is_none() {
            about.push(("seed", run.mission.seed.to_string()));
        }
        about.push(("build", recording.build.to_owned()));
        about.push(("machine", recording.machine.to_owned()));
        about.push(("began", recording.began.clone()));
        let mut page = Recorded::default();
        page.text(&json!({"about": page::about(run)}));
        let directory = source::run_directory(recording);
        Self {
            mission: run.mission.clone(),
            about,
            summary: directory.and_then(recovery::summary).unwrap_or_default(),
            front: Some(run.mission.front_row())
                .filter(|_| run.mission.front_sonar().kind == SensorKind::Cone),
            collector: Collector::new(&run.mission),
            page,
            truth: directory.and_then(truth),
            map_at_s: f64::NEG_INFINITY,
            ..Self::default()
        }
    }

    fn part(&mut self, recording: &Recording) -> Result<(), RecordingError> {
        self.remarks.extend(recording.gaps());
        let wanted: Vec<_> = TOPICS.iter().map(|topic| topic.spec().name).chain([LOG]).collect();
        recording.decoded(&wanted, |message| self.take(&message))?.collect()
    }

    fn take(&mut self, message: &Message) -> Option<()> {
        if *message.topic == *LOG {
            let (process, line) = recording::log_line(&message.data)?;
            self.collector.state.log(&process, &line, None);
            return Some(());
        }
        let sample = Sample::decoded(&message.topic, &message.data)?;
        if let Sample::Pose(_) = sample {
            while let Some(Ok(line)) = self.truth.as_mut().and_then(Iterator::next) {
                if !self.collector.truth(&line) {
                    break;
                }
            }
        }
        self.collector.apply(&sample);
        match &sample {
            Sample::Pose(pose) => self.measured.pose(pose, &self.mission),
            Sample::Ranges(_, readings) => {
                let front =
                    |reading: &&RangeReading| Some(usize::from(reading.sensor)) == self.front;
                if let Some(reading) = readings.iter().find(front) {
                    self.measured.range(reading, &self.mission);
                }
            }
            Sample::Command(command) => self.heard.hear(&Heard::Command(command)),
            Sample::Guidance(guidance) => {
                let events = &mut self.measured.safety_events;
                *events = guidance.safety_events.max(*events);
                self.heard.hear(&Heard::Guidance(guidance));
            }
            Sample::Link(link) => {
                self.heard.hear(&Heard::Link(link));
                self.add();
            }
            Sample::Grid(..) => self.add_map(),
            Sample::Field(..) => {
                let field = self.collector.take_field();
                self.has_fields |= field.is_some();
                field.iter().for_each(|field| self.page.blob(field));
            }
            _ => {}
        }
        Some(())
    }

    fn add(&mut self) {
        let (rows, events) = (self.collector.take_rows(), self.collector.state.take_events());
        let state = self.collector.take_state();
        if self.added >= MOST {
            return;
        }
        self.added += rows.len() + events.len() + usize::from(state.is_some());
        if rows.is_empty() && events.is_empty() && state.is_none() {
            return;
        }
        self.page.text(&json!({"rows": rows, "events": events, "state": state}));
    }

    fn add_map(&mut self) {
        let now_s = self.collector.state.now_s();
        if now_s < self.map_at_s + MAP_EVERY_S || self.maps == MOST_MAPS {
            return;
        }
        if let Some(map) = self.collector.take_map() {
            self.map_at_s = now_s;
            self.maps += 1;
            self.page.blob(&map);
        }
        if let Some((header, cells)) = self.collector.belief() {
            self.beliefs.push(now_s, self.collector.target(), &header, cells);
        }
    }

    pub(crate) fn html(mut self) -> String {
        self.add();
        if let Some(map) = self.collector.take_map() {
            self.page.blob(&map);
        }
        if !self.has_fields {
            if let Some((header, cells)) = self.collector.belief() {
                let target = self.collector.target();
                self.beliefs.end(self.collector.state.now_s(), target, &header, cells);
            }
            for field in self.beliefs.fields(&self.mission) {
                self.page.blob(&field);
            }
        }
        let about = self.about.iter().map(|(name, value)| json!([name, value, ""]));
        let results: Vec<_> = self
            .summary
            .get("targets")
            .and_then(Value::as_array)
            .into_iter()
            .flatten()
            .map(page::result)
            .collect();
        self.page.text(&json!({
            "metrics": metrics::rows(&self).into_iter().chain(about).collect::<Vec<_>>(),
            "results": results,
            "outcome": self.ended(),
            "kind": self.kind(),
            "remarks": self.remarks,
        }));
        self.page.html(&format!("Report: {}", self.mission.name))
    }

    fn ended(&self) -> String {
        let reason = self.summary.get("reason").and_then(Value::as_str);
        match (self.outcome(), reason) {
            (Some(outcome), Some(reason)) => format!("{outcome}: {reason}"),
            (Some(outcome), None) => outcome.to_owned(),
            (None, _) => "The recording has no summary beside it: the run's end is unknown, and the metrics are those of the recording.".to_owned(),
        }
    }

    fn kind(&self) -> Option<Kind> {
        Some(match self.outcome()? {
            "reached" => Kind::Good,
            "reached_unsure" => Kind::Note,
            _ => Kind::Bad,
        })
    }

    pub(crate) fn summed(&self, field: &str) -> Option<f64> {
        self.summary.get(field)?.as_f64()
    }

    pub(crate) fn outcome(&self) -> Option<&str> {
        self.summary.get("outcome")?.as_str()
    }
}

fn truth(directory: &Path) -> Option<Lines<BufReader<Take<File>>>> {
    let file = File::open(directory.join(GROUND_TRUTH)).ok()?;
    Some(BufReader::new(file.take(LARGEST_TRUTH)).lines())
}
