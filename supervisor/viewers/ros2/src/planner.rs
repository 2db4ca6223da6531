//! `firsthand ros2 planner`: Nav2's planner server over the harmonic field, for any robot.
//!
//! A goal is accepted at once, and a thread plans.

mod calls;
mod costmap;
mod planning;
#[cfg(test)]
mod tests;

use std::{
    collections::BTreeMap,
    env, io,
    sync::{
        Arc,
        mpsc::{Receiver, SyncSender, channel, sync_channel},
    },
    task::Waker,
    thread,
    time::{Duration, Instant},
};

use clap::{Args, value_parser};
use common::{
    geometry::distance_to_segment,
    poll::is_readable,
    signals::{SIGCONT, Signals},
};
use glam::{DAffine2, DVec2};
use harmonic::{Cancellation, Cell};
use recording::now_ns;
use ros2::{
    cdr::Cdr as _,
    frames::{Frames, placed},
    msg::{
        Clock, ComputePathThroughPosesResult, ComputePathToPoseResult, Header, PoseStamped, Release,
    },
    participant::{Gid, Message, Quality},
};

use self::{
    calls::{Asked, Outcome},
    costmap::{Body, Costmap},
    planning::{Failure, Planner, Reason},
};
use crate::{
    bridge::BridgeError,
    goals::{Goals, Status, Uuid, reply_to_goal},
    messages,
    node::{Call, LATCHED, NEWEST, Network, Node, SURE},
    parameters::Parameter,
    shown::arrows,
};

const LOOK_EVERY: Duration = Duration::from_millis(50);
const MOST_WAITING: usize = 16;
/// Most participants whose Nav2 release is remembered.
const MOST_CLIENTS: usize = 256;
/// Length of the participant prefix of a GID, bytes.
const PARTICIPANT: usize = 12;
/// Queue depth for the messages of all publishers of `/tf_static`.
const DEPTH: u16 = 256;

/// Actions, their types, and the first of Nav2's error codes for each.
const ACTIONS: [(&str, &str, u16); 2] = [
    ("firsthand/compute_path_to_pose", "ComputePathToPose", ComputePathToPoseResult::UNKNOWN),
    (
        "firsthand/compute_path_through_poses",
        "ComputePathThroughPoses",
        ComputePathThroughPosesResult::UNKNOWN,
    ),
];

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Id {
    Map,
    Updates,
    Tf,
    TfStatic,
    Clock,
    Plan,
    Field,
}

/// Plan paths for Nav2 along the harmonic field.
///
/// See `firsthand help nav2-planner`. Names without a leading slash are below the namespace.
#[derive(Clone, Debug, Args)]
pub struct Arguments {
    /// Topic of the map: a Nav2 costmap, or a static map. The topic of its updates has `_updates`
    /// appended.
    #[arg(long, value_name = "TOPIC", default_value = "global_costmap/costmap")]
    map: String,
    /// Topic of transforms. The topic of static ones has `_static` appended.
    #[arg(long, value_name = "TOPIC", default_value = "tf")]
    tf: String,
    /// Frame of the robot.
    #[arg(long, value_name = "FRAME", default_value = "base_link")]
    base: String,
    /// Radius of the robot, metres; 0 for an inflated costmap.
    #[arg(long, value_name = "METRES", default_value = "0", value_parser = amount)]
    robot_radius: f64,
    /// Outline in the robot's frame instead of its radius, metres: `[[x, y], ...]`.
    #[arg(long, value_name = "POINTS", conflicts_with = "robot_radius", value_parser = inscribed)]
    footprint: Option<f64>,
    /// Distance from obstacles beyond the radius, metres, even if no path remains.
    #[arg(long, value_name = "METRES", default_value = "0", value_parser = amount)]
    inflation: f64,
    /// Least value of an occupied cell.
    #[arg(long, value_name = "VALUE", default_value_t = 99, value_parser = value_parser!(u8).range(1..=100))]
    occupied: u8,
    /// Avoid cells of unknown occupancy.
    #[arg(long)]
    avoid_unknown: bool,
    /// Screening length of the field a metre from obstacles, metres. A shorter one keeps farther
    /// away, on longer paths, and takes longer.
    #[arg(long, value_name = "METRES", default_value = "2", value_parser = amount)]
    screening: f64,
    /// Longest time for a path, seconds.
    #[arg(long, value_name = "SECONDS", default_value = "5", value_parser = amount)]
    max_planning_time: f64,
    /// Largest age of transforms, seconds.
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = amount)]
    transform_tolerance: f64,
    /// Stamp paths with the time of `/clock`, like the parameter `use_sim_time`.
    #[arg(long)]
    use_sim_time: bool,
}

