//! Bridge: follows a robot across runs, publishes its samples and carries out permitted requests.

use std::{
    fs, io,
    path::PathBuf,
    time::{Duration, Instant},
};

use common::{
    bus::{Bus, BusError},
    clock::MissionClock,
    domain::Domain,
    file,
    follower::{Event, Follower},
    samples::{RequestKind, TargetPoint},
    signals::{SIGCONT, Signals},
    topics,
};
use console::runs::Results;
use recording::now_ns;
use robot_state::{Feed, Sample, TOPICS, newest_run};
use ros2::{
    cdr::Cdr as _,
    frames::Frames as Transforms,
    msg::Bool,
    participant::{Message, Request},
};
use thiserror::Error;

use crate::{
    Arguments,
    action::{Refusal, Server},
    asked,
    endpoints::{self, is_of_robot, published},
    goals::{Status, Uuid, reply_to_goal},
    node::{Call, Network, Node},
    orders::{Done, Order, Orders, Why},
    overlap::overlap,
    parameters::Parameter,
    shown::{BASE, ODOM, Shown},
    topics::{Frames, Id},
};

/// Interval of checks for requests and for the start or end of a run.
const LOOK_EVERY: Duration = Duration::from_millis(50);
const FEEDBACK_EVERY: Duration = Duration::from_millis(100);
const AGAIN_AFTER: Duration = Duration::from_secs(1);
const OLD_AFTER: Duration = Duration::from_secs(1);
/// File with the action's goals and the directory of their run.
const GOALS: &str = "ros2-goals.json";
/// Most result bytes read for goals of an earlier bridge.
const MOST_RECORDED: u64 = 1 << 20;
const RUN_ENDED: &str = "the run ended before the robot arrived";
const TELL_EVERY: Duration = Duration::from_secs(1);

#[derive(Debug, Error)]
pub enum BridgeError {
    #[error(
        "cannot join ROS 2 domain {domain}: {source}; check that the address of --interface belongs to this machine"
    )]
    Join { domain: u16, source: io::Error },
    #[error(
        "the robot's link reads {topic} in domain {domain} from the robot, so the bridge must not publish it; give a namespace, such as --namespace firsthand, or give --frames map"
    )]
    Overlap { topic: String, domain: u16 },
    #[error("cannot start a thread or catch a signal: {0}")]
    System(#[from] io::Error),
}

struct Bridge<'a> {
    network: Network<'a>,
    options: &'a Arguments,
    node: Node<Id>,
    transforms: Transforms,
    orders: Orders,
    shown: Option<Shown>,
    server: Server,
    run: Option<(PathBuf, Results)>,
    stored: String,
    goals_file: PathBuf,
    feedback_at: Instant,
    /// Stop requests since the stop for a canceled goal, including it.
    stands_for_cancel: Option<u32>,
    told_at: Option<Instant>,
}

pub fn serve(
    network: Network<'_>,
    (options, parameters): (&Arguments, Vec<Parameter>),
    ended: &mut dyn FnMut() -> bool,
) -> Result<(), BridgeError> {
    let robot = &options.robot;
    let robot_domain = robot.domain();
    let join = || {
        endpoints::open(network, options, parameters.clone())
            .map_err(|source| BridgeError::Join { domain: network.0, source })
    };
    let mut continued = Signals::catch(&[SIGCONT])?;
    let mut bridge = Bridge {
        network,
        options,
        node: join()?,
        transforms: Transforms::default(),
        orders: Orders::new(robot)?,
        shown: None,
        server: Server::default(),
        run: None,
        stored: String::new(),
        goals_file: robot_domain.run_directory().with_file_name(GOALS),
        feedback_at: Instant::now(),
        stands_for_cancel: None,
        told_at: None,
    };
    bridge.restore(&robot_domain);
    let open = |bus: &Bus| Feed::open(bus, TOPICS);
    let follow = || Follower::new(robot_domain.clone(), "ros2", &topics::LINK, open);
    let mut follower = follow();
    while !ended() {
        if continued.came() {
            // A continued process has interrupted system calls, which end the library's threads.
            // New bus readers get whole maps for the new writers.
            (bridge.node, bridge.shown) = (join()?, None);
            follower = follow();
        }
        let taken = match follower.wait(LOOK_EVERY) {
            Ok(Event::Samples(bus)) => {
                bridge.begin(&robot_domain)?;
                // Transforms of the same tick have arrived by now.
                bridge.hear();
                bridge.take_samples(bus)
            }
            Ok(Event::Disconnected) => {
                bridge.end();
                Ok(())
            }
            Ok(Event::Connected | Event::Nothing) => Ok(()),
            Err(error) => Err(error),
        };
        bridge.hear();
        while let Some(done) = bridge.orders.done() {
            bridge.done(done);
        }
        bridge.publish();
        bridge.store();
        if let Err(error) = taken {
            tracing::error!(%error, "the robot cannot be shown; the viewer tries again");
            std::thread::park_timeout(AGAIN_AFTER);
        }
    }
    Ok(())
}

