//! The link, pure: what came and what time it is go in, samples and bytes for the robot come out.
//!
//! A tick starts with a motor frame and takes the newest sonar frame with it; it ends with the command
//! computed from it. On a clock of ticks (a simulated robot at `--pace max`) the robot waits for that
//! command, so a tick that gets none, because a stage died, is given again. On a wall clock the robot
//! moves on, so an unanswered tick is abandoned for the next.

use std::time::Duration;

use common::{
    clock::{MissionClock, MissionTime},
    mission::{Body, Mission, RobotConfig},
    samples::{CommandSample, CommandState, Order, RangeSample, RangeStatus, WheelSample},
    wire::{
        Addressing, COUNT_CYCLE, Command, Decoder, DecoderTally, Echo, Encoder, Feedback, Mode,
        MotorSensors, Parameter, Report, Request, Stream, SystemSignal,
    },
};

use crate::failsafe::{self, Cause, Flags};

/// A robot that said nothing for so many command limits is lost: longer than a radio's short fade, and
/// the robot stands by then anyway.
const SILENT_LIMITS: u32 = 3;
/// However fast mission time runs, processes are late by so much now and then.
const LEAST_SILENCE: Duration = Duration::from_millis(100);
/// Between pings of a robot that does not answer.
const PING_EVERY: Duration = Duration::from_millis(200);
/// An open tick without a command is given again after this: ten times the longest tick measured.
const REPEAT_AFTER: Duration = Duration::from_millis(100);
/// A stop is sent so often: one datagram may be lost.
const STOPS: u32 = 3;
/// While the robot stands by our decision it is told again: all of them may be lost in a fade, and a
/// robot may ignore the time limit of the command before.
const STOP_AGAIN: Duration = Duration::from_millis(200);

/// What happened.
#[derive(Clone, Copy, Debug)]
pub enum Event<'a> {
    /// Bytes of the robot.
    Datagram(&'a [u8]),
    /// Whether the wire is open now. One of datagrams always is, and it is taken for open until this says
    /// otherwise.
    Wire(bool),
    /// A command of the controller.
    Command(&'a CommandSample),
    /// The supervisor's word.
    Order(Order),
    /// Nothing; time passed.
    Quiet,
}

/// What to do about it.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// Send these bytes to the robot.
    Send(Vec<u8>),
    /// Publish the tick: `range` first, since `wheels` wakes the pipeline.
    Tick {
        /// Its number.
        tick: u64,
        /// Its mission time.
        time: MissionTime,
        /// The newest sonar reading.
        range: RangeSample,
        /// The encoders.
        wheels: WheelSample,
    },
    /// The command of the tick that began at this reading of the monotonic clock is on its way.
    Answered {
        /// Nanoseconds.
        began_ns: u64,
    },
    /// The robot was stopped for this cause.
    Stopped(Cause),
    /// The robot answers again, or no longer.
    Connected(bool),
}

/// Counts for the `link` topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Velocity commands sent.
    pub commands: u64,
    /// Ticks given again.
    pub repeated_ticks: u64,
}

/// A tick that waits for its command.
#[derive(Clone, Copy, Debug)]
struct OpenTick {
    range: RangeSample,
    wheels: WheelSample,
    began_ns: u64,
    given_ns: u64,
}

/// The link to one robot.
#[derive(Debug)]
pub struct Link {
    clock: MissionClock,
    robot: RobotConfig,
    body: Body,
    sonar_index: usize,
    command_limit: Duration,
    decoder: Decoder,
    order: Option<Order>,
    heard_ns: Option<u64>,
    pinged_ns: Option<u64>,
    wire_open: bool,
    connected: bool,
    sonar: Option<u8>,
    next_tick: u64,
    time: MissionTime,
    open: Option<OpenTick>,
    newest_command: Option<CommandSample>,
    stopped: Option<Cause>,
    stop_sent_ns: Option<u64>,
    /// On a clock of ticks: motor frames that are due, one for each command and each ping since the order.
    due: u32,
    /// The mission's last command has passed: on a clock of ticks there is nothing to go on for.
    arrived: bool,
    silence: Duration,
    tally: Tally,
}

impl Link {
    /// A link for `mission` whose first tick is `first_tick`.
    #[must_use]
    pub fn new(mission: &Mission, clock: MissionClock, first_tick: u64) -> Self {
        Self {
            clock,
            robot: mission.robot.clone(),
            body: mission.body(),
            sonar_index: usize::from(mission.sonar.index),
            command_limit: Duration::from_secs_f64(mission.robot.command_limit_s),
            decoder: Decoder::default(),
            order: None,
            heard_ns: None,
            pinged_ns: None,
            wire_open: true,
            connected: false,
            sonar: None,
            next_tick: first_tick,
            time: clock.at(first_tick, 0),
            open: None,
            newest_command: None,
            // Nothing has moved yet: what holds it needs no stop of its own.
            stopped: Some(Cause::NotOrdered),
            stop_sent_ns: None,
            due: 0,
            arrived: false,
            silence: silence(mission, clock),
            tally: Tally::default(),
        }
    }

