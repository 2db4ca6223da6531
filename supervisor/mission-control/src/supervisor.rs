//! Loop of the supervisor: reads events, calls the pure decisions, carries them out.

use std::path::PathBuf;

use common::{
    checkpoint::Checkpoint,
    clock::{Instant, MissionTime, Pace},
    domain::RobotName,
    machine,
    mission::Mission,
    run::Run,
    samples::{
        Cause, DirectiveSample, HoldReason, Order, PlaceSample, RequestAnswer, RosterHeader,
        TickLimitSample, ZoneCorner, ZonesHeader, name_str,
    },
    topics,
};
use processes::{
    cleanup::Cleanup,
    last_resort::Turns,
    policy::Now,
    records,
    service_manager::ServiceManager,
    stage_processes::{StageProcesses, Starter},
    stages,
};

use crate::{
    bus_endpoints::{BusEndpoints, warn_if_failed},
    decisive,
    error::Result,
    follow::Beacon,
    judge::{self, Arrival, Deadline, StopClock, TickProgress},
    observer::{Listener, Record},
    order::{self, Decision},
    outcome::{Ending, Outcome},
    progress::Progress,
    recovery::{RecoveredRun, SupervisorState},
    recovery_step::RecoverySteps,
    run::CAUGHT_UP_EVERY,
    run_clock::RunClock,
    stall::StallWatch,
    surroundings::{Robot, Surroundings},
    target_list::{TargetList, TargetOutcome},
};

pub struct Options {
    pub mission: Mission,
    pub robot: RobotName,
    /// Real robots, except with ROS 2, use the wall clock.
    pub pace: Pace,
    /// Directory of logs, checkpoints and results; it must exist.
    pub directory: PathBuf,
    pub starter: Starter,
    pub recovered: Option<RecoveredRun>,
    /// Whether the robot stands until an operator resumes it.
    pub stands: bool,
    /// Place of a new run's robot; default: the mission's start.
    pub place: Option<PlaceSample>,
}

pub(crate) struct Supervisor<'a> {
    pub options: &'a Options,
    // Drop order: the stages end before the robot.
    pub stages: StageProcesses,
    pub robot: Robot,
    pub bus: BusEndpoints,
    pub record: Record,
    /// Id and answer of the newest request; id 0 before the first.
    pub last_request: (u64, RequestAnswer),
    pub listener: Listener,
    checkpoint: Checkpoint,
    pub state: SupervisorState,
    pub clock: RunClock,
    pub decision: Decision,
    /// Nanoseconds of the monotonic clock.
    pub resumed_ns: u64,
    pub drove: bool,
    pub tick_progress: TickProgress,
    pub targets: TargetList,
    /// Time when the driving hand counts as gone.
    pub hand_until: Option<Instant>,
    pub beacon: Beacon,
    /// Time when the arrival was first seen.
    pub arrived: Option<Now>,
    stop_clock: StopClock,
    pub stall_watch: StallWatch,
    pub recovery_steps: RecoverySteps,
    pub published_limit: Option<TickLimitSample>,
    cleanup: Cleanup,
    pub turns: Turns,
    pub service: ServiceManager,
}