/// Parses a number from 0 to less than a day's seconds.
fn amount(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|number| (0.0..86_400.0).contains(number))
        .ok_or_else(|| "not an amount; give a number from 0 to below 86400".to_owned())
}

/// Returns the radius of the outline's largest circle around the robot's centre.
fn inscribed(text: &str) -> Result<f64, String> {
    let numbers: Vec<f64> = text
        .split(['[', ']', ',', ' '])
        .filter(|word| !word.is_empty())
        .map_while(|word| word.parse().ok())
        .collect();
    let corners: Vec<_> = numbers.chunks_exact(2).map(DVec2::from_slice).collect();
    if corners.len() < 3 || text.matches(',').count() + 1 != numbers.len() {
        return Err("not an outline; give three or more corners as [[x, y], ...]".to_owned());
    }
    let sides = corners.iter().zip(corners.iter().cycle().skip(1));
    let distance = |(from, to): (&DVec2, &DVec2)| distance_to_segment(DVec2::ZERO, *from, *to);
    Ok(sides.map(distance).fold(f64::INFINITY, f64::min))
}

struct Job {
    action: usize,
    id: Uuid,
    at_ns: u64,
    map: Arc<Costmap>,
    start: DAffine2,
    goals: Vec<DAffine2>,
    cancellation: Cancellation,
}

/// Action, goal and outcome of a job, and the field as a message.
type Done = (usize, Uuid, Outcome, Option<Vec<u8>>);

#[derive(Default)]
struct Plan {
    began: Option<Instant>,
    cancellation: Cancellation,
    outcome: Outcome,
    release: Release,
}

pub fn serve(
    network: Network<'_>,
    (options, parameters): (&Arguments, Vec<Parameter>),
    ended: &mut dyn FnMut() -> bool,
) -> Result<(), BridgeError> {
    let open = || {
        let node = open(network, options, parameters.clone())
            .map_err(|source| BridgeError::Join { domain: network.0, source })?;
        Server::new(options, node).map_err(BridgeError::System)
    };
    let mut continued = Signals::catch(&[SIGCONT])?;
    let mut server = open()?;
    while !ended() {
        if continued.came() {
            // A continued process has interrupted system calls, which end the library's threads.
            server = open()?;
        }
        is_readable(&server.node.participant, LOOK_EVERY)?;
        server.turn();
    }
    Ok(())
}

fn open(
    network: Network<'_>,
    options: &Arguments,
    parameters: Vec<Parameter>,
) -> io::Result<Node<Id>> {
    let mut node = Node::join(network, "firsthand_planner", parameters)?;
    let Arguments { map, tf, .. } = options;
    let [updates, stay] = [format!("{map}_updates"), format!("{tf}_static")];
    let frames = "tf2_msgs::msg::dds_::TFMessage_";
    let many = Quality { depth: DEPTH, ..SURE };
    for (id, name, kind, quality) in [
        (Id::Map, map, "nav_msgs::msg::dds_::OccupancyGrid_", LATCHED),
        (Id::Updates, &updates, "map_msgs::msg::dds_::OccupancyGridUpdate_", many),
        (Id::Tf, tf, frames, Quality { is_reliable: false, ..many }),
        (Id::TfStatic, &stay, frames, Quality { is_latched: true, ..many }),
    ] {
        node.read_from(id, [name, kind], quality)?;
    }
    if options.use_sim_time {
        node.read_from(Id::Clock, ["/clock", "rosgraph_msgs::msg::dds_::Clock_"], NEWEST)?;
    }
    node.write_to(Id::Plan, ["plan", "nav_msgs::msg::dds_::Path_"], LATCHED)?;
    let field = ["plan_field", "visualization_msgs::msg::dds_::MarkerArray_"];
    node.write_to(Id::Field, field, LATCHED)?;
    for (name, kind, _) in ACTIONS {
        node.serve(name, kind)?;
    }
    node.announce();
    Ok(node)
}

struct Server<'a> {
    options: &'a Arguments,
    node: Node<Id>,
    frames: Frames,
    map: Option<Arc<Costmap>>,
    /// Newest time of `/clock`, nanoseconds.
    clock_ns: u64,
    /// Possible releases of participants, from the layouts of their goals.
    clients: BTreeMap<[u8; PARTICIPANT], Vec<Release>>,
    goals: [Goals<Plan>; 2],
    jobs: SyncSender<Job>,
    done: Receiver<Done>,
}

