//! Process of the link: reads the wire, `command`, `directive` and `tick_limit`, and writes the
//! wire, `ranges`, `wheels`, `link` and telemetry.

use std::{
    io,
    path::{Path, PathBuf},
    time::Duration,
};

use common::{
    address::Address,
    bus::{Reader, Writers},
    clock::{MissionClock, monotonic_ns},
    driver::{Memory, Refusal},
    latency::Histogram,
    machine, readers,
    samples::{Action, Cause, CommandSample, DirectiveSample, LinkSample, TickLimitSample},
    shell::{Context, Process, Progress, Result, StageError},
    stage::Runner,
    stop_socket::{Identity, OwedStop, Request, StopMark, StopSocket},
    topics::{
        BASE_RESPONSE, COMMAND, CONTACT, COUNTS, DIRECTIVE, DOUBTS, IMU_TURN, INFRARED, LINK,
        POWER, RANGES, SCAN, SURROUNDINGS, TICK_LIMIT, WHEELS, WIRE,
    },
    wiring::{Persists, Topics},
};

use crate::{
    drivers,
    failsafe::{
        Decision,
        battery::{BatteryChange, Charge},
        monitor::Moment,
    },
    stage::LinkStage,
    step::{Effect, Entry, Event},
    stop_guard::StopGuard,
    transport::Transport,
};

/// The step reports one refused message a second.
const REFUSAL_LASTS_NS: u64 = 2_000_000_000;
/// Interval of the checks without input: a fifth of the shortest deadline.
pub(crate) const LOOKS_AGAIN: Duration = Duration::from_millis(20);

/// Longest delay of the heartbeat by a flood, besides one datagram. The rest waits for the next
/// turn.
const MOST_LISTENING_NS: u64 = 20_000_000;

const MEMORY_BYTES: usize = 64;

readers! {
    pub struct Inputs {
        inputs {
            directive: Reader<DirectiveSample> = DIRECTIVE,
            tick_limit: Reader<TickLimitSample> = TICK_LIMIT,
        }
        feedback {
            command: Reader<CommandSample> = COMMAND,
        }
    }
}

pub struct Shell {
    transport: Transport,
    wires: Vec<Transport>,
    inputs: Inputs,
    writers: Option<Writers>,
    runner: Runner<LinkStage>,
    /// None on a simulated machine, and if it could not be created, which the log says.
    stop_socket: Option<StopSocket>,
    stop_mark: StopMark,
    marked: bool,
    /// None on a simulated machine, in lockstep, where a robot waits for commands, and if it could
    /// not be started, which the log says.
    guard: Option<StopGuard>,
    owed_mark: OwedStop,
    owes_stop: bool,
    directory: PathBuf,
    has_telemetry: bool,
    clock: MissionClock,
    latency: Histogram,
    latency_ns: u64,
    stated_ns: u64,
    /// Reason of the newest refusal, and its time, nanoseconds.
    refused: Option<(Refusal, u64)>,
}

impl Process for Shell {
    const NAME: &'static str = "link";
    const WAKES: Topics = &[&COMMAND, &DIRECTIVE, &TICK_LIMIT];
    const OUTPUTS: Topics = &[
        &BASE_RESPONSE,
        &DOUBTS,
        &CONTACT,
        &SCAN,
        &IMU_TURN,
        &COUNTS,
        &RANGES,
        &WHEELS,
        &LINK,
        &INFRARED,
        &POWER,
        &SURROUNDINGS,
        &WIRE,
    ];
    const PERSISTS: Persists = Persists::State(MEMORY_BYTES);
    type Readers = Inputs;

