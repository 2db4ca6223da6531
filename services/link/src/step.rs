//! Pure step of the link: events and their times in, samples and bytes out.
//!
//! A tick starts with a motor frame and the newest readings, and ends with its command. In lockstep
//! (a simulated robot at `--pace max`) the robot waits for that command. The link then repeats a
//! tick whose command was lost when a stage ended. On the wall clock the next tick replaces an
//! unanswered one.

mod event;
mod poll;
mod stop;
mod wire;

use std::time::Duration;

use common::{
    clock::{MissionTime, Pace},
    driver::{Base, Driver, Memory, Motion, Turn, WireTally, counts::WheelCounts},
    mission::Mission,
    samples::{
        Action, Cause, CommandSample, CommandState, DoubtsSample, HoldReason, LinkSample, Order,
        Rest, TurnSample, WheelSample,
    },
    stop_socket::Request,
};

use crate::{
    backoff::has_passed,
    clock_rate::ClockRate,
    drivers,
    failsafe::{
        Decision, Failsafe,
        monitor::{Moment, Observation},
        odometry::Odometry,
        presence::Absence,
        restart::RestartWatch,
        wheel_shares::WheelRatio,
    },
    polls::Polls,
    sensors::Sensors,
    speed_trim::SpeedTrim,
    wheel_speeds::WheelSpeeds,
    wire_owner::is_owed,
};

pub use event::{Effect, Entry, Event, State};

/// Ping interval while a motor frame is missing.
const PING_EVERY: Duration = Duration::from_millis(200);
/// Ten times the longest measured tick.
const REPEAT_AFTER: Duration = Duration::from_millis(100);
/// Longest wait in lockstep for the supervisor's limit, beyond a planner's restart for a stalled
/// robot.
pub const LIMIT_WAITED: Duration = Duration::from_secs(5);
/// Least time limit of a command: the wire carries milliseconds, and 0 mostly means none.
const LEAST_LEFT: Duration = Duration::from_millis(1);
/// Longest interval of events without a pause of the link: some of its turns without input.
const PAUSED_AFTER: Duration = Duration::from_millis(100);
/// Copies of a new stop, because datagrams may be lost.
pub const STOPS: u32 = 3;
/// Stop interval: a fading radio may lose all copies, and the robot may ignore its last command's
/// limit.
const STOP_AGAIN: Duration = Duration::from_millis(200);
/// Least interval of stops against another commander. On a wire that doubles datagrams, the
/// acknowledgements of each stop look like another commander's and would be answered by the next.
const STOP_AGAINST_OTHERS: Duration = Duration::from_millis(10);

#[derive(Clone, Debug)]
struct OpenTick {
    /// [`Effect::Tick`], repeated until answered.
    effect: Effect,
    began_ns: u64,
    /// Publication; `None` while waiting for the supervisor's limit.
    given_ns: Option<u64>,
}

/// Sent command, repeated once against loss.
#[derive(Clone, Copy, Debug)]
struct Repeat {
    counts: [i16; 2],
    stamp: MissionTime,
    /// Half a period after the tick.
    due: MissionTime,
}

#[derive(Debug)]
pub struct Link {
    pub state: State,
    now: MissionTime,
    now_ns: u64,
    /// Whether this is the first turn after a pause of the link.
    is_after_pause: bool,
    /// Effects of the present step.
    effects: Vec<Effect>,
    base: Box<dyn Base>,
    /// Drivers of sensors with their own wires.
    drivers: Vec<Box<dyn Driver>>,
    sensors: Sensors,
    polls: Polls,
    speeds: WheelSpeeds,
    clock_rate: ClockRate,
    limit: Duration,
    half_period_ns: u64,
    failsafe: Failsafe,
    restart: RestartWatch,
    pinged_ns: Option<u64>,
    /// None if commands go out unchanged.
    trim: Option<SpeedTrim>,
    wheels: WheelSample,
    open: Option<OpenTick>,
    /// Last tick allowed in lockstep; `None` for no limit.
    last_tick: Option<u64>,
    target_number: u64,
    newest_command: Option<CommandSample>,
    repeat: Option<Repeat>,
    pub decision: Decision,
    /// Start of this link, or last time of an operator's stop; earlier ticks' commands are refused.
    /// None in lockstep, where a tick waits for its answer.
    stood: Option<MissionTime>,
    stop_sent_ns: Option<u64>,
    /// Motor frames due in lockstep, one per command and ping.
    due: u32,
    /// Order to wait in lockstep, until the given tick is answered: whether it comes before or
    /// after the tick's command must not decide where the robot comes to rest.
    waits: Option<(Order, HoldReason)>,
    /// Counts of commands and repetitions; the other values are unset.
    pub tally: LinkSample,
    refused_ns: Option<u64>,
    /// Newest motion stamp, and its arrival.
    stamped: Option<(i64, MissionTime)>,
}

