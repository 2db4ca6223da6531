//! Readers of the supervisor, and the record by which a run is judged.

use std::collections::VecDeque;

use common::{
    bus::{Bus, BusError, Reader, Writers},
    clock::Instant,
    grid::{Applied, Part, Replica},
    mission::Mission,
    roster,
    samples::{
        CommandSample, CommandState, ComplaintSample, ContactSample, FieldCell, FieldHeader,
        GridHeader, GuidanceSample, GuidanceStatus, HealthSample, LinkSample, PoseSample, Rest,
        name_str,
    },
    topics,
    waiter::Waiter,
};
use glam::DVec2;
use processes::stage_processes::StageProcesses;

use crate::{
    long_record,
    target_list::{Arrived, TargetOutcome},
};

/// Guidance history, long enough for the guidance of an arrival.
const MOST_GUIDANCE: usize = 1024;
/// Contact history, longer than the contacts between two stall checks.
const MOST_CONTACTS: usize = 64;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Published {
    pub tick: Option<u64>,
    pub commands: u64,
    /// Generation of the planner's newest heartbeat, and its newest grid tick.
    pub planner: (u32, u64),
    pub epoch: u64,
    pub grid_epoch: u64,
    /// Whether the grid changed when its epoch began. The planner answers only changed grids.
    pub grid_changed: bool,
}

