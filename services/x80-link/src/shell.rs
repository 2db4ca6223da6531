//! The wire, `command`, `directive` and `tick_limit` in; `range`, `wheels`, `link`, telemetry and the wire out.

use std::time::Duration;

use common::{
    bus::{Reader, SliceWriter, Writer},
    clock::{MissionClock, Pace, monotonic_ns},
    inputs::InputLog,
    latency::Histogram,
    latency_budget::{Answers, Item, LatencyBudget},
    samples::{
        Cause, CommandSample, DirectiveSample, HoldReason, InfraredSample, LinkSample, Order,
        PowerSample, RangeSample, SurroundingsSample, TickLimitSample, WheelSample, WireHeader,
    },
    shell::{Context, Process, Progress, StageError},
    step::Step as _,
    topics::{self, AnyTopic as _},
};

use crate::{
    failsafe::{
        Decision,
        battery::{BatteryChange, Charge},
    },
    replay::{Carried, Entry, Taken, WIRE_PIECE},
    step::{Effect, Event, Input, Link, State},
    transport::{Transport, TransportError},
    writers::Writers,
};

/// Without input the link looks at the clock so often: a fifth of the shortest time that it waits for anything.
const LOOKS_AGAIN: Duration = Duration::from_millis(20);

/// Where it goes.
#[derive(Debug)]
struct Telemetry {
    infrared: Writer<InfraredSample>,
    power: Writer<PowerSample>,
    surroundings: Writer<SurroundingsSample>,
}

/// The link process.
#[derive(Debug)]
pub struct Shell {
    transport: Transport,
    command: Reader<CommandSample>,
    writers: Writers,
    directive: Reader<DirectiveSample>,
    tick_limit: Reader<TickLimitSample>,
    range: Writer<RangeSample>,
    wheels: Writer<WheelSample>,
    state: Writer<LinkSample>,
    wire: SliceWriter<WireHeader, u8>,
    inputs: InputLog,
    /// What nobody in the pipeline waits for: published when it has a lull.
    carried: Carried,
    /// Opened once the link works.
    telemetry: Option<Telemetry>,
    clock: MissionClock,
    link: Link,
    latency: Histogram,
    latency_ns: u64,
    stated_ns: u64,
    budget: LatencyBudget,
}

impl Process for Shell {
    fn open(context: &mut Context) -> Result<Self, StageError> {
        let transport = Transport::open(&context.run.address).map_err(wire_broke)?;
        context.waiter.on_readable(&transport)?;
        context.waiter.on(context.bus.wakeup(&topics::COMMAND)?);
        context.waiter.on(context.bus.wakeup(&topics::DIRECTIVE)?);
        context.waiter.on(context.bus.wakeup(&topics::TICK_LIMIT)?);
        let generation = context.generation.number;
        let run = &context.run;
        let mut link = Link::new(&run.mission);
        let state = State {
            pace: match run.clock {
                MissionClock::Ticks { .. } => Pace::Max,
                MissionClock::Wall { rate, .. } => Pace::Rate(rate),
            },
            next_tick: context.generation.first_tick,
        };
        let inputs = InputLog::begin(context, &state)?;
        link.restore(state)
            .map_err(|foreign| StageError::Other(foreign.to_string()))?;
        let mut command = context.bus.reader(&topics::COMMAND)?;
        let writers = Writers::open(&context.bus, &mut command)?;
        Ok(Self {
            transport,
            command,
            writers,
            directive: context.bus.reader(&topics::DIRECTIVE)?,
            tick_limit: context.bus.reader(&topics::TICK_LIMIT)?,
            range: context.bus.writer(&topics::RANGE, generation)?,
            wheels: context.bus.writer(&topics::WHEELS, generation)?,
            state: context.bus.writer(&topics::LINK, generation)?,
            wire: context
                .bus
                .slice_writer(&topics::WIRE, generation, WIRE_PIECE)?,
            inputs,
            carried: Carried::default(),
            telemetry: None,
            clock: run.clock,
            link,
            latency: Histogram::default(),
            latency_ns: 0,
            stated_ns: 0,
            budget: context.budget.clone(),
        })
    }