impl Link {
    /// Returns a link in lockstep before tick 0.
    pub fn new(mission: &Mission) -> Self {
        Self {
            state: State::default(),
            now: MissionTime::default(),
            now_ns: 0,
            is_after_pause: false,
            effects: Vec::new(),
            base: drivers::base(mission).0,
            drivers: drivers::sensors(mission).into_iter().map(|sensor| sensor.driver).collect(),
            sensors: Sensors::new(mission),
            polls: Polls::new(mission),
            speeds: WheelSpeeds::new(mission),
            clock_rate: ClockRate::default(),
            limit: Duration::from_secs_f64(mission.robot.command_limit_s),
            half_period_ns: (0.5e9 / mission.robot.rate_hz) as u64,
            failsafe: Failsafe::new(mission),
            restart: RestartWatch::new(mission),
            pinged_ns: None,
            trim: mission.speed_trim().then(|| SpeedTrim::new(mission)),
            wheels: WheelSample::default(),
            open: None,
            last_tick: None,
            target_number: 0,
            newest_command: None,
            repeat: None,
            decision: Decision { action: Action::Stop, cause: Cause::NotOrdered },
            stood: None,
            stop_sent_ns: None,
            due: 0,
            waits: None,
            tally: LinkSample::default(),
            refused_ns: None,
            stamped: None,
        }
    }

    /// Returns the evidence against the robot; none in lockstep, whose repeated frames are not
    /// judged.
    pub(crate) fn doubts(&self) -> DoubtsSample {
        if self.in_ticks() { DoubtsSample::default() } else { self.failsafe.doubts() }
    }

    pub fn restore(&mut self, state: State) {
        self.state = state;
        self.observe(Observation::Pace(state.pace));
    }

    pub fn step(&mut self, entry: Entry<'_>) -> Vec<Effect> {
        let Entry { event, machine_ns, now } = entry;
        self.is_after_pause |= has_passed(self.now_ns, machine_ns, PAUSED_AFTER);
        self.now = now;
        self.now_ns = machine_ns;
        if !self.in_ticks() {
            self.stood.get_or_insert(now);
        }
        match event {
            Event::Datagram(bytes) => {
                let heard = self.base.hear(bytes);
                self.take_heard(heard);
            }
            Event::Wire(open) => self.take_wire(open),
            Event::Sensor(number, bytes) => self.take_sensor(number, bytes),
            Event::SensorWire(number, open) => self.take_sensor_wire(number, open),
            Event::Command(command) => self.take_command(&command),
            Event::Order(order, reason) => self.take_order(order, reason),
            Event::Operator(Request::Stop) => self.failsafe.orders.stopped_here = true,
            Event::Operator(Request::Resume) => {
                self.failsafe.orders.stopped_here = false;
                self.observe(Observation::Resumed);
            }
            Event::TickLimit { last_tick, target_number } => {
                self.last_tick = Some(last_tick);
                self.target_number = target_number;
            }
            Event::Quiet => self.is_after_pause = false,
            Event::Operator(Request::SignOff | Request::Look) => {}
            Event::Remember(memory) => {
                if let Some(odometry) = self.base.odometry() {
                    odometry.remember(memory);
                }
                return Vec::new();
            }
            Event::Telemetry => return Vec::new(),
            Event::End => return self.final_stops(),
        }
        self.keep_connected();
        self.keep_polling();
        self.give_tick();
        self.repeat_command();
        self.guard();
        assert!(self.connected() || self.decision.stops(), "the link stops a lost robot");
        assert!(!self.decision.stops() || self.repeat.is_none());
        assert!(self.waits.is_none() || self.in_ticks());
        let sent = self.effects.iter().filter_map(|effect| match effect {
            Effect::Send(bytes) => Some(self.base.owed(bytes)),
            _ => None,
        });
        if let Some(owed) = sent.reduce(|one, other| one + other) {
            self.observe(Observation::Sent(owed));
        }
        std::mem::take(&mut self.effects)
    }

    pub fn connected(&self) -> bool {
        self.failsafe.presence.connected
    }

    pub fn wire_tally(&self) -> WireTally {
        let dropped = self.drivers.iter().map(|driver| driver.tally().bytes_dropped);
        self.base.tally().with_dropped(dropped.sum())
    }

    pub const fn restarts(&self) -> u32 {
        self.restart.restarts
    }

    pub fn is_at_rest(&self) -> bool {
        self.rest() == Rest::AtRest
    }