    fn open(context: &mut Context, inputs: Inputs) -> Result<Self> {
        // The guard identifies this link by its socket, so that comes first.
        let domain = context.run.robot.domain();
        let is_real = !machine::is_simulated();
        let bind = || StopSocket::bind(domain.stop_socket());
        let stop_socket = is_real.then(bind).and_then(|bound| {
            bound.inspect_err(without("operators' stops without middleware")).ok()
        });
        let directory = &context.generation.directory.clone();
        let in_ticks = matches!(context.run.clock, MissionClock::Ticks { .. });
        let guard = (is_real && !in_ticks)
            .then(|| start_guard(directory, Identity::now(&domain.stop_socket())))
            .flatten();
        let owed_mark = OwedStop::of(domain);
        let stop_mark = StopMark::of(directory);
        let mission = &context.run.mission;
        let transport = Transport::of_base(&context.run.address, mission)?;
        let wires = drivers::sensors(mission)
            .into_iter()
            .map(|sensor| {
                let address = sensor.address.as_ref().map(Address::resolve).transpose();
                let address = address.map_err(|error| StageError::Other(error.to_string()))?;
                Ok(Transport::open(&address.unwrap_or(context.run.address.clone()), sensor.line)?)
            })
            .collect::<Result<Vec<_>>>()?;
        for wire in std::iter::once(&transport).chain(&wires).filter_map(Transport::descriptor) {
            context.waiter.on_readable(wire)?;
        }
        if let Some(socket) = &stop_socket {
            context.waiter.on_readable(socket)?;
        }
        // Saved by an earlier link's driver.
        let memory: Option<Memory> = context.saved_state()?;
        let mut shell = Self {
            transport,
            wires,
            inputs,
            writers: context.writers(),
            runner: Runner::open(context, LinkStage::longest)?,
            stop_socket,
            marked: stop_mark.is_set(),
            stop_mark,
            guard,
            owes_stop: owed_mark.is_set(),
            owed_mark,
            directory: directory.clone(),
            has_telemetry: false,
            clock: context.run.clock,
            latency: Histogram::default(),
            latency_ns: 0,
            stated_ns: 0,
            refused: None,
        };
        if let Some(memory) = memory {
            shell.take(Event::Remember(memory))?;
        }
        if shell.marked {
            shell.take(Event::Operator(Request::Stop))?;
        }
        Ok(shell)
    }

    fn turn(&mut self) -> Result<Progress> {
        self.take_operators_requests()?;
        self.maintain()?;
        if let Some(directive) = self.inputs.directive.newest()? {
            self.take(Event::Order(directive.order(), directive.reason()))?;
        }
        // After the order, because the supervisor publishes the first limit before it.
        let limit = self.inputs.tick_limit.newest()?;
        if let Some(TickLimitSample { last_tick, target_number, .. }) = limit {
            self.take(Event::TickLimit { last_tick, target_number })?;
        }
        while let Some(command) = self.inputs.command.next_sample()? {
            self.take(Event::Command(command))?;
        }
        let began_ns = monotonic_ns();
        loop {
            let now_ns = monotonic_ns();
            if now_ns - began_ns > MOST_LISTENING_NS {
                break;
            }
            let now = self.clock.at(self.runner.stage.link.state.next_tick, now_ns);
            let mut effects = Vec::new();
            // A simulated laser sends before the frames of its tick: it is received after they
            // came, and taken before them.
            let datagram = self.transport.receive(now_ns)?;
            let mut came = datagram.is_some();
            let mut take =
                |event: Event<'_>| self.runner.take_entry(Entry { event, machine_ns: now_ns, now });
            for (number, wire) in (0..).zip(&mut self.wires) {
                while let Some(bytes) = wire.receive(now_ns)? {
                    effects.extend(take(Event::Sensor(number, bytes))?);
                    came = true;
                    if monotonic_ns() - began_ns > MOST_LISTENING_NS {
                        break;
                    }
                }
            }
            if let Some(bytes) = datagram {
                effects.extend(take(Event::Datagram(bytes))?);
            }
            self.carry_out(effects)?;
            if !came {
                break;
            }
        }
        self.maintain()?;
        self.take(Event::Quiet)?;
        self.answer_operators();
        if monotonic_ns() - self.stated_ns >= LINK.spec().restated_every().as_nanos() as u64 {
            self.keep_guard();
            self.state()?;
        }
        self.runner.publish_rest()?;
        Ok(self.runner.out.at)
    }

    fn after_ready(&mut self, context: &mut Context) -> Result {
        self.has_telemetry = true;
        self.runner.out.open_late(context)
    }

    fn trouble(&mut self) -> Option<Refusal> {
        let link = &self.runner.stage.link;
        let now_ns = monotonic_ns();
        let is_told = !link.connected() || self.transport.is_cut();
        let base = is_told.then(|| self.transport.trouble()).flatten();
        self.refused.take_if(|(_, at_ns)| now_ns.saturating_sub(*at_ns) > REFUSAL_LASTS_NS);
        base.or_else(|| self.wires.iter().find_map(Transport::trouble))
            .or_else(|| self.refused.as_ref().map(|(why, _)| why.clone()))
            .or_else(|| link.explain(link.decision.cause, now_ns).map(Refusal::from))
    }

    fn has_idle_work(&self) -> bool {
        self.has_telemetry && self.runner.stage.has_telemetry()
    }

