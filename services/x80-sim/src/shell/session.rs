//! Session of robot, radio, transport and ground truth.

use std::{os::fd::BorrowedFd, time::Duration};

use common::{
    checkpoint::Checkpoint,
    clock::{Instant, Pace, monotonic_ns},
    ground_truth::GroundTruthTick,
    json_wire::{Lines, parse},
    mission::{Mission, Protocol},
    wire::Decoder,
};
use rplidar_protocol::START;

use super::{SimClock, meeting::Meeting};
use crate::{
    arduino_words::Requests,
    error::Result,
    radio::Radio,
    robot::{Heard, Robot, Said},
    transport::{Source, Way},
};

/// Maximum unanswered ticks in lockstep before waiting for a ping: the longest outage at the
/// highest rate.
const MOST_UNHEARD: usize = 120_000;

/// Host silence by wall clock after which another host may take the robot.
const HOST_SILENT: Duration = Duration::from_secs(2);

const MOST_AT_ONCE: usize = 64;

/// Interval of RPLIDAR messages: a serial adapter buffers for a few milliseconds.
const GATHERS_S: f64 = 0.004;

#[derive(Clone, Copy, PartialEq)]
enum Leg {
    ToRobot(Source),
    ToHost(Source),
}

pub struct Session {
    robot: Robot,
    clock: SimClock,
    way: Way,
    radio: Option<Radio<Leg>>,
    /// Source of the served host's last valid frame, and destination of all streams.
    peer: Option<Source>,
    heard: Instant,
    strangers: u64,
    /// Decoders of the peer and one other source: partial frames must stay apart.
    decoders: Vec<(Source, Words)>,
    /// None if it uses the robot's address.
    laser_way: Option<Way>,
    laser_peer: Option<Source>,
    gathered_s: f64,
    protocol: Protocol,
    ground_truth: Box<dyn FnMut(GroundTruthTick)>,
    meeting: Option<Meeting>,
    checkpoint: Option<Checkpoint>,
}

enum Words {
    X80(Decoder),
    Json(Lines),
    Arduino(Requests),
}

impl Words {
    fn of(protocol: Protocol) -> Self {
        match protocol {
            Protocol::X80 => Self::X80(Decoder::default()),
            Protocol::Arduino => Self::Arduino(Requests::default()),
            // ROS 2 robots are external: their missions have an address.
            Protocol::Json | Protocol::Ros2 => Self::Json(Lines::default()),
        }
    }
}

impl Session {
    pub fn new(
        mission: &Mission,
        robot: Robot,
        pace: Pace,
        (way, laser_way): (Way, Option<Way>),
        ground_truth: Box<dyn FnMut(GroundTruthTick)>,
        (meeting, checkpoint): (Option<Meeting>, Option<Checkpoint>),
    ) -> Result<Self> {
        let radio = Radio::new(mission.simulation.physics().radio, mission.seed);
        let mut session = Self {
            clock: SimClock::new(pace, 1.0 / mission.robot.rate_hz, robot.time),
            robot,
            way,
            radio: Some(radio).filter(|radio| !radio.is_perfect()),
            peer: None,
            heard: Instant::now(),
            strangers: 0,
            decoders: Vec::new(),
            laser_way,
            laser_peer: None,
            gathered_s: 0.0,
            protocol: mission.robot.protocol(),
            ground_truth,
            meeting,
            checkpoint,
        };
        session.write_tick();
        session.save()?;
        Ok(session)
    }

    fn save(&mut self) -> Result {
        if let Some(checkpoint) = &mut self.checkpoint {
            checkpoint.save(&self.robot.saved_state())?;
        }
        Ok(())
    }

    /// Saves the robot when it has come to rest.
    pub fn end(mut self) -> Result {
        // The other robot sees the same path to rest, regardless of late commands.
        let Self { robot, meeting, .. } = &mut self;
        let mut tell = |robot: &mut Robot, ended| {
            if let Some(meeting) = meeting {
                meeting.tell(&robot.ground_truth(), ended);
            }
        };
        robot.come_to_rest(|robot| tell(robot, false));
        tell(robot, true);
        self.save()
    }

