//! `pose`, `ranges`, `target` and `directive` in, `grid` out: a window for each change, a keyframe for each new reader and at
//! intervals, an empty window otherwise, so that every tick goes on to the planner.

use std::time::Duration;

use common::{
    bus::Reader,
    clock::MissionTime,
    mission::{MOST_BEAMS, MOST_SENSORS},
    readers,
    samples::{
        ContactSample, DirectiveSample, FaultKind, PoseSample, RangeReading, RangesHeader,
        ScanHeader, Sweep,
    },
    shell::{Context, Process, Progress},
    stage::Runner,
    start::StageError,
    target::TargetReader,
    topics::{CONTACT, DIRECTIVE, GRID, HEALTH, POSE, RANGES, SCAN, SCAN_FIX, TARGET},
    wiring::{Persists, Topics},
};

use crate::{
    stage::Entry,
    step::{Input, Mapper},
};

/// Mission time after which the whole map is published again.
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
        }
    }
}

/// The mapper process.
pub struct Shell {
    inputs: Inputs,
    runner: Runner<Mapper>,
    /// The newest scan with the times of its beams, and its tick.
    latest_scan: Option<(u64, Vec<f32>, Sweep)>,
    /// The newest readings that are used, and their tick.
    latest_ranges: Option<(u64, Vec<RangeReading>)>,
    latest_contact: Option<ContactSample>,
    last_keyframe: Option<MissionTime>,
}

impl Process for Shell {
    const NAME: &'static str = "mapper";
    // A planner that becomes ready is a new reader of the grid.
    const WAKES: Topics = &[&POSE, &DIRECTIVE, &HEALTH];
    const OUTPUTS: Topics = &[&GRID, &SCAN_FIX];
    const PERSISTS: Persists = Persists::Journal;
    type Readers = Inputs;

    fn open(context: &mut Context, inputs: Inputs) -> Result<Self, StageError> {
        let runner = Runner::open(context, |mapper: &Mapper| mapper.frame().area())?;
        let version = runner.stage.state().version();
        if version > 1 {
            tracing::info!(version, "the belief is restored");
        }
        Ok(Self {
            inputs,
            latest_scan: None,
            runner,
            latest_ranges: None,
            latest_contact: None,
            last_keyframe: None,
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        while let Some(pose) = self.inputs.pose.next_sample()? {
            let ranges = self.ranges_of(pose.stamp.tick)?;
            self.runner.out.at = Progress::of(&pose.stamp);
            let (scan, sweep) = self.scan_of(pose.stamp.tick)?;
            let contact = self.contact_of(pose.stamp.tick)?;
            let target =
                self.inputs.target.next(pose.stamp.tick)?.map(|sample| sample.target.position());
            let target = target.filter(|target| *target != self.runner.stage.target());
            if sweep != Sweep::default() && !scan.is_empty() {
                self.step(Input::Sweep(pose.stamp.tick, sweep))?;
            }
            self.step(Input::Tick { pose, ranges, scan, contact, target })?;
        }
        if let Some(DirectiveSample { epoch, .. }) = self.inputs.directive.newest()?
            && self.step(Input::Reset { epoch })?
        {
            tracing::warn!(epoch, "the sensed belief is reset");
        }
        if self.runner.out.has_new_reader(&GRID)? {
            self.publish_again()?;
        }
        Ok(self.runner.out.at)
    }

    fn inject(&mut self, fault: FaultKind) -> Result<bool, StageError> {
        self.step(Input::Fault(fault))?;
        Ok(true)
    }

    fn has_idle_work(&self) -> bool {
        self.is_keyframe_due() || self.runner.out.is_journal_long()
    }

    fn idle(&mut self) -> Result<(), StageError> {
        if self.is_keyframe_due() {
            self.publish_again()?;
        }
        self.runner.out.shorten_journal(self.runner.stage.state())
    }
}

impl Shell {
    /// Let the step take `input`. Returns whether anything was published.
    fn step(&mut self, input: Input) -> Result<bool, StageError> {
        self.take(Entry::Step(input, self.runner.out.at))
    }

    fn publish_again(&mut self) -> Result<(), StageError> {
        self.take(Entry::Again(self.runner.out.at)).map(drop)
    }

    fn take(&mut self, entry: Entry) -> Result<bool, StageError> {
        let published = self.runner.take_entry(entry)?;
        if published.is_some_and(|part| part.is_keyframe()) {
            self.last_keyframe = Some(self.runner.out.at.time);
        }
        Ok(published.is_some())
    }

    /// The readings of `tick`; earlier ones are dropped, later ones wait for their pose.
    fn ranges_of(&mut self, tick: u64) -> Result<Vec<RangeReading>, StageError> {
        while self.latest_ranges.as_ref().is_none_or(|(latest, _)| *latest < tick) {
            let Some(slice) = self.inputs.ranges.next_slice()? else {
                break;
            };
            let readings = slice.iter().take(MOST_SENSORS).copied();
            let used = readings.filter(|reading| self.runner.stage.uses(reading)).collect();
            self.latest_ranges = Some((slice.header().stamp.tick, used));
        }
        let latest = self.latest_ranges.as_ref().filter(|(latest, _)| *latest == tick);
        Ok(latest.map(|(_, readings)| readings.clone()).unwrap_or_default())
    }

    /// The scan of `tick`; none if the laser gave none, or the mission uses none.
    fn scan_of(&mut self, tick: u64) -> Result<(Vec<f32>, Sweep), StageError> {
        while self.latest_scan.as_ref().is_none_or(|(latest, ..)| *latest < tick) {
            let Some(slice) = self.inputs.scan.next_slice()? else {
                break;
            };
            let used = self.runner.stage.uses_row(slice.header().sensor);
            let beams =
                if used { slice.iter().take(MOST_BEAMS).copied().collect() } else { Vec::new() };
            let header = slice.header();
            self.latest_scan = Some((header.stamp.tick, beams, header.sweep()));
        }
        let latest = self.latest_scan.as_mut().filter(|(latest, ..)| *latest == tick);
        Ok(latest.map(|(_, beams, sweep)| (std::mem::take(beams), *sweep)).unwrap_or_default())
    }

    /// The contact of `tick`; most ticks have none.
    fn contact_of(&mut self, tick: u64) -> Result<Option<ContactSample>, StageError> {
        while self.latest_contact.is_none_or(|contact| contact.stamp.tick < tick) {
            match self.inputs.contact.next_sample()? {
                Some(contact) => self.latest_contact = Some(contact),
                None => break,
            }
        }
        Ok(self.latest_contact.filter(|contact| contact.stamp.tick == tick))
    }

    fn is_keyframe_due(&self) -> bool {
        let due = |last| self.runner.out.at.time.since(last) >= KEYFRAME_EVERY;
        self.last_keyframe.is_none_or(due)
    }
}