impl<'a> Server<'a> {
    fn new(options: &'a Arguments, node: Node<Id>) -> io::Result<Self> {
        let body = Body {
            radius_m: options.footprint.unwrap_or(options.robot_radius) + options.inflation,
            occupied: options.occupied,
            enters_unknown: !options.avoid_unknown,
        };
        let planner = Planner::new(body, options.screening);
        let (jobs, done) = start_planning(planner, node.participant.bell())?;
        Ok(Self {
            options,
            node,
            frames: Frames::default(),
            map: None,
            clock_ns: 0,
            clients: BTreeMap::new(),
            goals: Default::default(),
            jobs,
            done,
        })
    }

    /// Returns the stamp time, nanoseconds, or 0 before the first `/clock`.
    fn now_ns(&self) -> u64 {
        if self.options.use_sim_time { self.clock_ns } else { now_ns() }
    }

    /// Returns a client's release from its goals, preferring that of this environment.
    fn release(&mut self, from: Gid, asked: &[Release]) -> Release {
        let participant = *from.first_chunk().unwrap_or(&[0; PARTICIPANT]);
        if self.clients.len() >= MOST_CLIENTS {
            self.clients.clear();
        }
        let known = self.clients.entry(participant).or_default();
        known.retain(|release| asked.contains(release));
        if known.is_empty() {
            *known = asked.to_vec();
        }
        let here = env::var("ROS_DISTRO").unwrap_or_default();
        Release::ALL
            .iter()
            .find(|(name, it)| *name == here && known.contains(it))
            .map(|(_, release)| *release)
            .or(known.first().copied())
            .unwrap_or_default()
    }

    fn turn(&mut self) {
        self.node.participant.unring();
        for (id, message) in self.node.heard().unwrap_or_default() {
            if let Err(why) = self.hear(id, &message.payload) {
                tracing::warn!("refused a message of {id:?}: {why}");
            }
        }
        for (action, call, message) in self.node.called() {
            if let Err(why) = self.hear_call(action, call, &message) {
                tracing::warn!("refused a call of {}: {why}", ACTIONS[action].0);
            }
        }
        while let Ok((action, id, outcome, field)) = self.done.try_recv() {
            if outcome.failure.is_none() {
                let header = Header::at(outcome.at_ns, &outcome.frame);
                self.node.publish(Id::Plan, messages::path(header, &outcome.path).encode());
            }
            field.into_iter().for_each(|field| self.node.publish(Id::Field, field));
            self.end(action, id, outcome);
        }
        let most = Duration::from_secs_f64(self.options.max_planning_time);
        for (action, goals) in self.goals.iter_mut().enumerate() {
            if let Some(goal) = goals.current()
                && goal.known.began.is_some_and(|began| began.elapsed() > most)
            {
                goal.known.cancellation.cancel();
            }
            if let Some(status) = goals.take_status() {
                self.node.publish_status(action, status);
            }
            for (request, id) in goals.answerable(|_, _| true) {
                if let Some((state, plan)) = goals.over(id) {
                    let unknown = Plan::default();
                    let Plan { outcome, release, .. } = plan.unwrap_or(&unknown);
                    let result = calls::result(state, outcome, ACTIONS[action].2, *release);
                    self.node.reply(action, Call::GetResult, &request, &result);
                }
            }
        }
    }

    fn hear(&mut self, id: Id, payload: &[u8]) -> Result<(), String> {
        match id {
            Id::Map => self.map = Some(Arc::new(Costmap::read(payload)?)),
            Id::Updates => {
                if let Some(map) = &mut self.map {
                    Arc::make_mut(map).update(payload)?;
                }
            }
            Id::Tf => self.frames.take(payload, Some(Instant::now()))?,
            Id::TfStatic => self.frames.take(payload, None)?,
            Id::Clock => {
                self.clock_ns = Clock::decode(payload)?.clock.ns().try_into().unwrap_or_default();
            }
            Id::Plan | Id::Field => {}
        }
        Ok(())
    }

    fn hear_call(&mut self, action: usize, call: Call, message: &Message) -> Result<(), String> {
        let Message { request, payload, from } = message;
        match call {
            Call::SendGoal => {
                let asked = calls::read(payload, action == 0);
                let reply = reply_to_goal(asked.is_ok(), self.now_ns());
                self.node.reply(action, call, request, &reply);
                let asked = asked?;
                let release = self.release(*from, &asked.releases);
                self.begin(action, &asked, release);
            }
            Call::CancelGoal => {
                let (reply, is_canceled) = self.goals[action].cancel(payload)?;
                self.node.reply(action, call, request, &reply);
                if is_canceled {
                    self.interrupt(action);
                }
            }
            Call::GetResult => self.goals[action].wait(request, payload)?,
        }
        Ok(())
    }