    pub fn readable(&self) -> Vec<BorrowedFd<'_>> {
        let ways = std::iter::once(&self.way).chain(&self.laser_way);
        ways.flat_map(Way::readable).collect()
    }

    /// Returns the time to the next self-triggered event; none in lockstep.
    pub fn patience(&self) -> Option<Duration> {
        self.clock.wait_for(self.next_due_s(), monotonic_ns())
    }

    fn next_tick_s(&self) -> f64 {
        self.robot.next_tick_s()
    }

    fn next_due_s(&self) -> f64 {
        let flight = self.radio.as_ref().and_then(Radio::next_due);
        let scanning = self.robot.rplidar.as_ref().filter(|rplidar| rplidar.is_scanning());
        let laser = scanning.map(|_| self.gathered_s + GATHERS_S);
        flight.into_iter().chain(laser).fold(self.next_tick_s(), f64::min)
    }

    fn send_laser(&mut self, bytes: &[u8]) {
        let way = self.laser_way.as_mut().unwrap_or(&mut self.way);
        if let Some(peer) = self.laser_peer.filter(|_| !bytes.is_empty()) {
            way.send(peer, bytes);
        }
    }

    fn send_measured(&mut self) {
        self.gathered_s = self.robot.time;
        let measured = self.robot.laser_measured();
        self.send_laser(&measured);
    }

    fn hear_laser(&mut self, source: Source, bytes: &[u8]) {
        self.laser_peer = Some(source);
        self.gathered_s = self.robot.time;
        if let Some(rplidar) = &mut self.robot.rplidar {
            let answers = rplidar.answer(bytes, self.gathered_s);
            self.send_laser(&answers);
        }
    }

    /// Up to a limit.
    pub fn listen(&mut self, buffer: &mut [u8]) -> Result {
        while let Some((source, bytes)) =
            self.laser_way.as_mut().map(|way| way.receive(buffer)).transpose()?.flatten()
        {
            if let Some(now) = self.clock.now(monotonic_ns()) {
                self.pass(now)?;
            }
            self.hear_laser(source, bytes);
        }
        for _ in 0..MOST_AT_ONCE {
            let Some((source, bytes)) = self.way.receive(buffer)? else {
                return Ok(());
            };
            self.take(source, bytes)?;
        }
        Ok(())
    }

    pub fn take(&mut self, source: Source, bytes: &[u8]) -> Result {
        let opened = self.way.take_opened();
        // Messages of the robot protocols begin differently.
        let is_laser = self.robot.rplidar.is_some()
            && (self.laser_peer == Some(source) || bytes.starts_with(&[START]))
            && self.laser_way.is_none();
        if let Some(now) = self.clock.now(monotonic_ns()) {
            self.pass(now)?;
            if opened {
                self.robot.on_opened();
            }
            let now = self.robot.time;
            if let Some(radio) = self.radio.as_mut().filter(|_| !is_laser) {
                radio.send(now, Leg::ToRobot(source), bytes);
                return Ok(());
            }
        }
        if is_laser {
            self.hear_laser(source, bytes);
            return Ok(());
        }
        self.hear(source, bytes)
    }

    fn meet(&mut self) -> Result {
        if let Some(meeting) = &mut self.meeting {
            self.robot.world.other = meeting.other_at(self.robot.time)?;
        }
        Ok(())
    }

    pub fn catch_up(&mut self) -> Result {
        if let Some(now) = self.clock.now(monotonic_ns()) {
            self.pass(now)?;
            self.clock.forgive(self.next_tick_s(), monotonic_ns());
        }
        Ok(())
    }

    fn pass(&mut self, now: f64) -> Result {
        self.meet()?;
        // The clock waits, so a delay beyond a period is dropped.
        let now = now.min(self.next_tick_s() + 1.0 / self.robot.rate_hz);
        loop {
            let due = self.next_due_s();
            if due > now {
                break;
            }
            let arrived = self.radio.as_mut().and_then(|radio| radio.arrived(due));
            self.robot.advance_to(due.min(self.next_tick_s()));
            match arrived {
                Some((Leg::ToRobot(source), bytes)) => self.hear(source, &bytes)?,
                Some((Leg::ToHost(source), bytes)) => self.way.send(source, &bytes),
                None if due < self.next_tick_s() => self.send_measured(),
                None => self.tick()?,
            }
        }
        self.robot.advance_to(now.min(self.next_tick_s()));
        Ok(())
    }

    fn tick(&mut self) -> Result {
        let frames = self.measured()?;
        self.peer = self.way.connected()?.or(self.peer);
        self.send(&frames);
        Ok(())
    }

    /// Ticks until the radio delivers: a host without frames sends no command, so mission time must
    /// pass by itself.
    fn tick_until_heard(&mut self) -> Result {
        for _ in 0..MOST_UNHEARD {
            let frames = self.measured()?;
            let now = self.robot.time;
            let radio = self.radio.as_mut();
            if !radio.is_some_and(|radio| radio.loses_tick(now)) {
                let (first, second) = match &mut self.radio {
                    Some(radio) => radio.split(frames),
                    None => (frames, Vec::new()),
                };
                self.deliver(&first);
                self.deliver(&second);
                break;
            }
        }
        Ok(())
    }

    fn measured(&mut self) -> Result<Vec<u8>> {
        self.meet()?;
        self.robot.advance_to_next_tick();
        self.send_measured();
        self.write_tick();
        self.save()?;
        Ok(self.robot.stream())
    }

    fn hear(&mut self, source: Source, bytes: &[u8]) -> Result {
        let known = self.decoders.iter().position(|(heard, _)| *heard == source);
        let mut words =
            known.map_or_else(|| Words::of(self.protocol), |at| self.decoders.swap_remove(at).1);
        match &mut words {
            Words::X80(decoder) => {
                decoder.push(bytes);
                while let Some(frame) = decoder.next_frame() {
                    self.on_said(source, Said::Frame(&frame))?;
                }
            }
            Words::Json(lines) => {
                for line in lines.push(bytes) {
                    match parse(&line) {
                        Ok(order) => self.on_said(source, Said::Order(&order))?,
                        Err(why) => tracing::debug!("the host's message is not a command: {why}"),
                    }
                }
            }
            Words::Arduino(requests) => {
                for request in requests.push(bytes) {
                    self.on_said(source, Said::Request(request))?;
                }
            }
        }
        // At most one source besides the peer is stored.
        if self.peer != Some(source) {
            let peer = self.peer;
            self.decoders.retain(|(other, _)| Some(*other) == peer);
        } else if self.decoders.len() > 1 {
            self.decoders.remove(0);
        }
        self.decoders.push((source, words));
        assert!(self.decoders.len() <= 2);
        Ok(())
    }

    fn on_said(&mut self, source: Source, said: Said<'_>) -> Result {
        if !self.serves(source) {
            return Ok(());
        }
        let mut answer = Vec::with_capacity(16);
        if self.clock.runs.is_some() {
            if said.told(&mut self.robot, &mut answer) != Heard::Foreign {
                self.peer = Some(source);
                self.send(&answer);
            }
            return Ok(());
        }
        let kind = said.kind();
        if kind == Heard::Foreign {
            return Ok(());
        }
        self.peer = Some(source);
        if kind == Heard::Motion
            && let Some(radio) = &mut self.radio
        {
            // The period passes even if the radio loses or delays the command.
            let now = self.robot.time;
            if radio.loses(now) {
                return self.tick_until_heard();
            }
            let both_ways = radio.delay() + radio.delay();
            self.robot.advance_to((now + both_ways).min(self.next_tick_s()));
        }
        said.told(&mut self.robot, &mut answer);
        self.deliver(&answer);
        match kind {
            Heard::Motion => self.tick_until_heard()?,
            Heard::Ping => self.deliver(&self.robot.repeat()),
            _ => {}
        }
        Ok(())
    }

    /// Returns whether `source` is the served host, or may replace it after its silence.
    fn serves(&mut self, source: Source) -> bool {
        let silent = self.heard.elapsed() >= HOST_SILENT;
        let serves = silent || self.peer.is_none_or(|peer| peer.is_same_host(source));
        if serves {
            (self.heard, self.strangers) = (Instant::now(), 0);
        } else {
            self.strangers += 1;
            if self.strangers == 1 {
                tracing::warn!(stranger = ?source, served = ?self.peer, "another host sends to the robot; the robot ignores it until the first is silent for 2 s");
            }
        }
        serves
    }

    fn send(&mut self, bytes: &[u8]) {
        let now = self.robot.time;
        match (&mut self.radio, self.peer) {
            (Some(radio), Some(peer)) if !bytes.is_empty() => {
                radio.send(now, Leg::ToHost(peer), bytes);
            }
            _ => self.deliver(bytes),
        }
    }

    fn deliver(&mut self, bytes: &[u8]) {
        if let Some(peer) = self.peer.filter(|_| !bytes.is_empty()) {
            self.way.send(peer, bytes);
        }
    }

    fn write_tick(&mut self) {
        let mut ground_truth = self.robot.ground_truth();
        let now = ground_truth.time_s;
        ground_truth.radio = self.radio.as_mut().map(|radio| radio.ground_truth(now));
        if let Some(meeting) = &mut self.meeting {
            meeting.tell(&ground_truth, false);
        }
        (self.ground_truth)(ground_truth);
    }
}