impl<'a> Supervisor<'a> {
    /// Starts the robot, writes the run file, starts the stages, unless the run is asked to end.
    pub(crate) fn start(
        options: &'a Options,
        surroundings: &mut dyn Surroundings,
        turns: Turns,
        listener: Listener,
    ) -> Result<Self> {
        let directory = &options.directory;
        let mission = &options.mission;
        let (checkpoint, mut state) = SupervisorState::open(directory)?;
        state.operator_stop |= options.stands;
        state.place = options.place.unwrap_or(state.place);
        let robot = surroundings.start_robot(options)?;
        let clock = match &options.recovered {
            Some(run) => {
                state.resumes += 1;
                let (tick, seconds) = (run.first_tick, run.time.seconds());
                tracing::warn!(tick, seconds, "the run is resumed");
                RunClock::recovered(run)
            }
            None => RunClock::begin(options.pace, &mission.robot, robot.simulator.is_some()),
        };
        Run {
            robot: options.robot.clone(),
            address: robot.address.clone(),
            clock: clock.clock,
            mission: mission.clone(),
        }
        .save(directory)?;
        let unchecked = clock.in_ticks().then(|| clock.first_tick(None));
        let mut targets = state.targets.take().unwrap_or_else(|| TargetList::of(mission));
        // A hand-driven robot needs a new request.
        targets.release();
        state.following.iter_mut().for_each(|following| following.is_lost = true);
        let mut supervisor = Self {
            options,
            stages: StageProcesses::new(
                directory.clone(),
                options.starter,
                mission,
                surroundings.host(options),
            ),
            robot,
            bus: BusEndpoints::open(surroundings.bus()?)?,
            record: Record::default(),
            last_request: (0, RequestAnswer::Taken),
            listener,
            checkpoint,
            state,
            clock,
            decision: Decision::STARTING,
            resumed_ns: 0,
            drove: false,
            tick_progress: TickProgress::new(Now::ZERO),
            targets,
            hand_until: None,
            beacon: Beacon::default(),
            arrived: None,
            stop_clock: StopClock::default(),
            stall_watch: StallWatch::new(mission),
            recovery_steps: RecoverySteps::new(unchecked),
            published_limit: None,
            cleanup: Cleanup::default(),
            turns,
            service: ServiceManager::of_environment(),
        };
        supervisor.record.target_number = supervisor.targets.number;
        if supervisor.targets.waits {
            supervisor.await_target();
        }
        surroundings.link_to_run(directory, false)?;
        if !surroundings.is_asked_to_end() {
            surroundings.attach_consumer();
        }
        if surroundings.is_asked_to_end() {
            return Ok(supervisor);
        }
        supervisor.publish_state()?;
        supervisor.stages.start_all(supervisor.first_tick());
        if options.starter == Starter::External {
            surroundings.link_to_run(directory, true)?;
            // Systemd starts the stages after this notification.
            supervisor.service.ready();
        }
        Ok(supervisor)
    }

