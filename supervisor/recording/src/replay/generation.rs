//! One generation, replayed while its inputs are read. A recorded output and its input may come in
//! either order.

use std::{
    collections::{BTreeMap, VecDeque},
    fmt::Display,
    rc::Rc,
};

use common::{
    clock::MissionTime,
    replay::{Beginning, Replay},
    run::Run,
    topics,
};
use processes::stages::Stage;

use crate::replay::{
    pieces::Pieces,
    report::{Difference, StageReport},
    samples::{tick_of, time_of},
    values,
};

/// Places of the stamp's generation and sequence in a message, after the encoding's header.
const GENERATION: usize = 20;
const SEQUENCE: usize = 24;
/// Inputs before an output that a difference shows.
const SHOWN_INPUTS: usize = 4;
/// Most characters of each input.
const SHOWN_LENGTH: usize = 600;

pub(crate) struct Setting<'a> {
    pub run: &'a Run,
    /// Counts of recorded messages by topic.
    pub recorded: &'a BTreeMap<String, u64>,
    /// Start of comparison; earlier outputs are only computed.
    pub from: MissionTime,
    pub cut: bool,
}

type Body = Rc<Vec<u8>>;

struct Computed {
    sequence: u32,
    message: Vec<u8>,
    inputs: VecDeque<Body>,
}

#[derive(Default)]
struct Channel {
    next: u32,
    computed: VecDeque<Computed>,
    recorded: VecDeque<(u32, Vec<u8>)>,
}

pub(crate) struct Generation<'a> {
    setting: &'a Setting<'a>,
    stage: &'static Stage,
    number: u32,
    pieces: Pieces,
    replay: Option<Box<dyn Replay>>,
    channels: BTreeMap<String, Channel>,
    last_inputs: VecDeque<Body>,
    not_replayed: Option<String>,
    difference: Option<Difference>,
    inputs: u64,
    compared: u64,
    unrecorded: u64,
    pieces_came: bool,
    /// Whether the generation published an output, hence took an input.
    worked: bool,
}

impl<'a> Generation<'a> {
    pub(crate) fn new(setting: &'a Setting<'a>, stage: &'static Stage, number: u32) -> Self {
        Self {
            setting,
            stage,
            number,
            pieces: Pieces::default(),
            replay: None,
            channels: BTreeMap::new(),
            last_inputs: VecDeque::new(),
            not_replayed: None,
            difference: None,
            inputs: 0,
            compared: 0,
            unrecorded: 0,
            pieces_came: false,
            worked: false,
        }
    }

    pub(crate) fn piece(&mut self, sequence: u32, piece: &[u8]) {
        self.pieces_came = true;
        if self.is_over() {
            return;
        }
        if let Err(broken) = self.pieces.push(sequence, piece) {
            self.give_up(&broken);
        }
        while !self.is_over() {
            match self.pieces.entry() {
                Ok(Some(body)) => self.entry(body),
                Ok(None) => return,
                Err(broken) => self.give_up(&broken),
            }
        }
    }

    fn entry(&mut self, body: Vec<u8>) {
        let Some(replay) = &mut self.replay else {
            let fields = self.setting.recorded.contains_key(topics::FIELD.spec().name);
            match (self.stage.replay)(Beginning { run: self.setting.run, start: &body, fields }) {
                Ok(replay) => self.replay = Some(replay),
                Err(error) => self.give_up(&error),
            }
            return;
        };
        self.inputs += 1;
        let outputs = match replay.take(&body) {
            Ok(outputs) => outputs,
            Err(error) => return self.give_up(&error),
        };
        if self.last_inputs.len() == SHOWN_INPUTS {
            self.last_inputs.pop_front();
        }
        self.last_inputs.push_back(Rc::new(body));
        assert!(self.last_inputs.len() <= SHOWN_INPUTS);
        for output in outputs {
            if !self.setting.recorded.contains_key(output.topic) {
                continue;
            }
            let channel = self.channels.entry(output.topic.to_owned()).or_default();
            let sequence = channel.next;
            channel.next = sequence.wrapping_add(1);
            let mut message = output.message;
            for (at, number) in [(GENERATION, self.number), (SEQUENCE, sequence)] {
                if let Some(field) = message.get_mut(at..at + 4) {
                    field.copy_from_slice(&number.to_le_bytes());
                }
            }
            let inputs = self.last_inputs.clone();
            channel.computed.push_back(Computed { sequence, message, inputs });
            self.compare(output.topic);
        }
    }