    /// Returns the rest by the encoders. In lockstep a held robot is at rest, because mission time
    /// stands still.
    pub fn rest(&self) -> Rest {
        match (self.in_ticks(), self.connected()) {
            (true, _) if self.decision.stops() => Rest::AtRest,
            (false, true) => self.failsafe.stop.rest(self.now),
            _ => Rest::Unknown,
        }
    }

    pub fn explain(&self, cause: Cause, machine_ns: u64) -> Option<String> {
        self.failsafe.explain(cause, Moment { machine_ns, ..self.moment() })
    }

    pub fn absence(&self, now_ns: u64) -> Absence {
        self.failsafe.presence.absence(now_ns)
    }

    pub fn losses(&self) -> u64 {
        self.failsafe.presence.losses
    }

    pub fn owes_stop(&self, before: bool) -> bool {
        let moves = self.failsafe.stop.is_told_to_move();
        !self.in_ticks() && is_owed(before, moves, self.is_at_rest())
    }

    /// Returns None if the robot itself counts.
    pub(crate) fn driver_memory(&mut self) -> Option<Memory> {
        self.base.odometry()?.memory()
    }

    pub const fn is_stopped_by_operator(&self) -> bool {
        self.failsafe.orders.stopped_here
    }

    fn final_stops(&self) -> Vec<Effect> {
        (0..STOPS).map(|_| Effect::Send(self.velocity_0())).collect()
    }

    const fn moment(&self) -> Moment {
        let Self { now, now_ns, is_after_pause, .. } = *self;
        Moment { time: now, machine_ns: now_ns, is_after_pause }
    }

    fn observe(&mut self, what: Observation<'_>) {
        self.failsafe.observe(&what, self.moment());
    }

    fn send(&mut self, bytes: Vec<u8>) {
        self.effects.push(Effect::Send(bytes));
    }

    /// Returns true if `since_ns` is `None`.
    fn passed(&self, since_ns: Option<u64>, span: Duration) -> bool {
        since_ns.is_none_or(|since_ns| has_passed(since_ns, self.now_ns, span))
    }

    fn ordered_to_drive(&self) -> bool {
        self.failsafe.orders.drive()
    }

    fn in_ticks(&self) -> bool {
        self.state.pace == Pace::Max
    }

    fn arrived(&self) -> bool {
        self.newest_command.is_some_and(|command| {
            command.state() == CommandState::Arrived && command.target_number >= self.target_number
        })
    }

    fn begin_tick(&mut self, motion: Motion) {
        // The last due answer shows the present state.
        self.due = self.due.saturating_sub(1);
        // A held robot's ticks continue, so that it may be carried. In lockstep mission time stands
        // still.
        let stands_by = !self.in_ticks() && self.failsafe.orders.stands_by();
        if !self.ordered_to_drive() && !stands_by {
            return;
        }
        if self.in_ticks() {
            if self.open.is_some() || self.due > 0 {
                return;
            }
            self.judge_tick(&motion);
        } else {
            // Unanswered ticks use up their number too.
            self.state.next_tick += 1;
        }
        let endless = motion.endless;
        let Failsafe { odometry: Odometry { shares, .. }, range, .. } = &self.failsafe;
        let WheelRatio { ratio, deviation } = shares.ratio();
        let [by_commands, by_ranges] = [shares.untold_m(), range.untold_m()];
        let wheels = WheelSample {
            restarts: self.restart.restarts,
            told_ratio: ratio,
            told_ratio_sd: deviation,
            untold_m: [0, 1].map(|wheel| by_commands[wheel] + by_ranges[wheel]),
            ..motion.wheels
        };
        self.wheels = wheels;
        if let Some(trim) = &mut self.trim {
            trim.rolled(WheelCounts::of(&wheels, endless.as_ref()), self.now.seconds());
        }
        let (ranges, scans) = self.sensors.for_tick(&motion, self.now);
        // The turn ends with the tick's motion.
        let capture_ns = self.now.0;
        let turn = self.base.turn_for_tick().map(|Turn { sequence, turn_rad, variance_rad2 }| {
            TurnSample { capture_ns, sequence, turn_rad, variance_rad2, ..TurnSample::default() }
        });
        let contact = self.failsafe.odometry.contacts.new.take();
        let contact = contact.or_else(|| self.failsafe.touch.take_contact(self.now));
        let effect = Effect::Tick {
            tick: self.open_number(),
            time: self.now,
            ranges,
            scans,
            turn,
            wheels,
            endless,
            contact: contact.map(Box::new),
            response: self.failsafe.base.sample().map(Box::new),
        };
        self.open = Some(OpenTick { effect, began_ns: self.now_ns, given_ns: None });
        self.give_tick();
    }