    /// Returns the interval of checks without input, which repeat commands, run the failsafe and
    /// poll the robot.
    fn looks_again_after(&self) -> Option<Duration> {
        let link = &self.runner.stage.link;
        let at = |machine_ns| {
            let time = self.clock.at(link.state.next_tick, machine_ns);
            Moment { time, machine_ns, ..Moment::default() }
        };
        let now = at(monotonic_ns());
        let until_due = match self.clock {
            MissionClock::Wall { rate, .. } if rate > 0.0 => {
                link.until_due(now.time).map(|span| span.div_f64(rate))
            }
            _ => None,
        };
        let restated = at(self.stated_ns + LINK.spec().restated_every().as_nanos() as u64);
        let looks = if link.is_calm_until(restated) {
            Duration::from_nanos(restated.machine_ns.saturating_sub(now.machine_ns))
        } else {
            LOOKS_AGAIN
        };
        Some(until_due.map_or(looks, |until| until.min(looks)))
    }

    fn idle(&mut self) -> Result {
        if self.has_idle_work() {
            self.take(Event::Telemetry)?;
        }
        Ok(())
    }

    fn stop(&mut self) -> Result {
        self.take(Event::End)?;
        self.runner.publish_rest()?;
        tracing::info!("stop sent to the robot");
        Ok(())
    }
}

fn start_guard(directory: &Path, link: Identity) -> Option<StopGuard> {
    StopGuard::start(directory, link).inspect_err(without("stop guard")).ok()
}

fn without(what: &'static str) -> impl Fn(&io::Error) {
    move |error| tracing::error!(%error, "the link goes on without its {what}")
}

fn log_battery(BatteryChange { pack, volts, charge }: BatteryChange) {
    let volts = format!("{volts:.1}");
    match charge {
        Charge::Empty => {
            tracing::error!(pack, volts, "battery empty; charge it, or set robot.low_battery_v");
        }
        Charge::Low => {
            tracing::warn!(pack, volts, "battery low; charge it, or set robot.low_battery_v");
        }
        Charge::Enough => tracing::info!(pack, volts, "battery voltage recovered"),
    }
}

fn log_decision(before: Decision, now: Decision) {
    let robot = now.action.effect();
    let cause = now.cause.name();
    // A mission's end needs no warning.
    if now.action > before.action && now.cause != Cause::MissionOver {
        tracing::warn!(robot, cause, "failsafe");
    } else {
        tracing::info!(robot, cause, "failsafe");
    }
}

impl Shell {
    fn take_operators_requests(&mut self) -> Result {
        while let Some(request) = self.stop_socket.as_mut().and_then(StopSocket::take) {
            if matches!(request, Request::Stop | Request::Resume) {
                tracing::warn!(?request, "an operator sent a request to the link directly");
                self.take(Event::Operator(request))?;
            }
        }
        Ok(())
    }

    fn answer_operators(&mut self) {
        let link = &self.runner.stage.link;
        if link.decision.stops()
            && link.is_at_rest()
            && let Some(socket) = &mut self.stop_socket
        {
            socket.tell_at_rest();
        }
        let stopped = link.is_stopped_by_operator();
        if stopped != self.marked {
            self.marked = stopped;
            if let Err(error) = self.stop_mark.set(stopped) {
                tracing::error!(%error, "cannot mark the operator's stop, so a restarted link will not know of it");
            }
        }
    }

    /// Marks an owed stop before a motion command is sent.
    fn mark_owed_stop(&mut self) {
        let owes = self.runner.stage.link.owes_stop(self.owes_stop);
        if owes != self.owes_stop {
            self.owes_stop = owes;
            self.set_owed_mark();
        }
    }

    fn set_owed_mark(&self) {
        if let Err(error) = self.owed_mark.set(self.owes_stop, &self.directory) {
            tracing::error!(%error, "cannot mark that the robot may move, so no stop guard will order its stop");
        }
    }

    /// Replaces a killed guard, and renews a mark removed by a cleaner of temporary files.
    fn keep_guard(&mut self) {
        if self.owes_stop {
            self.set_owed_mark();
        }
        if let Some(ended) = self.guard.take_if(StopGuard::has_ended) {
            tracing::warn!("the stop guard ended; the link starts another");
            self.guard = start_guard(&self.directory, ended.link);
        }
    }

    fn maintain(&mut self) -> Result {
        let now_ns = monotonic_ns();
        if let Some(open) = self.transport.maintain(now_ns)? {
            self.take(Event::Wire(open))?;
        }
        for number in 0..self.wires.len() {
            if let Some(open) = self.wires[number].maintain(now_ns)? {
                self.take(Event::SensorWire(number as u8, open))?;
            }
        }
        Ok(())
    }

    fn take(&mut self, event: Event<'_>) -> Result {
        let machine_ns = monotonic_ns();
        let now = self.clock.at(self.runner.stage.link.state.next_tick, machine_ns);
        let effects = self.runner.take_entry(Entry { event, machine_ns, now })?;
        self.carry_out(effects)
    }