    /// Iterates until the mission ends. Returns `None` if the bus needs recreation.
    pub(crate) fn drive(
        &mut self,
        surroundings: &mut dyn Surroundings,
        show: &mut dyn FnMut(&Progress<'_>),
    ) -> Result<Option<Ending>> {
        if let Some(descriptor) = surroundings.descriptor() {
            self.bus.waiter.on_readable(descriptor)?;
        }
        // In wall-clock time the run does not wait for slow consumers.
        let mut catch_up_at = self.clock.in_ticks().then_some(0);
        loop {
            if surroundings.take_request_to_end() {
                self.end_following(TargetOutcome::Followed);
                let (outcome, reason) = match self.targets.outcome_while_waiting() {
                    Some(outcome) => (outcome, "stopped by a signal while it waited for a target"),
                    None => (Outcome::Aborted, "stopped by a signal"),
                };
                return Ok(Some(Ending::asked_for(outcome, reason)));
            }
            if let Some(ending) = self.iterate()? {
                return Ok(Some(ending));
            }
            if self.stages.is_start_blocked() {
                return Ok(None);
            }
            let tick = self.record.published.tick;
            if let Some(tick) = tick.filter(|tick| catch_up_at.is_some_and(|at| *tick >= at)) {
                surroundings.let_catch_up();
                catch_up_at = Some(tick + CAUGHT_UP_EVERY);
            }
            if self.bus.is_due() {
                self.publish_state()?;
                let target = self.targets.current.position();
                let progress = Progress {
                    record: &self.record,
                    running: self.stages.running(),
                    driving: self.decision.order() == Order::Drive,
                    straight_m: target.distance(self.options.mission.start.at),
                };
                show(&progress);
                self.service.show(|| progress.to_string());
                surroundings.restore();
            }
            self.cleanup.run_if_due(&self.bus.bus, self.stages.any_starting());
            self.service.feed();
            self.wait()?;
        }
    }

    fn iterate(&mut self) -> Result<Option<Ending>> {
        let roster_changed =
            self.bus.observer.read_all(&mut self.record, &mut self.stages, &mut self.listener)?;
        let next = self.take_arrival() | self.miss_hand() | self.take_beacon()?;
        let asked = self.take_requests()?;
        let died = self.poll_processes()?;
        // Without frames, no later tick brings what a stage has missed of the newest one.
        let frames_come = self
            .record
            .link
            .is_some_and(|link| !matches!(link.cause(), Cause::RobotLost | Cause::FramesSilent));
        let driving = self.decision.order() == Order::Drive && frames_come;
        self.stages.check_outputs(driving, self.first_tick());
        let simulator_ended = !self.robot.poll()?;
        if self.decide_order() || roster_changed || died || asked || next {
            self.publish_state()?;
        }
        let ending = match self.judge(simulator_ended) {
            None => self.watch_for_stalls()?,
            ending => ending,
        };
        Ok(match ending {
            Some(ending) if self.settle(&ending) => {
                self.decide_order();
                self.publish_state()?;
                None
            }
            ending => ending,
        })
    }

    /// Reaps and restarts stages, and reports deaths. Returns whether there were any.
    pub(crate) fn poll_processes(&mut self) -> Result<bool> {
        let deaths = self.stages.poll(&self.bus.bus, self.first_tick())?;
        let stamp = self.record.pose.unwrap_or_default().stamp;
        for death in &deaths {
            death.log();
            warn_if_failed(self.bus.deaths.publish(stamp.tick, stamp.time(), death.sample()));
            records::append(&self.options.directory, records::DEATHS, death);
        }
        self.cleanup.on_deaths(&deaths, &self.bus.bus);
        Ok(!deaths.is_empty())
    }

    /// Returns whether the decision changed.
    fn decide_order(&mut self) -> bool {
        let record = &self.record;
        let decision = order::decide(&order::Snapshot {
            was_ready: self.decision.ready,
            all_running: self.stages.all_running(),
            robot_answers: record.link.is_some_and(|link| link.connected == 1),
            // A user's planner need not publish a field.
            field_known: record.field_known || self.options.mission.planner.executable.is_some(),
            operator_stop: self.state.operator_stop,
            stage_held: !self.stages.held().is_empty(),
            waits: self.targets.waits,
            lost: self.state.following.is_some_and(|following| following.is_lost),
        });
        if decision.ready && !self.decision.ready {
            tracing::info!("all stages ready");
            self.service.ready();
        }
        let changed = decision.reason != self.decision.reason;
        let drives = decision.order() == Order::Drive;
        assert!(!drives || decision.ready && !self.state.operator_stop && !self.targets.waits);
        if changed {
            tracing::info!(reason = ?decision.reason, "order");
            self.tick_progress = TickProgress::new(self.stages.now());
        }
        self.drove |= drives;
        self.decision = decision;
        changed
    }

    fn judge(&mut self, simulator_ended: bool) -> Option<Ending> {
        let now = self.stages.now();
        let record = &self.record;
        let target = self.targets.current.position();
        let newest_m = record.pose.map(|pose| target.distance(pose.pose().position));
        // A robot that follows goes on with its beacon.
        let ends = self.targets.is_last() && !self.targets.follows;
        if record.arrival.is_none() {
            self.arrived = None;
        }
        let arrival = record.arrival.filter(|_| ends).map(|command| Arrival {
            distance_m: newest_m.unwrap_or(command.distance_m),
            beside: record.beside(&command, self.options.mission.arrival_tolerance_m),
            since: *self.arrived.get_or_insert(now),
        });
        let collision = decisive::first_contact(self.robot.truth(), &self.options.mission);
        let time = self.mission_time();
        let stopped = self.decision.reason == HoldReason::Operator;
        self.state.operator_stopped_s += self.stop_clock.passed_s(stopped, time);
        let not_started = self.stages.not_started();
        let seen = (record.newest_tick(), not_started.len());
        judge::Snapshot {
            arrival,
            link: record.link.as_ref(),
            may_be_away: self.robot.simulator.is_none()
                && self.options.mission.planner.calibration.is_none(),
            simulator_ended,
            collision_m: collision.map(|truth| [truth.x, truth.y]),
            time,
            deadline: self.deadline(),
            in_ticks: self.clock.in_ticks(),
            progress: self.tick_progress.update(seen, now),
            // Other stages publish at tick 0 before the robot begins it.
            has_ticked: record.pose.is_some(),
            complaint: record.complaint().map(|complaint| complaint.to_string()),
            reason: self.decision.reason,
            held: self.stages.held(),
            not_started,
            not_ready: self.stages.not_ready(),
            robot: &self.options.robot,
            address: &self.robot.address,
        }
        .ending(now)
    }

    pub(crate) fn mission_time(&self) -> MissionTime {
        self.clock.now(self.record.pose.as_ref(), self.robot.truth().last())
    }

    /// Returns the mission time. In lockstep it is the newest pose's, because the ground truth comes
    /// when its process is scheduled.
    pub(crate) fn pose_time(&self) -> MissionTime {
        if self.clock.in_ticks() {
            self.clock.pose_time(self.record.pose.as_ref())
        } else {
            self.mission_time()
        }
    }

    /// Returns the current target's deadline; infinite while waiting or following.
    pub(crate) const fn deadline(&self) -> Deadline {
        let timeout_s = if self.targets.waits || self.targets.follows {
            f64::INFINITY
        } else {
            self.options.mission.timeout_s
        };
        Deadline {
            began_s: self.targets.began_s,
            timeout_s,
            stopped_s: self.state.operator_stopped_s,
        }
    }

    pub(crate) fn first_tick(&self) -> u64 {
        self.clock.first_tick(self.record.newest_tick())
    }

    pub(crate) fn published_as_of(&self) -> (u64, MissionTime) {
        // An external stage takes its first tick from this sample.
        let tick = self.first_tick().saturating_sub(1);
        let time = self.clock.pose_time(self.record.pose.as_ref());
        (tick, time)
    }

    /// Saves the state, then publishes order and roster, because the roster confirms requests.
    pub(crate) fn publish_state(&mut self) -> Result {
        self.state.targets = Some(self.targets.clone());
        if let Err(error) = self.checkpoint.save(&self.state) {
            // Only a resuming supervisor needs the state, so the mission goes on.
            tracing::error!(%error, "cannot save the state; a supervisor that resumes this run misses the last requests");
        }
        let (tick, time) = self.published_as_of();
        // A stage must know the target before it is told to drive.
        self.bus.target.publish(tick, time, self.targets.sample())?;
        if let Some(following) = self.beacon.told {
            self.bus.following.publish(tick, time, following)?;
        }
        let place = self.state.place;
        if place.number > 0 {
            self.bus.place.publish(tick, time, place)?;
        }
        if let Some((number, zones)) = &self.state.zones {
            let header = ZonesHeader { number: *number, ..ZonesHeader::default() };
            self.bus.zones.publish_slice(tick, time, header, &ZoneCorner::of(zones))?;
        }
        // The limit comes before the order that starts the first tick.
        self.published_limit = None;
        self.publish_tick_limit()?;
        let (order, reason) = (self.decision.order(), self.decision.reason);
        let epoch = self.stall_watch.epoch();
        let directive = DirectiveSample {
            order: order.into(),
            reason: reason.into(),
            epoch: epoch - u64::from(self.recovery_steps.withholds(epoch)),
            ..DirectiveSample::default()
        };
        let (last_request, answer) = self.last_request;
        let header = RosterHeader {
            supervisor_pid: machine::process(),
            order: order.into(),
            reason: reason.into(),
            simulated: self.robot.simulator.is_some().into(),
            last_request,
            answer: answer.into(),
            ..RosterHeader::default()
        };
        // A stage that ended cannot repeat its trouble, and one that runs does so later.
        if let Some(complaint) = self.record.complaint()
            && (self.bus.misses_trouble || !self.stages.runs(name_str(&complaint.stage)))
        {
            self.bus.complaints.publish(tick, time, complaint)?;
        }
        (self.bus.published, self.bus.misses_trouble) = (Some(Instant::now()), false);
        let entries = self.stages.roster();
        assert_eq!(entries.len(), stages::TABLE.len());
        self.bus.directive.publish(tick, time, directive)?;
        Ok(self.bus.roster.publish_slice(tick, time, header, &entries)?)
    }

    pub(crate) fn wait(&mut self) -> Result {
        self.turns.count();
        let mut descriptors = self.stages.descriptors();
        descriptors.extend(self.robot.simulator.as_ref().and_then(|it| it.descriptor()));
        let hand = self.hand_until.map(|until| until.saturating_duration_since(Instant::now()));
        let timeout = [self.stages.time_to_deadline(), self.service.time_to_feed(), hand]
            .into_iter()
            .flatten()
            .fold(topics::RESTATE, Ord::min);
        self.bus.waiter.wait_also_for(&descriptors, timeout)?;
        self.stages.on_waited(timeout);
        Ok(())
    }
}