impl Bridge<'_> {
    /// Begins a run. Its file may appear after the first samples.
    fn begin(&mut self, domain: &Domain) -> Result<(), BridgeError> {
        if self.shown.is_some() {
            return Ok(());
        }
        let Some((directory, run)) = newest_run(domain) else {
            return Ok(());
        };
        let (domain, _, namespace) = self.network;
        let Arguments { robot, frames, clock, .. } = self.options;
        let mut shown = Shown::new(robot.to_string(), run.mission.clone());
        let own = overlap((domain, namespace), &run, shown.sensor_topics());
        let is_left = |id| *frames == Frames::Map && is_of_robot(id);
        if let Some((_, topic)) = own.iter().find(|(id, _)| !is_left(*id)) {
            return Err(BridgeError::Overlap { topic: topic.clone(), domain });
        }
        let is_own = |id| own.iter().any(|(own, _)| *own == id);
        let topics = published(namespace, shown.sensor_topics())
            .filter(|(_, id, _)| is_of_robot(*id) && !is_own(*id));
        let opened = endpoints::open_robot(&mut self.node, topics);
        if let (MissionClock::Wall { rate, .. }, false) = (run.clock, clock) {
            shown.pace = rate;
        }
        let at_ns = if *clock { 0 } else { now_ns() };
        shown.mounting(at_ns, &mut |id, payload| self.node.publish(id, payload));
        if let Err(error) = opened {
            self.tell(&format!("cannot open the robot's topics: {error}"));
        }
        self.shown = Some(shown);
        if self.run.as_ref().is_none_or(|(before, _)| *before != directory) {
            self.server.abort(RUN_ENDED);
            self.server.forget_targets();
            let results = Results::of(&directory, 0);
            self.run = Some((directory, results));
        }
        Ok(())
    }

    /// Their clients still wait.
    fn restore(&mut self, domain: &Domain) {
        let text = fs::read_to_string(&self.goals_file).unwrap_or_default();
        let Ok((directory, server)) = serde_json::from_str::<(PathBuf, Server)>(&text) else {
            return;
        };
        let goes_on = newest_run(domain).is_some_and(|(newest, _)| newest == directory);
        let results = Results::of(&directory, MOST_RECORDED);
        (self.server, self.run, self.stored) = (server, Some((directory, results)), text);
        self.read_results();
        if !goes_on {
            self.server.abort(RUN_ENDED);
        }
    }

    fn read_results(&mut self) {
        for target in self.run.iter_mut().flat_map(|(_, results)| results.take()) {
            self.server.recorded(target.number, &target.outcome);
        }
    }

    fn store(&mut self) {
        let Some((directory, _)) = self.run.as_ref().filter(|_| self.server.goals.are_any()) else {
            return;
        };
        let text = serde_json::to_string(&(directory, &self.server)).unwrap_or_default();
        if text != self.stored {
            if let Err(error) = file::replace(&self.goals_file, &text) {
                tracing::warn!(%error, "cannot store the action's goals");
            }
            self.stored = text;
        }
    }

    fn end(&mut self) {
        self.server.abort(RUN_ENDED);
        self.server.newest_target = 0;
        (self.shown, self.stands_for_cancel) = (None, None);
    }

    fn take_samples(&mut self, feed: &mut Feed) -> Result<(), BusError> {
        let Self { node, shown, server, stands_for_cancel, options, transforms, .. } = self;
        let Some(shown) = shown else {
            return Ok(());
        };
        let now_ns = now_ns();
        shown.others_odom = (options.frames == Frames::Map).then(|| {
            let since = Instant::now().checked_sub(OLD_AFTER);
            transforms.find(BASE, ODOM, since).ok()
        });
        feed.read(&mut |sample| {
            match &sample {
                Sample::Target(target) => server.target(target),
                Sample::Command(command) => server.command(command),
                Sample::Directive(directive) => server.directive(directive),
                Sample::Order(request) if request.kind() == RequestKind::Stop => {
                    *stands_for_cancel = stands_for_cancel.map(|stops| stops + 1);
                }
                _ => {}
            }
            let at_ns = if options.clock { sample.time().0 } else { now_ns };
            shown.sample(&sample, at_ns, &mut |id, payload| node.publish(id, payload));
        })
    }

    fn now_ns(&self) -> u64 {
        match &self.shown {
            Some(shown) if self.options.clock => (shown.state.now_s() * 1e9) as u64,
            _ => now_ns(),
        }
    }

    fn hear(&mut self) {
        let heard = self.node.heard().unwrap_or_else(|error| {
            self.tell(&format!("cannot read a topic: {error}"));
            Vec::new()
        });
        for (id, message) in heard {
            if let Err(why) = self.hear_topic(id, &message) {
                self.tell(&format!("refused a message: {why}"));
            }
        }
        for (_, call, message) in self.node.called() {
            if let Err(why) = self.hear_call(call, &message) {
                self.tell(&format!("refused a call of the action: {why}"));
            }
        }
    }

    fn hear_topic(&mut self, id: Id, message: &Message) -> Result<(), String> {
        match id {
            Id::GoalPose => self.go(asked::goal(&message.payload)?, Why::Topic),
            Id::InitialPose => {
                let (place, deviations) = asked::place(&message.payload)?;
                self.orders.give(Order::Place(place, deviations));
            }
            Id::Teleop => {
                // Without a robot there is nothing to drive.
                if let Some(shown) = &self.shown {
                    let stick = asked::stick(&message.payload, &shown.mission)?;
                    self.orders.give(Order::Hand(stick, Instant::now()));
                }
            }
            Id::Stop => self.orders.give(if Bool::decode(&message.payload)?.data {
                Order::Stand { is_cancel: false }
            } else {
                Order::Resume
            }),
            Id::Tf => self.transforms.take(&message.payload, Some(Instant::now()))?,
            _ => {}
        }
        Ok(())
    }

    fn go(&self, to: TargetPoint, why: Why) {
        // The next goal ends only the stop of the canceled goal.
        let resumes = self.stands_for_cancel.is_some_and(|stops| stops <= 1);
        self.orders.give(Order::Go { to, resumes, why });
    }

    fn hear_call(&mut self, call: Call, message: &Message) -> Result<(), String> {
        let Message { request, payload, .. } = message;
        match call {
            Call::SendGoal => {
                let (id, point) = Server::read_goal(payload).inspect_err(|_| {
                    self.node.reply(0, call, request, &reply_to_goal(false, now_ns()));
                })?;
                match point {
                    Ok(point) => {
                        let (request, after) = (request.clone(), self.server.newest_target);
                        self.go(point, Why::Action { request, id, after });
                    }
                    Err(refusal) => {
                        self.refuse(request, id, &refusal);
                        return Err(refusal.text);
                    }
                }
            }
            Call::CancelGoal => {
                let (reply, stands) = self.server.goals.cancel(payload)?;
                self.node.reply(0, call, request, &reply);
                if stands {
                    self.stands_for_cancel = Some(0);
                    self.orders.give(Order::Stand { is_cancel: true });
                }
            }
            Call::GetResult => self.server.goals.wait(request, payload)?,
        }
        Ok(())
    }

    /// Accepts a goal and aborts it with the reason, as Nav2 does. A rejected goal has no result.
    fn refuse(&mut self, request: &Request, id: Uuid, why: &Refusal) {
        let now_ns = self.now_ns();
        self.node.reply(0, Call::SendGoal, request, &reply_to_goal(true, now_ns));
        self.server.refuse(id, why, now_ns);
    }

    fn done(&mut self, (order, result): Done) {
        if let Err(why) = &result {
            self.tell(&format!("a request failed: {}", why.text));
        }
        match order {
            Order::Go { to, resumes, why } => {
                if resumes && result.is_ok() {
                    self.stands_for_cancel = None;
                }
                if let Why::Action { request, id, after } = why {
                    let now_ns = self.now_ns();
                    match result {
                        Ok(()) => {
                            let reply = reply_to_goal(true, now_ns);
                            self.node.reply(0, Call::SendGoal, &request, &reply);
                            self.server.accept((id, to), after, now_ns);
                            // Its target may have preceded the supervisor's answer.
                            if let Some(target) = self.shown.as_ref().and_then(|it| it.state.target)
                            {
                                self.server.target(&target);
                            }
                        }
                        Err(why) => self.refuse(&request, id, &why),
                    }
                }
            }
            Order::Stand { is_cancel: true } if result.is_ok() => {
                self.server.goals.end(Status::Canceled);
            }
            // Only a robot that obeyed is reported as canceled.
            Order::Stand { is_cancel: true } => {
                self.server.abort("the robot did not stop after the cancellation");
            }
            _ => {}
        }
    }

    fn publish(&mut self) {
        let now_ns = self.now_ns();
        self.read_results();
        let (node, server) = (&mut self.node, &mut self.server);
        if let Some(status) = server.goals.take_status() {
            node.publish_status(0, status);
        }
        if node.is_known() {
            for (request, id) in server.answerable() {
                node.reply(0, Call::GetResult, &request, &server.result(id).unwrap_or_default());
            }
        }
        let Some(shown) = &mut self.shown else {
            return;
        };
        shown.tick(now_ns, &mut |id, payload| node.publish(id, payload));
        if self.feedback_at.elapsed() >= FEEDBACK_EVERY {
            self.feedback_at = Instant::now();
            let feedback =
                server.feedback(&shown.state.pose.unwrap_or_default(), shown.state.stalls, now_ns);
            if let Some(feedback) = feedback {
                node.publish_feedback(0, feedback);
            }
        }
    }

    /// Logs a refusal, at most once a second against floods by other nodes.
    fn tell(&mut self, why: &str) {
        if self.told_at.is_none_or(|told| told.elapsed() >= TELL_EVERY) {
            self.told_at = Some(Instant::now());
            tracing::warn!("{why}");
        }
    }
}
