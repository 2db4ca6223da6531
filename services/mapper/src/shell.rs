//! Process of the mapper: `pose`, `ranges`, `target` and `directive` in, `grid` out.
//!
//! Changes give a window; new readers and intervals a keyframe. Other ticks give an empty window,
//! so that all reach the planner.

use std::time::Duration;

use common::{
    bus::Reader,
    clock::MissionTime,
    mission::{MOST_BEAMS, MOST_SENSORS},
    readers,
    samples::{
        ContactSample, DirectiveSample, FaultKind, PoseSample, RangeReading, RangesHeader,
        ScanHeader, ZoneCorner, ZonesHeader,
    },
    shell::{Context, Process, Progress},
    stage::Runner,
    start::Result,
    target::TargetReader,
    topics::{CONTACT, DIRECTIVE, GRID, HEALTH, POSE, RANGES, SCAN, SCAN_FIX, TARGET, ZONES},
    wiring::{Persists, Topics},
};

use crate::{
    stage::Entry,
    step::{Input, Mapper, Scan, Tick},
};

const KEYFRAME_EVERY: Duration = Duration::from_secs(1);

readers! {
    pub struct Inputs {
        inputs {
            ranges: Reader<RangesHeader, RangeReading> = RANGES,
            scan: Reader<ScanHeader, f32> = SCAN,
            contact: Reader<ContactSample> = CONTACT,
            pose: Reader<PoseSample> = POSE,
            directive: Reader<DirectiveSample> = DIRECTIVE,
            target: TargetReader = TARGET,
            zones: Reader<ZonesHeader, ZoneCorner> = ZONES,
        }
    }
}

#[derive(Default)]
struct OfTick<T>(Option<(u64, T)>);

impl<T: Default> OfTick<T> {
    /// Takes the sample of `tick`, if any. Earlier ones are dropped; later ones wait for their
    /// pose.
    fn take(&mut self, tick: u64, mut next: impl FnMut() -> Result<Option<(u64, T)>>) -> Result<T> {
        while self.0.as_ref().is_none_or(|(newest, _)| *newest < tick)
            && let Some(newer) = next()?
        {
            self.0 = Some(newer);
        }
        let own = self.0.take_if(|(newest, _)| *newest == tick);
        Ok(own.map(|(_, sample)| sample).unwrap_or_default())
    }
}

pub struct Shell {
    inputs: Inputs,
    runner: Runner<Mapper>,
    ranges: OfTick<Vec<RangeReading>>,
    scans: Vec<(u64, Scan)>,
    contact: OfTick<Option<ContactSample>>,
    last_keyframe: Option<MissionTime>,
    zones: u64,
}

impl Process for Shell {
    const NAME: &'static str = "mapper";
    // A planner that becomes ready is a new reader of the grid.
    const WAKES: Topics = &[&POSE, &DIRECTIVE, &HEALTH];
    const OUTPUTS: Topics = &[&GRID, &SCAN_FIX];
    const PERSISTS: Persists = Persists::Journal;
    type Readers = Inputs;

    fn open(context: &mut Context, inputs: Inputs) -> Result<Self> {
        let runner = Runner::open(context, |mapper: &Mapper| mapper.frame().area())?;
        let version = runner.stage.state().version;
        if version > 1 {
            tracing::info!(version, "the belief is restored");
        }
        let (ranges, scans, contact) = Default::default();
        Ok(Self { inputs, runner, ranges, scans, contact, last_keyframe: None, zones: 0 })
    }

    fn turn(&mut self) -> Result<Progress> {
        let mut newest = None;
        while let Some(slice) = self.inputs.zones.next_slice()? {
            newest = Some((slice.header().number, ZoneCorner::zones(&slice)));
        }
        if let Some((number, zones)) = newest
            && number != self.zones
        {
            self.zones = number;
            self.step(Input::Zones(zones))?;
        }
        let mut ticks = 0;
        while let Some(pose) = self.inputs.pose.next_sample()? {
            ticks += 1;
            let tick = pose.stamp.tick;
            let is_repeated = self.runner.out.at.tick == tick;
            self.runner.out.at = Progress::of(&pose.stamp);
            let mapper = &self.runner.stage;
            let inputs = &mut self.inputs;
            let ranges = self.ranges.take(tick, || {
                let Some(slice) = inputs.ranges.next_slice()? else {
                    return Ok(None);
                };
                let readings = slice.iter().take(MOST_SENSORS).copied();
                let used = readings.filter(|reading| mapper.uses(reading.sensor.into())).collect();
                Ok(Some((slice.header().stamp.tick, used)))
            })?;
            self.scans.retain(|(of, _)| *of >= tick);
            while self.scans.last().is_none_or(|(newest, _)| *newest == tick)
                && let Some(slice) = inputs.scan.next_slice()?
            {
                let header = slice.header();
                let of = header.stamp.tick;
                let row = header.sensor as usize;
                // A repeated tick has its scans again.
                let is_held = self.scans.iter().any(|(held, scan)| (*held, scan.row) == (of, row));
                if of >= tick && !is_held && mapper.uses(header.sensor) {
                    let beams = slice.iter().take(MOST_BEAMS).copied().collect();
                    self.scans.push((of, Scan { row, beams, sweep: header.sweep() }));
                }
            }
            let own = self.scans.extract_if(.., |(of, _)| *of == tick);
            let scans = own.map(|(_, scan)| scan).collect();
            let contact = self.contact.take(tick, || {
                let sample = inputs.contact.next_sample()?;
                Ok(sample.map(|sample| (sample.stamp.tick, Some(sample))))
            })?;
            let target = self.inputs.target.next(tick)?.map(|sample| sample.target.position());
            let target = target.filter(|target| *target != self.runner.stage.state().target);
            self.step(Input::Tick(Tick { pose, ranges, scans, contact, target }))?;
            // Repeats may have pushed this tick's window out of the planner's queue.
            if is_repeated {
                self.publish_again()?;
            }
        }
        if let Some(DirectiveSample { epoch, .. }) = self.inputs.directive.newest()?
            && self.step(Input::Reset { epoch })?
        {
            tracing::warn!(epoch, "the sensed belief is reset");
        }
        // The windows of late ticks, all at once, push each other out of the planner's queue.
        if self.runner.out.has_new_reader(&GRID)? || ticks >= GRID.spec().limits.buffer {
            self.publish_again()?;
        }
        Ok(self.runner.out.at)
    }

    fn inject(&mut self, fault: FaultKind) -> Result<bool> {
        self.step(Input::Fault(fault))?;
        Ok(true)
    }

    fn has_idle_work(&self) -> bool {
        self.is_keyframe_due() || self.runner.out.is_journal_long()
    }

    fn idle(&mut self) -> Result {
        if self.is_keyframe_due() {
            self.publish_again()?;
        }
        self.runner.out.shorten_journal(self.runner.stage.state())
    }
}

impl Shell {
    fn step(&mut self, input: Input) -> Result<bool> {
        self.take(Entry::Step(input, self.runner.out.at))
    }

    fn publish_again(&mut self) -> Result {
        self.take(Entry::Again(self.runner.out.at)).map(drop)
    }

    fn take(&mut self, entry: Entry) -> Result<bool> {
        let published = self.runner.take_entry(entry)?;
        if published.is_some_and(|part| part.is_keyframe()) {
            self.last_keyframe = Some(self.runner.out.at.time);
        }
        Ok(published.is_some())
    }

    fn is_keyframe_due(&self) -> bool {
        let due = |last| self.runner.out.at.time.since(last) >= KEYFRAME_EVERY;
        self.last_keyframe.is_none_or(due)
    }
}
