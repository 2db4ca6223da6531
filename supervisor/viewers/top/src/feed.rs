//! The readers of the screen on the bus.

use std::time::{Duration, Instant};

use common::{
    bus::{AnyReader, Bus, BusError, Reader},
    process_usage::Processes,
    samples::{
        CommandSample, DeathSample, FieldCell, FieldHeader, GridHeader, GuidanceSample, LinkSample,
        PoseSample, PowerSample, RosterEntry, RosterHeader, StallSample, TargetSample, name_str,
    },
    topics,
};
use processes::stages;

use super::{view::View, words};
use console::rates::TopicRates;

/// The time over which rates are counted.
const COUNT_FOR: Duration = Duration::from_secs(1);

pub(super) struct Feed {
    roster: Reader<RosterHeader, RosterEntry>,
    pose: Reader<PoseSample>,
    grid: Reader<GridHeader, u8>,
    field: Reader<FieldHeader, FieldCell>,
    target: Reader<TargetSample>,
    guidance: Reader<GuidanceSample>,
    command: Reader<CommandSample>,
    link: Reader<LinkSample>,
    power: Reader<PowerSample>,
    deaths: Reader<DeathSample>,
    stalls: Reader<StallSample>,
    outputs: Vec<Output>,
    processes: Processes,
    counted: Instant,
}

/// The first topic that a stage writes.
struct Output {
    stage: &'static str,
    reader: Box<dyn AnyReader>,
    rates: TopicRates,
    rate_hz: Option<f64>,
}

impl Feed {
    pub(super) fn open(bus: &Bus) -> Result<Self, BusError> {
        let now = Instant::now();
        let first_outputs = stages::TABLE.iter().filter_map(|stage| {
            let first = stage.wiring.outputs.first()?.spec().name;
            let mut all = topics::TABLE.iter();
            Some((stage.name, all.find(|topic| topic.spec().name == first)?))
        });
        let outputs = first_outputs.map(|(stage, topic)| {
            Ok(Output {
                stage,
                reader: topic.any_reader(bus)?,
                rates: TopicRates::new(topic.spec(), now),
                rate_hz: None,
            })
        });
        Ok(Self {
            roster: bus.reader(&topics::ROSTER)?,
            pose: bus.reader(&topics::POSE)?,
            grid: bus.reader(&topics::GRID)?,
            field: bus.reader(&topics::FIELD)?,
            target: bus.reader(&topics::TARGET)?,
            guidance: bus.reader(&topics::GUIDANCE)?,
            command: bus.reader(&topics::COMMAND)?,
            link: bus.reader(&topics::LINK)?,
            power: bus.reader(&topics::POWER)?,
            deaths: bus.reader(&topics::DEATHS)?,
            stalls: bus.reader(&topics::STALLS)?,
            outputs: outputs.collect::<Result<_, BusError>>()?,
            processes: Processes::default(),
            counted: now,
        })
    }

    /// Bring `view` up to date.
    pub(super) fn take(&mut self, view: &mut View) -> Result<(), BusError> {
        while let Some(pose) = self.pose.next_sample()? {
            view.on_pose(pose);
        }
        while let Some(grid) = self.grid.next_slice()? {
            view.grid.apply(&grid.header().part, &grid);
        }
        while let Some(field) = self.field.next_slice()? {
            view.field.apply(&field.header().part, &field);
        }
        if let Some(target) = self.target.newest()? {
            let points = [target.target].into_iter().chain(target.ahead().to_vec());
            view.targets = points.map(|point| point.position()).collect();
        }
        view.guidance = self.guidance.newest()?.or(view.guidance);
        view.command = self.command.newest()?.or(view.command);
        view.link = self.link.newest()?.or(view.link);
        view.power = self.power.newest()?.or(view.power);
        while let Some(death) = self.deaths.next_sample()? {
            view.on_event(words::death(&death));
        }
        while let Some(stall) = self.stalls.next_sample()? {
            view.on_event(words::stall(&stall));
        }
        let mut roster = None;
        while let Some(newest) = self.roster.next_slice()? {
            roster = Some(newest);
        }
        if let Some(roster) = roster {
            view.on_roster(*roster.header(), &roster);
            self.look_at_processes(view);
        }
        self.count(view)
    }

    fn look_at_processes(&mut self, view: &mut View) {
        let supervisor = view.supervisor.map_or(0, |header| header.supervisor_pid);
        let stages = view.stages.iter().map(|stage| stage.entry.pid);
        let processes: Vec<_> = stages.chain([supervisor]).collect();
        let mut usages = self.processes.look(&processes, Instant::now()).into_iter();
        for stage in &mut view.stages {
            stage.usage = usages.next().unwrap_or_default();
        }
        view.supervisor_usage = usages.next().unwrap_or_default();
    }

    fn count(&mut self, view: &mut View) -> Result<(), BusError> {
        let now = Instant::now();
        let due = now.saturating_duration_since(self.counted) >= COUNT_FOR;
        for output in &mut self.outputs {
            while let Some(sample) = output.reader.next_sample()? {
                output.rates.add(sample.author(), *sample.stamp(), now);
            }
            if due {
                output.rate_hz = Some(output.rates.report(now).rate_hz);
            }
        }
        if due {
            self.counted = now;
        }
        for stage in &mut view.stages {
            let name = name_str(&stage.entry.stage);
            let its = self.outputs.iter().find(|output| output.stage == name);
            stage.rate_hz = its.and_then(|output| output.rate_hz);
        }
        Ok(())
    }
}