    fn carry_out(&mut self, effects: Vec<Effect>) -> Result {
        self.mark_owed_stop();
        for effect in effects {
            match effect {
                Effect::Send(bytes) => self.transport.send(&bytes)?,
                Effect::SendSensor(number, bytes) => {
                    if let Some(wire) = self.wires.get_mut(usize::from(number)) {
                        wire.send(&bytes)?;
                    }
                }
                Effect::Answered { began_ns } => {
                    if let Some(memory) = self.runner.stage.link.driver_memory() {
                        self.runner.out.save(&memory)?;
                    }
                    self.latency_ns = monotonic_ns().saturating_sub(began_ns);
                    self.latency.record(self.latency_ns);
                    self.state()?;
                }
                Effect::Unlimited { tick } => {
                    tracing::warn!(
                        tick,
                        "the supervisor's tick limit did not rise in time; the tick begins without it"
                    );
                }
                Effect::Decided { before, now } => {
                    log_decision(before, now);
                    // A worse cause may have hidden a slow robot's fault.
                    if (now.action >= before.action || now.action == Action::Slow)
                        && let Some(explanation) =
                            self.runner.stage.link.explain(now.cause, monotonic_ns())
                    {
                        tracing::warn!("{explanation}");
                    }
                    self.state()?;
                }
                Effect::Connected(answers) => {
                    if answers {
                        tracing::info!("robot answers");
                    } else {
                        tracing::warn!("robot lost; the link pings it until it answers");
                    }
                    self.state()?;
                }
                Effect::Restarted => {
                    tracing::warn!(
                        restarts = self.runner.stage.link.restarts(),
                        "the robot has restarted"
                    );
                }
                Effect::CountsElsewhere => tracing::warn!(
                    "the encoder counts or the odometry jumped farther than the wheels can turn, and continue from there; the pose stays unchanged"
                ),
                Effect::StopBy(method) => {
                    tracing::warn!(
                        by = method,
                        "the robot does not stop; the link uses the next stop method"
                    );
                }
                Effect::FoundResponse(words) => tracing::warn!("{words}"),
                Effect::Refused(why) => {
                    tracing::warn!("the robot's message is not in its protocol: {why}");
                    self.refused = Some((why, monotonic_ns()));
                }
                Effect::ClockRate(rate) => {
                    let pace = match self.clock {
                        MissionClock::Wall { rate: pace, .. } => pace * rate,
                        MissionClock::Ticks { .. } => rate,
                    };
                    let why: Refusal = format!(
                        "the robot's clock runs {rate:.2} times as fast as mission time; let its simulator run in real time, or give `run --pace {pace:.2}`"
                    )
                    .into();
                    tracing::warn!("{why}");
                    self.refused = Some((why, monotonic_ns()));
                }
                Effect::AskedForStreams => {
                    tracing::info!("the link requests the robot's streams again");
                }
                Effect::Battery(change) => log_battery(change),
                // Published by the stage.
                Effect::Tick { .. }
                | Effect::Infrared(_)
                | Effect::Power(_)
                | Effect::Surroundings(_) => {}
            }
        }
        Ok(())
    }

    fn state(&mut self) -> Result {
        let now_ns = monotonic_ns();
        self.stated_ns = now_ns;
        let link = &self.runner.stage.link;
        let wire = link.wire_tally();
        let absence = link.absence(now_ns);
        // Attempts to open a closed wire, else pings.
        let (attempts, next_attempt_ns) = match self.transport.attempts(now_ns) {
            Some(openings) => (openings.made, openings.next_ns),
            None => (absence.pings, absence.next_ping_ns),
        };
        let carried = self.transport.tally();
        let ignored = self.writers.as_ref().map(Writers::ignored).unwrap_or_default();
        let sample = LinkSample {
            connected: link.connected().into(),
            action: link.decision.action.into(),
            cause: link.decision.cause.into(),
            at_rest: link.rest().into(),
            frames_in: wire.messages,
            bytes_dropped: wire.bytes_dropped,
            foreign_datagrams: carried.foreign_datagrams,
            unsent: carried.unsent,
            ignored_samples: ignored.samples,
            ignored_writer: ignored.process,
            other_port: carried.other_port.into(),
            losses: link.losses(),
            reboots: link.restarts().into(),
            lost_ns: absence.lost_ns,
            attempts,
            next_attempt_ns,
            latency_ns: self.latency_ns,
            latency_max_ns: self.latency.max_ns,
            latency_histogram: self.latency.counts,
            ..link.tally
        };
        self.runner.out.publish(&LINK, sample)
    }
}