    /// Whether the robot answers.
    #[must_use]
    pub const fn connected(&self) -> bool {
        self.connected
    }

    /// Why the robot stands by the link's own decision; none while commands pass.
    #[must_use]
    pub const fn stopped(&self) -> Option<Cause> {
        self.stopped
    }

    /// Counts of the wire.
    #[must_use]
    pub fn wire_tally(&self) -> DecoderTally {
        self.decoder.tally()
    }

    /// Counts of the link.
    #[must_use]
    pub const fn tally(&self) -> Tally {
        self.tally
    }

    /// The tick to come and the mission time of the last one.
    #[must_use]
    pub const fn progress(&self) -> (u64, MissionTime) {
        (self.next_tick, self.time)
    }

    /// Take one event at `now_ns` of the monotonic clock.
    pub fn step(&mut self, event: Event<'_>, now_ns: u64) -> Vec<Effect> {
        let mut effects = Vec::new();
        match event {
            Event::Datagram(bytes) => {
                self.decoder.push(bytes);
                self.take_frames(now_ns, &mut effects);
            }
            Event::Wire(open) => self.take_wire(open, &mut effects),
            Event::Command(command) => self.take_command(command, now_ns, &mut effects),
            Event::Order(order) => self.take_order(order, now_ns, &mut effects),
            Event::Quiet => {}
        }
        self.keep_connected(now_ns, &mut effects);
        self.repeat_tick(now_ns, &mut effects);
        self.guard(now_ns, &mut effects);
        effects
    }

    /// The last words: the robot stands.
    #[must_use]
    pub fn farewell(&self) -> Vec<Vec<u8>> {
        (0..STOPS).map(|_| self.velocity([0, 0])).collect()
    }

    const fn in_ticks(&self) -> bool {
        matches!(self.clock, MissionClock::Ticks { .. })
    }

    fn take_wire(&mut self, open: bool, effects: &mut Vec<Effect>) {
        self.wire_open = open;
        // Whoever is there now is asked at once.
        self.pinged_ns = None;
        // Half a frame of one connection does not go on in the next.
        self.decoder.forget();
        if !open && self.connected {
            self.connected = false;
            effects.push(Effect::Connected(false));
        }
    }

    fn take_frames(&mut self, now_ns: u64, effects: &mut Vec<Effect>) {
        let mut motor = None;
        let mut ping = false;
        while let Some(frame) = self.decoder.next_frame() {
            match Report::parse(&frame) {
                Ok(Report::Standard(standard)) => {
                    self.sonar = standard.ultrasonic.get(self.sonar_index).copied();
                }
                Ok(Report::Motor(sensors)) => motor = Some(sensors),
                Ok(Report::System(SystemSignal::Ping)) => ping = true,
                // An ACK only says that the robot is there; so does a frame nobody here needs.
                Ok(Report::System(SystemSignal::Ack) | Report::Custom(_)) | Err(_) => {}
            }
            self.heard_ns = Some(now_ns);
        }
        if ping {
            effects.push(Effect::Send(encoded(Command::System(SystemSignal::Ack))));
        }
        if self.heard_ns == Some(now_ns) && !self.connected {
            self.connected = true;
            effects.push(Effect::Connected(true));
            effects.push(Effect::Send(self.greeting()));
            // It may be driving still on the word of an earlier link.
            self.stop_sent_ns = None;
            if self.in_ticks() {
                // Those frames belong to the greeting: how many there are depends on how long the robot
                // took to start. Ticks begin with the frames that answer the order.
                if motor.is_some() {
                    self.due = self.due.saturating_sub(1);
                }
                if self.order == Some(Order::Drive) {
                    self.ping(now_ns, effects);
                }
                return;
            }
        }
        if let Some(sensors) = motor {
            self.begin_tick(&sensors, now_ns, effects);
        }
    }

    /// Encoders as feedback, velocity mode, motors enabled, sensors streaming.
    fn greeting(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut say = |command: Command| command.encode(Addressing::default(), &mut bytes);
        for channel in [self.robot.left.channel, self.robot.right.channel] {
            for parameter in [
                Parameter::Feedback(Feedback::Encoder),
                Parameter::Mode(Mode::Velocity),
            ] {
                say(Command::Parameter { channel, parameter });
            }
            say(Command::Enable {
                on: true,
                channel: Some(channel),
            });
        }
        for stream in [Stream::Motor, Stream::Standard] {
            say(Command::Stream {
                stream,
                request: Request::Start,
            });
        }
        bytes
    }