    fn open_number(&self) -> u64 {
        assert!(self.in_ticks() || self.state.next_tick > 0, "a tick is open");
        if self.in_ticks() { self.state.next_tick } else { self.state.next_tick - 1 }
    }

    fn take_command(&mut self, command: &CommandSample) {
        if self.newest_command.is_some_and(|held| held.stamp.tick > command.stamp.tick) {
            return;
        }
        let answers = self.open.is_some() && command.stamp.tick == self.open_number();
        if self.in_ticks() && !answers {
            // A repeated tick was answered twice.
            return;
        }
        self.newest_command = Some(*command);
        self.observe(Observation::Command(command));
        let decision = self.decide();
        if decision.stops() || Some(command.stamp.time()) <= self.stood {
            return;
        }
        let share = decision.action.speed_share();
        assert!(share > 0.0 && share <= 1.0);
        let counts = match command.state() {
            CommandState::Driving => {
                let reached = self.trim.as_ref().map_or(1.0, SpeedTrim::share);
                assert!(reached > 0.0 && reached <= 1.0);
                let permitted = self.failsafe.touch.permitted(command, self.now);
                self.speeds.of(&permitted, share / reached, &self.wheels)
            }
            CommandState::Halt | CommandState::Arrived => [0, 0],
        };
        if let Some(trim) = &mut self.trim {
            trim.told(counts);
        }
        self.tell(counts, self.limit);
        let stamp = command.stamp.time();
        self.repeat = Some(Repeat {
            counts,
            stamp,
            due: MissionTime(stamp.0.saturating_add(self.half_period_ns)),
        });
        self.tally.commands_out += 1;
        self.due += 1;
        self.poll_in_ticks();
        if answers && let Some(open) = self.open.take() {
            self.effects.push(Effect::Answered { began_ns: open.began_ns });
            if self.in_ticks() {
                self.state.next_tick += 1;
            }
            if let Some((order, reason)) = self.waits.take() {
                self.take_order(order, reason);
            }
        }
    }

    fn take_order(&mut self, order: Order, reason: HoldReason) {
        let is_given = self.open.as_ref().is_some_and(|open| open.given_ns.is_some());
        let waits = reason == HoldReason::Waiting && self.ordered_to_drive();
        self.waits = (self.in_ticks() && is_given && waits).then_some((order, reason));
        if self.waits.is_some() {
            return;
        }
        let drives = order == Order::Drive && !self.ordered_to_drive();
        if drives && self.failsafe.orders.by_operator() {
            self.observe(Observation::Resumed);
        }
        self.observe(Observation::Directive(order, reason));
        if drives && self.in_ticks() && self.due == 0 {
            // A robot that waits for commands answers a ping with its state, which starts tick 0.
            self.ping();
        }
    }

    /// Publishes the open tick if allowed; repeats it in lockstep while unanswered.
    fn give_tick(&mut self) {
        let Some(mut open) = self.open.take() else {
            return;
        };
        if self.is_due(&mut open) {
            open.given_ns = Some(self.now_ns);
            self.effects.push(open.effect.clone());
        }
        self.open = Some(open);
    }

    fn is_due(&mut self, open: &mut OpenTick) -> bool {
        let tick = self.open_number();
        let in_ticks = self.in_ticks();
        match open.given_ns {
            None if in_ticks && self.arrived() => return false,
            None if in_ticks && self.last_tick.is_some_and(|last| tick > last) => {
                if !self.passed(Some(open.began_ns), LIMIT_WAITED) {
                    return false;
                }
                self.last_tick = None;
                self.effects.push(Effect::Unlimited { tick });
                open.began_ns = self.now_ns;
            }
            None => open.began_ns = self.now_ns,
            Some(given) if in_ticks && self.passed(Some(given), REPEAT_AFTER) => {
                self.tally.repeated_ticks += 1;
            }
            Some(_) => return false,
        }
        true
    }

    /// Repeats the newest command halfway to the next tick, for the rest of its limit, so that the
    /// robot stops no later. In lockstep each command yields a frame, which reveals a loss.
    fn repeat_command(&mut self) {
        if self.in_ticks() {
            return;
        }
        let now = self.now;
        let Some(repeat) = self.repeat.take_if(|repeat| repeat.due <= now) else {
            return;
        };
        let left = self.limit.saturating_sub(now.since(repeat.stamp));
        // The next command follows an open tick soon.
        if self.open.is_some() || left < LEAST_LEFT || self.decide().stops() {
            return;
        }
        self.tell(repeat.counts, left);
        self.tally.repeated_commands += 1;
    }
}

#[cfg(test)]
mod tests;