    fn turn(&mut self) -> Result<Progress, StageError> {
        self.maintain()?;
        if let Some(directive) = self.directive.newest()? {
            let order = Order::from_byte(directive.order);
            let reason = HoldReason::from_byte(directive.reason);
            self.take(Event::Order(order, reason), monotonic_ns())?;
        }
        // After the order: the first limit was published before it.
        if let Some(limit) = self.tick_limit.newest()? {
            self.take(Event::TickLimit(limit.last_tick), monotonic_ns())?;
        }
        self.writers.follow(&mut self.command)?;
        while let Some(command) = self.command.take()? {
            self.take(Event::Command(&command), monotonic_ns())?;
        }
        loop {
            // A tick begins with its datagram.
            self.budget.awake();
            let now_ns = monotonic_ns();
            let Some(bytes) = self.transport.receive(now_ns).map_err(wire_broke)? else {
                break;
            };
            let now = self.clock.at(self.link.state().next_tick, now_ns);
            let at = self.carried.progress;
            let taken = Taken::Datagram(bytes);
            let entry = Entry::Step(taken, now_ns, now);
            self.budget.end(Item::Read);
            self.inputs.note(&entry, at)?;
            self.carried.received(bytes, now_ns);
            self.budget.end(Item::Persist);
            let input = Input {
                event: Event::Datagram(bytes),
                machine_ns: now_ns,
            };
            let effects = self.link.step(input, now);
            self.budget.end(Item::Step);
            self.carry_out(effects, now_ns)?;
        }
        self.maintain()?;
        self.take(Event::Quiet, monotonic_ns())?;
        if monotonic_ns() - self.stated_ns >= topics::LINK.restated_every().as_nanos() as u64 {
            self.state()?;
        }
        self.publish_wire()?;
        Ok(self.carried.progress)
    }

    fn after_ready(&mut self, context: &Context) -> Result<(), StageError> {
        let (bus, generation) = (&context.bus, context.generation.number);
        self.telemetry = Some(Telemetry {
            infrared: bus.writer(&topics::INFRARED, generation)?,
            power: bus.writer(&topics::POWER, generation)?,
            surroundings: bus.writer(&topics::SURROUNDINGS, generation)?,
        });
        Ok(())
    }

    fn has_idle_work(&self) -> bool {
        self.telemetry.is_some() && self.carried.has_telemetry()
    }

    /// Commands are repeated, and the failsafe acts, when it is time.
    fn looks_again_after(&self) -> Option<Duration> {
        Some(LOOKS_AGAIN)
    }

    fn idle(&mut self) -> Result<(), StageError> {
        let Some(telemetry) = &mut self.telemetry else {
            return Ok(());
        };
        let carried = &mut self.carried;
        if !carried.has_telemetry() {
            return Ok(());
        }
        self.inputs.note(&Entry::Telemetry, carried.progress)?;
        self.inputs.publish(carried.progress)?;
        let Progress { tick, time } = carried.progress;
        if let Some(infrared) = carried.infrared.take() {
            telemetry.infrared.publish(tick, time, infrared)?;
        }
        if let Some(power) = carried.power.take() {
            telemetry.power.publish(tick, time, power)?;
        }
        if let Some(surroundings) = carried.surroundings.take() {
            telemetry.surroundings.publish(tick, time, surroundings)?;
        }
        Ok(())
    }

    fn stop(&mut self) -> Result<(), StageError> {
        let machine_ns = monotonic_ns();
        for bytes in self.link.final_stops() {
            self.transport.send(&bytes).map_err(wire_broke)?;
            self.carried.sent(&bytes, machine_ns);
        }
        let at = self.carried.progress;
        self.inputs.note(&Entry::Stop(machine_ns), at)?;
        self.inputs.publish(at)?;
        self.publish_wire()?;
        tracing::info!("stop sent to the robot");
        Ok(())
    }
}

#[allow(clippy::needless_pass_by_value, reason = "the shape map_err wants")]
fn wire_broke(error: TransportError) -> StageError {
    StageError::Other(error.to_string())
}

fn log_battery(change: &BatteryChange) {
    let BatteryChange {
        pack,
        volts,
        charge,
    } = *change;
    let volts = format!("{volts:.1}");
    let pack = pack.as_str();
    match charge {
        Charge::Empty => tracing::error!(
            pack,
            volts,
            "battery empty: charge it, or set robot.low_battery_v"
        ),
        Charge::Low => tracing::warn!(
            pack,
            volts,
            "battery low: charge it, or set robot.low_battery_v"
        ),
        Charge::Enough => tracing::info!(pack, volts, "the battery gives enough again"),
    }
}

fn log_decision(before: Decision, now: Decision) {
    let robot = now.action.effect();
    let cause = now.cause.name();
    // The end of a mission is no fault.
    if now.action > before.action && now.cause != Cause::MissionOver {
        tracing::warn!(robot, cause, "failsafe");
    } else {
        tracing::info!(robot, cause, "failsafe");
    }
}

impl Shell {
    /// Keep the wire open, and let the link know whether it is.
    fn maintain(&mut self) -> Result<(), StageError> {
        let now_ns = monotonic_ns();
        if let Some(open) = self.transport.maintain(now_ns).map_err(wire_broke)? {
            self.take(Event::Wire(open), now_ns)?;
        }
        Ok(())
    }

    fn take(&mut self, event: Event<'_>, machine_ns: u64) -> Result<(), StageError> {
        let now = self.clock.at(self.link.state().next_tick, machine_ns);
        let entry = Entry::Step(Taken::of(&event), machine_ns, now);
        self.budget.end(Item::Read);
        self.inputs.note(&entry, self.carried.progress)?;
        self.budget.end(Item::Persist);
        let effects = self.link.step(Input { event, machine_ns }, now);
        self.budget.end(Item::Step);
        self.carry_out(effects, machine_ns)
    }

