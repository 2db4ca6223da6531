//! Replay of a recording in one pass over the file, all generations side by side.

use std::collections::BTreeMap;

use common::{
    bus::{decode_sample, decode_slice},
    clock::MissionTime,
    run::Run,
    samples::{DeathSample, HealthSample, InputsHeader, name_str},
    topics,
};
use processes::stages::{self, Stage};

use crate::{
    End, Message, Recording, Result,
    replay::{
        generation::{Generation, Setting},
        report::Report,
        samples::stamp_of,
    },
};

#[derive(Clone, Debug, Default)]
pub struct Options {
    pub stages: Vec<String>,
    /// Mission time of the first comparison. Earlier ticks are computed for the state.
    pub from: MissionTime,
    /// Run in place of the recorded one, to try another mission.
    pub run: Option<Run>,
}

/// Topic computed outside the link's step, which is not compared.
const NOT_COMPUTED: &str = "link";

pub fn replay(recording: &Recording, options: &Options) -> Result<Report> {
    let cut = match &recording.end {
        End::Complete => None,
        End::Cut { after, .. } => Some(after.as_secs_f64()),
    };
    let setting = Setting {
        run: options.run.as_ref().unwrap_or(&recording.run),
        recorded: &recording.counts,
        from: options.from,
        cut: cut.is_some(),
    };
    let chosen: Vec<&'static Stage> = stages::TABLE
        .iter()
        .filter(|stage| {
            options.stages.is_empty() || options.stages.iter().any(|name| name == stage.name)
        })
        .collect();
    let mut wanted =
        vec![topics::INPUTS.spec().name, topics::HEALTH.spec().name, topics::DEATHS.spec().name];
    for stage in &chosen {
        let outputs = stage.wiring.outputs.iter().map(|topic| topic.spec().name);
        wanted.extend(outputs.filter(|topic| *topic != NOT_COMPUTED));
    }
    let mut report = Report { cut_after_s: cut, ..Report::default() };
    for stage in &chosen {
        report.stages.entry(stage.name).or_default();
    }
    let mut generations = Generations { setting: &setting, chosen, all: BTreeMap::new() };
    for taken in recording.decoded(&wanted, |message| generations.take(message))? {
        taken?;
    }
    for ((_, stage, _), generation) in generations.all {
        let found = report.stages.entry(stage).or_default();
        if let Some(difference) = generation.end(found) {
            report.differs(difference);
        }
    }
    Ok(report)
}

struct Generations<'a> {
    setting: &'a Setting<'a>,
    chosen: Vec<&'static Stage>,
    /// Generations by stage index, stage name and number.
    all: BTreeMap<(usize, &'static str, u32), Generation<'a>>,
}

impl<'a> Generations<'a> {
    fn of(&mut self, stage: &str, number: u32) -> Option<&mut Generation<'a>> {
        let (place, stage) =
            self.chosen.iter().enumerate().find(|(_, chosen)| chosen.name == stage)?;
        let key = (place, stage.name, number);
        let new = || Generation::new(self.setting, stage, number);
        Some(self.all.entry(key).or_insert_with(new))
    }

    /// Takes a message; `None` if it is malformed.
    fn take(&mut self, message: Message) -> Option<()> {
        let topic = &*message.topic;
        if topic == topics::INPUTS.spec().name {
            let (header, piece) = decode_slice::<InputsHeader, u8>(&message.data)?;
            let stamp = header.stamp;
            if let Some(generation) = self.of(name_str(&header.stage), stamp.generation) {
                generation.piece(stamp.sequence, &piece);
            }
        } else if topic == topics::HEALTH.spec().name {
            let health: HealthSample = decode_sample(&message.data)?;
            self.of(name_str(&health.stage), health.stamp.generation);
        } else if topic == topics::DEATHS.spec().name {
            let death: DeathSample = decode_sample(&message.data)?;
            self.of(name_str(&death.stage), death.generation);
        } else {
            let writer = topics::find(topic).map_or("", |topic| topic.spec().writer);
            if let Some(generation) = self.of(writer, stamp_of(&message.data).generation) {
                let Message { topic, sequence, data, .. } = message;
                generation.output(&topic, sequence, data);
            }
        }
        Some(())
    }
}