    fn begin_tick(&mut self, sensors: &MotorSensors, now_ns: u64, effects: &mut Vec<Effect>) {
        if self.order != Some(Order::Drive) {
            return;
        }
        if self.in_ticks() {
            // Of several answers that are due only the last shows where the robot is.
            self.due = self.due.saturating_sub(1);
            if self.open.is_some() || self.due > 0 || self.arrived {
                return;
            }
        }
        let tick = self.next_tick;
        self.time = self.clock.at(tick, now_ns);
        if !self.in_ticks() {
            // The number is taken whether the tick is answered or not.
            self.next_tick += 1;
        }
        let left = self.wheel(sensors, self.robot.left);
        let right = self.wheel(sensors, self.robot.right);
        let wheels = WheelSample {
            left_counts: left.position,
            right_counts: right.position,
            left_counts_per_s: left.velocity(),
            right_counts_per_s: right.velocity(),
            ..WheelSample::default()
        };
        let open = OpenTick {
            range: reading(self.sonar.take()),
            wheels,
            began_ns: now_ns,
            given_ns: now_ns,
        };
        self.open = Some(open);
        effects.push(self.tick_effect(tick, &open));
    }

    fn tick_effect(&self, tick: u64, open: &OpenTick) -> Effect {
        Effect::Tick {
            tick,
            time: self.time,
            range: open.range,
            wheels: open.wheels,
        }
    }

    /// A channel's encoder, turned so that it grows forward.
    fn wheel(&self, sensors: &MotorSensors, channel: common::mission::Channel) -> Encoder {
        let encoder = sensors.encoders[usize::from(channel.channel.min(1))];
        if !channel.reversed {
            return encoder;
        }
        Encoder {
            position: (COUNT_CYCLE - encoder.position % COUNT_CYCLE) % COUNT_CYCLE,
            positive: !encoder.positive,
            ..encoder
        }
    }

    /// The number of the open tick.
    const fn open_number(&self) -> u64 {
        if self.in_ticks() {
            self.next_tick
        } else {
            self.next_tick - 1
        }
    }

    fn take_command(&mut self, command: &CommandSample, now_ns: u64, effects: &mut Vec<Effect>) {
        let newer = |held: &CommandSample| held.stamp.tick <= command.stamp.tick;
        if !self.newest_command.as_ref().is_none_or(newer) {
            return;
        }
        let answers = self.open.is_some() && command.stamp.tick == self.open_number();
        if self.in_ticks() && !answers {
            // A second answer to a tick that was given twice.
            return;
        }
        self.newest_command = Some(*command);
        if self.stop_cause(now_ns).is_some() {
            return;
        }
        if self.stopped.take().is_some() {
            tracing::debug!("commands pass again");
        }
        let wheels = match CommandState::from_byte(command.state) {
            CommandState::Driving => [command.left_rad_s, command.right_rad_s],
            CommandState::Halt | CommandState::Arrived => [0.0, 0.0],
        };
        let counts = wheels.map(|speed| self.counts_per_second(speed));
        effects.push(Effect::Send(self.velocity(counts)));
        self.tally.commands += 1;
        self.due += 1;
        self.arrived |= CommandState::from_byte(command.state) == CommandState::Arrived;
        if answers && let Some(open) = self.open.take() {
            effects.push(Effect::Answered {
                began_ns: open.began_ns,
            });
            if self.in_ticks() {
                self.next_tick += 1;
            }
        }
    }

    /// rad/s to counts/s, limited to what the wheel can do; what is no number stands.
    fn counts_per_second(&self, speed: f64) -> i16 {
        let per_radian = self.body.counts_per_turn / std::f64::consts::TAU;
        let top = self.body.top_speed_m_s / self.body.metres_per_count();
        let counts = (speed * per_radian).clamp(-top, top).round();
        // -32768 and -32767 mean "leave alone".
        counts.clamp(-32_766.0, 32_766.0) as i16
    }

    /// A timed velocity command: a robot that obeys the time stops by itself when we fall silent.
    fn velocity(&self, [left, right]: [i16; 2]) -> Vec<u8> {
        let mut channels = [None; 2];
        for (channel, counts) in [(self.robot.left, left), (self.robot.right, right)] {
            let signed = if channel.reversed { -counts } else { counts };
            channels[usize::from(channel.channel.min(1))] = Some(signed);
        }
        let limit_ms = self.command_limit.as_millis().min(u128::from(u16::MAX)) as u16;
        encoded(Command::velocity(channels, limit_ms))
    }

    fn take_order(&mut self, order: Order, now_ns: u64, effects: &mut Vec<Effect>) {
        let drives = order == Order::Drive && self.order != Some(Order::Drive);
        self.order = Some(order);
        if drives && self.in_ticks() {
            // A robot that waits for commands tells its state again when pinged: tick 0.
            self.ping(now_ns, effects);
        }
    }