    /// Publish the bytes that came and went, once nobody waits.
    fn publish_wire(&mut self) -> Result<(), StageError> {
        if self.carried.wire.is_empty() {
            return Ok(());
        }
        self.inputs.publish(self.carried.progress)?;
        for (at, header, bytes) in self.carried.wire.drain(..) {
            for piece in bytes.chunks(WIRE_PIECE) {
                self.wire
                    .publish_slice_quietly(at.tick, at.time, header, piece)?;
            }
        }
        Ok(())
    }

    fn carry_out(&mut self, effects: Vec<Effect>, machine_ns: u64) -> Result<(), StageError> {
        if !effects.is_empty() {
            self.inputs.publish(self.carried.progress)?;
            self.budget.end(Item::Persist);
        }
        for effect in effects {
            match effect {
                Effect::Send(bytes) => {
                    self.transport.send(&bytes).map_err(wire_broke)?;
                    self.carried.sent(&bytes, machine_ns);
                }
                Effect::Tick {
                    tick,
                    time,
                    range,
                    wheels,
                } => {
                    self.carried.progress = Progress { tick, time };
                    self.range.publish(tick, time, range)?;
                    self.wheels.publish_quietly(tick, time, wheels)?;
                    self.budget.published(tick, Answers::Inputs);
                    self.wheels.wake()?;
                }
                Effect::Answered { began_ns } => {
                    self.budget
                        .published(self.carried.progress.tick, Answers::Feedback);
                    self.latency_ns = monotonic_ns().saturating_sub(began_ns);
                    self.latency.record(self.latency_ns);
                    self.state()?;
                }
                Effect::Unlimited { tick } => {
                    tracing::warn!(
                        tick,
                        "the supervisor does not say that the tick may begin; it begins"
                    );
                }
                Effect::Decided { before, now } => {
                    log_decision(before, now);
                    if now.action >= before.action
                        && let Some(explanation) = self.link.explain(now.cause, monotonic_ns())
                    {
                        tracing::warn!("{explanation}");
                    }
                    self.state()?;
                }
                Effect::Connected(true) => {
                    tracing::info!("robot answers");
                    self.state()?;
                }
                Effect::Connected(false) => {
                    tracing::warn!("robot lost; it is looked for until it answers");
                    self.state()?;
                }
                Effect::Restarted => {
                    let restarts = self.link.restarts();
                    tracing::warn!(restarts, "the robot restarted: its counts begin anew");
                }
                Effect::CountsElsewhere => tracing::warn!(
                    "the counts jumped farther than wheels turn and go on from there; the pose stays"
                ),
                Effect::StopBy(method) => {
                    tracing::warn!(by = method.as_str(), "the robot does not stand; told again");
                }
                Effect::AskedForStreams => {
                    tracing::info!("the robot is asked for its streams again");
                }
                Effect::Infrared(sample) => self.carried.infrared = Some(sample),
                Effect::Power(sample) => self.carried.power = Some(sample),
                Effect::Surroundings(sample) => self.carried.surroundings = Some(sample),
                Effect::Battery(change) => log_battery(&change),
            }
        }
        Ok(())
    }

    /// Publish how the wire is.
    fn state(&mut self) -> Result<(), StageError> {
        let now_ns = monotonic_ns();
        self.stated_ns = now_ns;
        let wire = self.link.wire_tally();
        let tally = self.link.tally();
        let absence = self.link.absence(now_ns);
        // Of a wire that is not open, the openings; else the pings.
        let (attempts, next_attempt_ns) = match self.transport.attempts(now_ns) {
            Some(openings) => (openings.made, openings.next_ns),
            None => (absence.pings, absence.next_ping_ns),
        };
        let carried = self.transport.tally();
        let ignored = self.writers.tell([
            self.command.ignored(),
            self.directive.ignored(),
            self.tick_limit.ignored(),
        ]);
        let sample = LinkSample {
            connected: self.link.connected().into(),
            action: self.link.decision().action.into(),
            cause: self.link.decision().cause.into(),
            at_rest: self.link.is_at_rest().into(),
            frames_in: wire.frames,
            bytes_dropped: wire.noise_bytes + wire.dropped_bytes,
            foreign_datagrams: carried.foreign_datagrams,
            unsent: carried.unsent,
            ignored_samples: ignored.samples,
            ignored_writer: ignored.process,
            other_port: carried.other_port.into(),
            losses: self.link.losses(),
            reboots: self.link.restarts().into(),
            lost_ns: absence.lost_ns,
            attempts,
            next_attempt_ns,
            commands_out: tally.commands,
            repeated_commands: tally.repeated_commands,
            repeated_ticks: tally.repeated_ticks,
            latency_ns: self.latency_ns,
            latency_max_ns: self.latency.max_ns(),
            latency_histogram: *self.latency.counts(),
            ..LinkSample::default()
        };
        let Progress { tick, time } = self.carried.progress;
        self.state.publish(tick, time, sample)?;
        Ok(())
    }
}