    pub(crate) fn output(&mut self, topic: &str, sequence: u32, message: Vec<u8>) {
        self.worked = true;
        if !self.is_over() {
            self.channels
                .entry(topic.to_owned())
                .or_default()
                .recorded
                .push_back((sequence, message));
            self.compare(topic);
        }
    }

    fn compare(&mut self, topic: &str) {
        while let Some(channel) = self.channels.get_mut(topic)
            && let Some((sequence, _)) = channel.recorded.front()
            && let Some(computed) = channel.computed.pop_front()
        {
            if computed.sequence < *sequence {
                self.unrecorded += 1;
                continue;
            }
            let Some((_, recorded)) = channel.recorded.pop_front() else {
                return;
            };
            if time_of(&recorded) < self.setting.from {
                continue;
            }
            self.compared += 1;
            if recorded != computed.message {
                self.differs(topic, &recorded, &computed);
                return;
            }
        }
    }

    fn differs(&mut self, topic: &str, recorded: &[u8], computed: &Computed) {
        let tick = tick_of(recorded);
        let (field, [was, is]) = topics::find(topic)
            .and_then(|topic| values::first_difference(topic, [recorded, &computed.message], &[]))
            .unwrap_or_default();
        let describe = |body: &Body| {
            Some(self.replay.as_ref()?.describe(body).ok()?.chars().take(SHOWN_LENGTH).collect())
        };
        self.difference = Some(Difference {
            stage: self.stage.name,
            generation: self.number,
            tick,
            topic: topic.to_owned(),
            field,
            recorded: was,
            computed: is,
            inputs: computed.inputs.iter().filter_map(describe).collect(),
        });
        self.reset();
    }

    fn is_over(&self) -> bool {
        self.not_replayed.is_some() || self.difference.is_some()
    }

    fn give_up(&mut self, why: &dyn Display) {
        self.not_replayed = Some(why.to_string());
        self.reset();
    }

    fn reset(&mut self) {
        self.pieces = Pieces::default();
        self.replay = None;
        self.channels.clear();
        self.last_inputs.clear();
    }

    pub(crate) fn end(mut self, report: &mut StageReport) -> Option<Difference> {
        if !self.is_over() && !self.setting.cut {
            self.find_what_was_not_computed();
        }
        assert!(self.not_replayed.is_none() || self.difference.is_none());
        let waiting = self.channels.values().map(|channel| channel.computed.len() as u64);
        self.unrecorded += waiting.sum::<u64>();
        report.inputs += self.inputs;
        report.compared += self.compared;
        report.unrecorded += self.unrecorded;
        if self.difference.is_some() {
            report.different += 1;
        } else if let Some(why) = self.why_not_replayed() {
            report.not_replayed.insert(self.number, why);
        } else if self.inputs == 0 {
            report.without_step += 1;
        } else {
            report.equal += 1;
        }
        self.difference
    }

    fn find_what_was_not_computed(&mut self) {
        let late = |(topic, channel): (&String, &Channel)| {
            let (_, message) = channel.recorded.front()?;
            (time_of(message) >= self.setting.from).then(|| (topic.clone(), message.clone()))
        };
        if self.replay.is_some()
            && let Some((topic, message)) = self.channels.iter().find_map(late)
        {
            let inputs = self.last_inputs.clone();
            let nothing = Computed { sequence: 0, message: Vec::new(), inputs };
            self.differs(&topic, &message, &nothing);
        }
    }

    /// Returns why the generation was not replayed; `None` if it was, or if it ended before its
    /// first input.
    fn why_not_replayed(&self) -> Option<String> {
        if self.not_replayed.is_some() || self.pieces_came || !self.worked {
            return self.not_replayed.clone();
        }
        Some(match self.stage.executable(&self.setting.run.mission) {
            Some(executable) => {
                format!("it was {}, which publishes no `inputs`", executable.display())
            }
            None => "its `inputs` are not recorded".to_owned(),
        })
    }
}