    fn ping(&mut self, now_ns: u64, effects: &mut Vec<Effect>) {
        self.pinged_ns = Some(now_ns);
        if self.order == Some(Order::Drive) {
            self.due += 1;
        }
        effects.push(Effect::Send(encoded(Command::System(SystemSignal::Ping))));
    }

    fn keep_connected(&mut self, now_ns: u64, effects: &mut Vec<Effect>) {
        let silent = passed(self.heard_ns, now_ns, self.silence);
        // A robot that waits for a command is not lost; at most a datagram is, if it owes us a tick.
        let owes = self.order == Some(Order::Drive) && self.open.is_none();
        if self.connected && silent && !self.in_ticks() {
            self.connected = false;
            effects.push(Effect::Connected(false));
        }
        let asks = !self.connected || self.in_ticks() && owes && silent;
        if asks && self.wire_open && passed(self.pinged_ns, now_ns, PING_EVERY) {
            if self.connected {
                // What was due is lost.
                self.due = 0;
            }
            self.ping(now_ns, effects);
        }
    }

    fn repeat_tick(&mut self, now_ns: u64, effects: &mut Vec<Effect>) {
        if !self.in_ticks() {
            return;
        }
        if let Some(mut open) = self.open
            && passed(Some(open.given_ns), now_ns, REPEAT_AFTER)
        {
            open.given_ns = now_ns;
            self.open = Some(open);
            self.tally.repeated_ticks += 1;
            effects.push(self.tick_effect(self.next_tick, &open));
        }
    }

    fn stop_cause(&self, now_ns: u64) -> Option<Cause> {
        // On a clock of ticks no time passes until the command has come.
        let age = |command: &CommandSample| {
            let stamp = command.stamp.time();
            let now = match self.clock {
                MissionClock::Ticks { .. } => stamp,
                MissionClock::Wall { .. } => self.clock.at(self.next_tick, now_ns),
            };
            // A stamp from the future would never grow old.
            if stamp <= now {
                now.since(stamp)
            } else {
                Duration::MAX
            }
        };
        let flags = Flags {
            order: self.order,
            command_age: self.newest_command.as_ref().map(age),
            connected: self.connected,
        };
        failsafe::stop_cause(&flags, self.command_limit)
    }

    /// Stop the robot when it must not move.
    fn guard(&mut self, now_ns: u64, effects: &mut Vec<Effect>) {
        let Some(cause) = self.stop_cause(now_ns) else {
            return;
        };
        if self.stopped.is_none() {
            effects.extend(self.farewell().into_iter().map(Effect::Send));
            effects.push(Effect::Stopped(cause));
        } else if !self.in_ticks()
            && self.connected
            && passed(self.stop_sent_ns, now_ns, STOP_AGAIN)
        {
            effects.push(Effect::Send(self.velocity([0, 0])));
        } else {
            return;
        }
        self.stopped = Some(cause);
        self.stop_sent_ns = Some(now_ns);
    }
}

/// How long a robot may say nothing, on the machine's clock, before it is lost.
fn silence(mission: &Mission, clock: MissionClock) -> Duration {
    let limit = Duration::from_secs_f64(mission.robot.command_limit_s) * SILENT_LIMITS;
    match clock {
        MissionClock::Wall { rate, .. } if rate > 0.0 => limit.div_f64(rate).max(LEAST_SILENCE),
        _ => limit,
    }
}

/// Whether `span` has passed since; it has if there is no since.
fn passed(since_ns: Option<u64>, now_ns: u64, span: Duration) -> bool {
    since_ns.is_none_or(|since| now_ns.saturating_sub(since) >= span.as_nanos() as u64)
}

fn encoded(command: Command) -> Vec<u8> {
    let mut bytes = Vec::new();
    command.encode(Addressing::default(), &mut bytes);
    bytes
}

/// A sonar byte as the pipeline takes it.
fn reading(byte: Option<u8>) -> RangeSample {
    let (status, range_m) = match byte.map(Echo::from_byte) {
        None => (RangeStatus::Absent, None),
        Some(None) => (RangeStatus::Invalid, None),
        Some(Some(echo @ Echo::Touching)) => (RangeStatus::AtContact, echo.metres()),
        Some(Some(echo @ Echo::At(_))) => (RangeStatus::Measured, echo.metres()),
        Some(Some(Echo::Nothing)) => (RangeStatus::Nothing, None),
    };
    RangeSample {
        range_m: range_m.unwrap_or_default(),
        status: status.into(),
        raw_cm: byte.unwrap_or_default(),
        ..RangeSample::default()
    }
}

#[cfg(test)]
mod tests;