pub enum Heard<'a> {
    Command(&'a CommandSample),
    Guidance(&'a GuidanceSample),
    Grid(&'a GridHeader),
    Field(&'a Part, &'a [FieldCell]),
    Link(&'a LinkSample),
}

/// Callback for every sample. The run never depends on it.
pub type Listener = Box<dyn FnMut(Heard<'_>)>;

pub(crate) struct Observer {
    health: Reader<HealthSample>,
    link: Reader<LinkSample>,
    complaints: Reader<ComplaintSample>,
    pose: Reader<PoseSample>,
    contact: Reader<ContactSample>,
    grid: Reader<GridHeader, u8>,
    guidance: Reader<GuidanceSample>,
    field: Reader<FieldHeader, FieldCell>,
    command: Reader<CommandSample>,
    writers: Writers,
}

#[derive(Default)]
pub struct Record {
    /// Thinned out in a long run.
    pub poses: Vec<PoseSample>,
    pub pose: Option<PoseSample>,
    pub(crate) guidance: VecDeque<GuidanceSample>,
    pub command: Option<CommandSample>,
    pub(crate) published: Published,
    /// Newest ticks with held wheels, oldest first.
    contacts: VecDeque<u64>,
    /// Current target, whose first arrival command is in `arrival`.
    pub(crate) target_number: u64,
    pub arrival: Option<CommandSample>,
    pub link: Option<LinkSample>,
    complaint: Option<(ComplaintSample, Instant)>,
    pub(crate) rest_read: Option<Instant>,
    pub grid: Replica<u8>,
    pub field_known: bool,
}

impl Observer {
    /// `waiter` wakes for heartbeats, fields and link samples, which end a tick, and leaves the
    /// processor to the stages during a tick.
    pub(crate) fn new(bus: &Bus, waiter: &mut Waiter) -> Result<Self, BusError> {
        waiter.on(bus.wakeup(&topics::HEALTH)?);
        waiter.on(bus.wakeup(&topics::LINK)?);
        waiter.on(bus.wakeup(&topics::FIELD)?);
        // Samples that judge an arrival are read completely, even by a starved supervisor.
        Ok(Self {
            health: bus.reader(&topics::HEALTH)?,
            link: bus.reader(&topics::LINK)?,
            complaints: bus.reader(&topics::COMPLAINTS)?,
            pose: bus.recorder_reader(&topics::POSE)?,
            contact: bus.reader(&topics::CONTACT)?,
            grid: bus.reader(&topics::GRID)?,
            guidance: bus.recorder_reader(&topics::GUIDANCE)?,
            field: bus.reader(&topics::FIELD)?,
            command: bus.recorder_reader(&topics::COMMAND)?,
            writers: bus.writers().cloned().unwrap_or_default(),
        })
    }

    /// Returns whether new samples changed the roster.
    pub(crate) fn read_all(
        &mut self,
        record: &mut Record,
        stages: &mut StageProcesses,
        listener: &mut Listener,
    ) -> Result<bool, BusError> {
        // Only samples of the stages' own processes are read.
        self.writers.name(roster::named(&stages.roster()));
        let mut roster_changed = false;
        while let Some(health) = self.health.next_sample()? {
            roster_changed |= stages.on_health(&health);
            if name_str(&health.stage) == processes::stages::PLANNER {
                record.published.planner = (health.stamp.generation, health.stamp.tick);
            }
        }
        // The command is read before the samples behind it, so a record with the command holds them
        // too.
        while let Some(command) = self.command.next_sample()? {
            stages.on_output(topics::COMMAND.spec().writer, command.stamp.tick);
            record.command = Some(command);
            record.published.tick = Some(command.stamp.tick);
            record.published.commands += 1;
            listener(Heard::Command(&command));
            if command.target_number == record.target_number {
                record.arrival = match command.state() {
                    CommandState::Arrived => record.arrival.or(Some(command)),
                    // A robot that rolled on has not arrived.
                    _ => None,
                };
            }
        }
        while let Some(guidance) = self.guidance.next_sample()? {
            stages.on_output(topics::GUIDANCE.spec().writer, guidance.stamp.tick);
            listener(Heard::Guidance(&guidance));
            record.published.epoch = guidance.epoch;
            push(&mut record.guidance, guidance, MOST_GUIDANCE);
        }
        while let Some(grid) = self.grid.next_slice()? {
            stages.on_output(topics::GRID.spec().writer, grid.header().stamp.tick);
            listener(Heard::Grid(grid.header()));
            let epoch = grid.header().epoch;
            let applied = record.grid.apply(&grid.header().part, &grid);
            if epoch > record.published.grid_epoch {
                let same = matches!(applied, Applied::Window(window) if window.area() == 0);
                (record.published.grid_epoch, record.published.grid_changed) = (epoch, !same);
            }
        }
        while let Some(field) = self.field.next_slice()? {
            listener(Heard::Field(&field.header().part, &field));
            record.field_known = true;
        }
        while let Some(pose) = self.pose.next_sample()? {
            stages.on_output(topics::POSE.spec().writer, pose.stamp.tick);
            record.pose = Some(pose);
            long_record::push(&mut record.poses, pose, |older, _| Some(older));
        }
        // Poses are computed from link samples, so these are read last.
        while let Some(contact) = self.contact.next_sample()? {
            // A bumper holds no wheel: the robot drives around such a contact.
            if contact.left + contact.right > 0 {
                push(&mut record.contacts, contact.stamp.tick, MOST_CONTACTS);
            }
        }
        while let Some(link) = self.link.next_sample()? {
            listener(Heard::Link(&link));
            record.link = Some(link);
            if link.at_rest() != Rest::Unknown {
                // Before its first tick, which it begins with motor frames, the link states 0 too.
                if link.stamp.tick > 0 {
                    stages.on_output(topics::LINK.spec().writer, link.stamp.tick);
                }
                record.rest_read = Some(Instant::now());
            }
        }
        while let Some(complaint) = self.complaints.next_sample()? {
            record.complaint = Some((complaint, Instant::now()));
        }
        Ok(roster_changed)
    }
}

fn push<T>(items: &mut VecDeque<T>, item: T, most: usize) {
    if items.len() == most {
        items.pop_front();
    }
    items.push_back(item);
    assert!(items.len() <= most);
}

impl Record {
    pub fn complaint(&self) -> Option<ComplaintSample> {
        let (complaint, read) = self.complaint?;
        (read.elapsed() < ComplaintSample::LASTS).then_some(complaint)
    }

    pub(crate) fn sure_arrival(&self, mission: &Mission) -> Option<Arrived> {
        let command = self.arrival?;
        let pose = self.pose_at(command.stamp.tick);
        let outcome = if self.beside(&command, mission.arrival_tolerance_m).is_some() {
            TargetOutcome::Unreachable
        } else if pose.is_none_or(|pose| pose.is_sure(mission)) {
            TargetOutcome::Reached
        } else {
            TargetOutcome::ReachedUnsure
        };
        Some((command, outcome))
    }

    /// Returns the robot's place if it arrived outside the tolerance, at the planner's nearest
    /// point to a target in or beside a hazard.
    pub(crate) fn beside(&self, arrival: &CommandSample, tolerance_m: f64) -> Option<DVec2> {
        let is_near = self.guidance_at(arrival.stamp.tick)?.status() == GuidanceStatus::AtTarget;
        let pose = self.pose_at(arrival.stamp.tick)?;
        (is_near && arrival.distance_m > tolerance_m).then(|| pose.pose().position)
    }

    pub fn guidance_at(&self, tick: u64) -> Option<&GuidanceSample> {
        self.guidance.iter().rev().find(|guidance| guidance.stamp.tick <= tick)
    }

    /// Returns whether something held the wheels in the ticks (`last`, `tick`]. A slow planner may
    /// skip a tick.
    pub(crate) fn has_contact(&self, last: Option<u64>, tick: u64) -> bool {
        let is_new = |contact: &u64| *contact <= tick && last.is_none_or(|last| *contact > last);
        self.contacts.iter().any(is_new)
    }

    /// Iterates over the ticks after `last` with both pose and guidance, oldest first.
    pub(crate) fn ticks_since(
        &self,
        last: Option<u64>,
    ) -> impl Iterator<Item = (&PoseSample, &GuidanceSample)> {
        let first = last.map_or(0, |tick| tick + 1);
        let new = self.poses.partition_point(|pose| pose.stamp.tick < first);
        self.poses[new..].iter().filter_map(|pose| {
            let tick = pose.stamp.tick;
            let guidance = self.guidance_at(tick).filter(|guidance| guidance.stamp.tick == tick);
            Some((pose, guidance?))
        })
    }

    pub fn pose_at(&self, tick: u64) -> Option<&PoseSample> {
        self.poses.iter().rev().find(|pose| pose.stamp.tick <= tick)
    }

    pub fn newest_tick(&self) -> Option<u64> {
        [
            self.pose.map(|pose| pose.stamp.tick),
            self.command.map(|command| command.stamp.tick),
            self.link.map(|link| link.stamp.tick),
        ]
        .into_iter()
        .flatten()
        .max()
    }
}