    fn interrupt(&mut self, action: usize) {
        if let Some(goal) = self.goals[action].current() {
            goal.known.cancellation.cancel();
        }
    }

    fn begin(&mut self, action: usize, asked: &Asked, release: Release) {
        self.interrupt(action);
        let (id, cancellation) = (asked.id, Cancellation::default());
        let plan = Plan {
            began: Some(Instant::now()),
            cancellation: cancellation.clone(),
            outcome: Outcome::default(),
            release,
        };
        let at_ns = self.now_ns();
        self.goals[action].accept(id, plan, at_ns);
        let begun = self.job(action, asked, cancellation).and_then(|job| {
            self.jobs
                .try_send(job)
                .map_err(|_| (Reason::Timeout, "too many goals wait already".to_owned()))
        });
        if let Err(failure) = begun {
            self.end(action, id, Outcome { at_ns, failure: Some(failure), ..Outcome::default() });
        }
    }

    fn job(
        &self,
        action: usize,
        asked: &Asked,
        cancellation: Cancellation,
    ) -> Result<Job, Failure> {
        let Some(map) = &self.map else {
            let topic = self.node.full_name(&self.options.map);
            return Err((Reason::Timeout, format!("no map has arrived on {topic}")));
        };
        let tolerance = Duration::from_secs_f64(self.options.transform_tolerance);
        let since = Instant::now().checked_sub(tolerance);
        let find = |frame: &str| {
            self.frames.find(frame, &map.frame, since).map_err(|why| (Reason::Tf, why))
        };
        let place = |PoseStamped { header, pose }: &PoseStamped| {
            let pose = placed(pose.at(), pose.orientation.heading().unwrap_or_default());
            Ok(if header.frame_id.is_empty() { pose } else { find(&header.frame_id)? * pose })
        };
        let start = asked.start.as_ref().map_or_else(|| find(&self.options.base), place)?;
        let goals = asked.goals.iter().map(place).collect::<Result<_, _>>()?;
        let (id, at_ns) = (asked.id, self.now_ns());
        Ok(Job { action, id, at_ns, map: Arc::clone(map), start, goals, cancellation })
    }

    fn end(&mut self, action: usize, id: Uuid, outcome: Outcome) {
        let goals = &mut self.goals[action];
        if let Some(goal) = goals.current().filter(|goal| goal.id == id) {
            let status = match (&outcome.failure, goal.status) {
                (_, Status::Canceling) => Status::Canceled,
                (None, _) => Status::Succeeded,
                (Some(_), _) => Status::Aborted,
            };
            goal.known.outcome = outcome;
            goals.end(status);
        }
    }
}

fn start_planning(
    mut planner: Planner,
    bell: Waker,
) -> io::Result<(SyncSender<Job>, Receiver<Done>)> {
    let (jobs, waiting) = sync_channel::<Job>(MOST_WAITING);
    let (ended, done) = channel();
    thread::Builder::new().name("planner".to_owned()).spawn(move || {
        for job in waiting {
            if ended.send(plan(&mut planner, &job)).is_err() {
                break;
            }
            bell.wake_by_ref();
        }
    })?;
    Ok((jobs, done))
}

fn plan(planner: &mut Planner, job: &Job) -> Done {
    let &Job { action, id, at_ns, ref map, start, ref goals, ref cancellation } = job;
    let began = Instant::now();
    let planned = planner.plan(map, start, goals, cancellation);
    let took_ns = u64::try_from(began.elapsed().as_nanos()).unwrap_or(u64::MAX);
    let (path, failure) = match planned {
        Ok(path) => (path, None),
        Err(failure) => (Vec::new(), Some(failure)),
    };
    let outcome = Outcome { frame: map.frame.clone(), at_ns, took_ns, path, failure };
    let field = planner.newest_field().map(|field| {
        let drawn = arrows([map.width, map.height], map.resolution_m, |col, row| {
            let ahead = field.direction(Cell::new(col, row))?;
            let at = map.place.transform_point2(DVec2::new(col as f64, row as f64));
            Some([at, map.place.transform_vector2(ahead.into()).normalize_or_zero()])
        });
        messages::markers(&Header::at(at_ns, &map.frame), vec![drawn])
    });
    (action, id, outcome, field)
}
