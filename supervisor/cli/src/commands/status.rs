mod all;

use std::{
    fmt,
    time::{Duration, Instant},
};

use clap::Args;
use common::{
    domain::RobotName,
    driver::Refusal,
    follower::{Event, Follower},
    geometry::wrap_angle,
    roster,
    samples::{
        Action, BeaconRefusal, FollowState, LinkSample, RosterEntry, TargetSample, name_str,
    },
    topics::{self, AnyTopic},
    waiter::Waiter,
};
use mission_control::operator::{self, PATIENCE};
use robot_state::{Feed, RobotState, words};
use serde::Serialize;
use serde_json::json;

use console::{
    failure::Result,
    output::{json_lines, print, print_line},
    stream::{LOOK_EVERY, Stream},
    table::Table,
    waiting::Waiting,
    words::{age, order, seconds},
};

/// Show the stages, link and batteries of a running robot.
///
/// Prints pid, generation, uptime, restarts and ages of each stage.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Name of the robot.
    #[arg(long, default_value_t)]
    robot: RobotName,
    /// List the running robots of this user on this machine instead.
    #[arg(long, conflicts_with = "robot")]
    all: bool,
    /// Print a status after each change, until Ctrl-C.
    ///
    /// Prints at most fifty a second, across runs.
    #[arg(long, conflicts_with = "all")]
    follow: bool,
    /// Print one line of JSON per robot.
    ///
    /// An age is null if nothing has happened yet.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Status<'a> {
    robot: &'a RobotName,
    supervisor_pid: u32,
    order: &'static str,
    tick: u64,
    mission_time_s: f64,
    /// Source machine and age, if the robot is a mirror.
    mirror: Option<MirrorStatus>,
    target: Option<TargetStatus>,
    following: Option<FollowingStatus>,
    pose: Option<PoseStatus>,
    link: Option<LinkStatus>,
    power: Option<PowerStatus>,
    /// None if no stage has trouble.
    complaint: Option<ComplaintStatus<'a>>,
    stages: Vec<StageStatus<'a>>,
}

#[derive(Serialize)]
struct ComplaintStatus<'a> {
    stage: &'a str,
    #[serde(flatten)]
    trouble: Refusal,
}

#[derive(Serialize)]
struct MirrorStatus {
    of: String,
    /// Upper bound on the data's age.
    age_s: f64,
}

#[derive(Serialize)]
struct TargetStatus {
    number: u64,
    /// Number of the list's last target.
    last: u64,
    x_m: f64,
    y_m: f64,
    /// `None` without a pose.
    to_go_m: Option<f64>,
}

#[derive(Serialize)]
struct FollowingStatus {
    lost: bool,
    /// Time since the last beacon. `None` before the first.
    seen_ago_s: Option<f64>,
    distance_m: f64,
    used: u64,
    refused: u64,
    refusal: Option<&'static str>,
    result: String,
}

#[derive(Serialize)]
struct PoseStatus {
    x_m: f64,
    y_m: f64,
    heading_deg: f64,
    /// Two standard deviations of the position along the worst axis.
    within_m: f64,
}

#[derive(Serialize)]
struct LinkStatus {
    connected: bool,
    stopped: bool,
    /// Effect of the failsafe, such as go or stand.
    robot: &'static str,
    /// Cause of the effect. `None` while the robot goes.
    cause: Option<&'static str>,
    /// By the encoders.
    at_rest: bool,
    /// Time since the robot's last answer. `None` while it answers.
    lost_s: Option<f64>,
    attempts: u64,
    next_attempt_s: Option<f64>,
    losses: u64,
    reboots: u64,
    unsent: u64,
    foreign_datagrams: u64,
    ignored_samples: u64,
    ignored_writer: u32,
    other_port: u32,
}

#[derive(Serialize)]
struct PowerStatus {
    board_v: f64,
    motor_v: f64,
    servo_v: f64,
    low: bool,
}

#[derive(Serialize)]
struct StageStatus<'a> {
    name: &'a str,
    state: String,
    pid: u32,
    generation: u32,
    restarts: u32,
    uptime_s: Option<f64>,
    beat_age_s: Option<f64>,
    output_age_s: Option<f64>,
}

/// Wait for missing data: the link at 10 Hz, batteries several times a second.
const LINK_PATIENCE: Duration = Duration::from_millis(400);

const SHOWN_EVERY: Duration = Duration::from_millis(20);

pub fn main(arguments: &Arguments) -> Result {
    match arguments {
        Arguments { all: true, .. } => all::print(arguments.json),
        Arguments { follow: true, .. } => follow(arguments),
        _ => print_one(arguments),
    }
}

/// Topics of a status. The roster comes last, as in [`robot_state::TOPICS`].
static WANTED: [&dyn AnyTopic; 8] = [
    &topics::FOLLOWING,
    &topics::MIRROR,
    &topics::COMPLAINTS,
    &topics::TARGET,
    &topics::POSE,
    &topics::POWER,
    &topics::LINK,
    &topics::ROSTER,
];

/// Returns whether `robot` is complete, or [`LINK_PATIENCE`] is over; link, batteries and pose may
/// be absent.
fn is_complete(robot: &RobotState, waited: Duration) -> bool {
    let lost = robot.link.is_some_and(|link| link.connected == 0);
    let heard = robot.power.is_some() && robot.pose.is_some();
    let all = robot.link.is_some() && robot.target.is_some() && (heard || lost);
    robot.supervisor.is_some() && (all || waited >= LINK_PATIENCE)
}

fn print_one(arguments: &Arguments) -> Result {
    let domain = arguments.robot.domain();
    // A killed supervisor leaves its bus.
    if operator::owes_stop(&arguments.robot) && !domain.is_supervised() {
        return print_guarded(arguments);
    }
    let bus = roster::join(&domain, "status")?;
    let mut feed = Feed::open(&bus, &WANTED)?;
    let mut waiter = Waiter::default();
    for topic in &WANTED[5..] {
        waiter.on(bus.wakeup(*topic)?);
    }
    let began = Instant::now();
    let mut robot = RobotState::default();
    loop {
        feed.read(&mut |sample| {
            robot.apply(&sample);
        })?;
        if let Some(status) = status(arguments, &robot, began.elapsed()) {
            return print(&status, arguments.json);
        }
        if began.elapsed() >= PATIENCE {
            return Err(format!(
                "robot {:?} has a bus but no supervisor that publishes; start it again with `firsthand run`",
                arguments.robot.to_string()
            )
            .into());
        }
        waiter.wait(LINK_PATIENCE)?;
    }
}

fn print_guarded(arguments: &Arguments) -> Result {
    let robot = &arguments.robot;
    let sees = operator::sees(robot);
    if arguments.json {
        let guard = sees.map(|(sees, silent_s)| json!({ "sees": sees, "silent_s": silent_s }));
        return print_line(json!({ "robot": robot, "stop_guard": guard }));
    }
    match sees {
        Some((sees, _)) => print_line(format_args!(
            "robot {robot}: no run; its stop guard orders the stop: {sees}; once you see it at rest, `firsthand stop --sign-off` ends that"
        )),
        None => print_line(format_args!(
            "robot {robot}: no run, and NO STOP GUARD although it was not seen at rest: `firsthand stop` starts one"
        )),
    }
}

fn follow(arguments: &Arguments) -> Result {
    let mut stream = Stream::with_usual_priority()?;
    let domain = arguments.robot.domain();
    let mut follower = Follower::new(domain, "status", WANTED[7], |bus| Feed::open(bus, &WANTED))
        .also_on(WANTED[5..7].iter().copied());
    let (mut robot, mut waiting) = (RobotState::default(), Waiting::default());
    let (mut began, mut shown) = (Instant::now(), None::<Instant>);
    while !stream.has_ended() {
        let event = follower.wait(LOOK_EVERY)?;
        waiting.tell(&event, &arguments.robot);
        match event {
            Event::Connected => (robot, began) = (RobotState::default(), Instant::now()),
            Event::Disconnected | Event::Nothing => {}
            Event::Samples(feed) => {
                feed.read(&mut |sample| {
                    robot.apply(&sample);
                })?;
                // Lockstep may run thousands of ticks per second.
                if shown.is_none_or(|shown| shown.elapsed() >= SHOWN_EVERY)
                    && let Some(status) = status(arguments, &robot, began.elapsed())
                {
                    shown = Some(Instant::now());
                    let line = json_lines(&[&status])?;
                    stream.write(&if arguments.json { line } else { format!("{status}\n") })?;
                }
            }
        }
    }
    Ok(())
}

/// Returns `None` if incomplete.
fn status<'a>(
    arguments: &'a Arguments,
    robot: &'a RobotState,
    waited: Duration,
) -> Option<Status<'a>> {
    let header = robot.supervisor.filter(|_| is_complete(robot, waited))?;
    let mirrors = arguments.robot.domain().mirrors();
    // Without its age, a mirror's status would look local.
    if mirrors.is_some() && robot.mirror.is_none() {
        return None;
    }
    Some(Status {
        robot: &arguments.robot,
        supervisor_pid: header.supervisor_pid,
        order: order(&header),
        tick: header.stamp.tick,
        mission_time_s: header.stamp.seconds(),
        mirror: robot
            .mirror
            .map(|mirror| MirrorStatus { of: mirrors.unwrap_or_default(), age_s: mirror.age_s() }),
        target: robot.target().map(|&TargetSample { number, last, target, .. }| TargetStatus {
            number,
            last,
            x_m: target.x_m,
            y_m: target.y_m,
            to_go_m: robot.to_go_m(),
        }),
        following: robot.following().map(|following| FollowingStatus {
            lost: following.state() == FollowState::Lost,
            seen_ago_s: following.heard_ago_s(header.stamp.seconds()),
            distance_m: following.distance_m,
            used: following.used,
            refused: following.refused,
            refusal: match following.refusal() {
                BeaconRefusal::None => None,
                refusal => Some(refusal.words()),
            },
            result: following.result(),
        }),
        pose: robot.pose.map(|pose| PoseStatus {
            x_m: pose.x_m,
            y_m: pose.y_m,
            heading_deg: wrap_angle(pose.heading_rad).to_degrees(),
            within_m: pose.position_within_m(),
        }),
        link: robot.link.as_ref().map(link_status),
        power: robot.power.map(|power| PowerStatus {
            board_v: power.board_v,
            motor_v: power.motor_v,
            servo_v: power.servo_v,
            low: power.is_low(),
        }),
        complaint: robot.complaint().map(|complaint| ComplaintStatus {
            stage: name_str(&complaint.stage),
            trouble: complaint.refusal(),
        }),
        stages: robot.stages.iter().map(stage_status).collect(),
    })
}

fn stage_status(entry: &RosterEntry) -> StageStatus<'_> {
    StageStatus {
        name: name_str(&entry.stage),
        state: words(entry.state()),
        pid: entry.pid,
        generation: entry.generation,
        restarts: entry.restarts,
        uptime_s: seconds(entry.uptime_ns),
        beat_age_s: seconds(entry.beat_age_ns),
        output_age_s: seconds(entry.output_age_ns),
    }
}

fn link_status(link: &LinkSample) -> LinkStatus {
    let connected = link.connected == 1;
    let while_lost = |nanoseconds: u64| (!connected).then_some(nanoseconds as f64 * 1e-9);
    LinkStatus {
        connected,
        stopped: link.stopped(),
        robot: link.action().effect(),
        cause: (link.action() != Action::Go).then(|| link.cause().name()),
        at_rest: link.at_rest == 1,
        lost_s: while_lost(link.lost_ns),
        attempts: link.attempts,
        next_attempt_s: while_lost(link.next_attempt_ns),
        losses: link.losses,
        reboots: link.reboots,
        unsent: link.unsent,
        foreign_datagrams: link.foreign_datagrams,
        ignored_samples: link.ignored_samples,
        ignored_writer: link.ignored_writer,
        other_port: link.other_port,
    }
}

impl fmt::Display for Status<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "robot {}: supervisor {}, {}, {:.1} s into the mission",
            self.robot, self.supervisor_pid, self.order, self.mission_time_s
        )?;
        if let Some(MirrorStatus { of, age_s }) = &self.mirror {
            writeln!(f, "a mirror of the robot at {of}; its samples are at most {age_s:.1} s old")?;
        }
        if let Some(TargetStatus { number, last, x_m, y_m, to_go_m }) = &self.target {
            write!(f, "target {number} of {last}: ({x_m:.2}, {y_m:.2})")?;
            if let Some(to_go_m) = to_go_m {
                write!(f, ", {to_go_m:.2} m to go")?;
            }
            writeln!(f)?;
        }
        if let Some(following) = &self.following {
            let what = if following.lost { "LOST what it follows" } else { "follows" };
            let ago = if following.seen_ago_s.is_some() { " ago" } else { "" };
            write!(
                f,
                "{what} at {:.2} m, seen {}{ago}; {}",
                following.distance_m,
                age(following.seen_ago_s),
                following.result
            )?;
            if let Some(why) = following.refusal {
                write!(f, "; samples refused: {}, the newest because {why}", following.refused)?;
            }
            writeln!(f)?;
        }
        if let Some(PoseStatus { x_m, y_m, heading_deg, within_m }) = &self.pose {
            writeln!(
                f,
                "believes it is at ({x_m:.2}, {y_m:.2}) within {within_m:.2} m, heading {heading_deg:.0} degrees"
            )?;
        }
        if let Some(link) = &self.link {
            writeln!(f, "{link}")?;
        }
        if let Some(PowerStatus { board_v, motor_v, servo_v, low }) = &self.power {
            let word = if *low { "BATTERY LOW" } else { "batteries" };
            writeln!(
                f,
                "{word}: board {board_v:.1} V, motors {motor_v:.1} V, servos {servo_v:.1} V"
            )?;
        }
        if let Some(ComplaintStatus { stage, trouble }) = &self.complaint {
            writeln!(f, "{stage}: {trouble}")?;
        }
        let mut table = Table::new([
            "stage",
            "state",
            ">pid",
            ">gen",
            ">uptime",
            ">restarts",
            ">last beat",
            ">last output",
        ]);
        for stage in &self.stages {
            table.row([
                &stage.name,
                &stage.state,
                &stage.pid,
                &stage.generation,
                &age(stage.uptime_s),
                &stage.restarts,
                &age(stage.beat_age_s),
                &age(stage.output_age_s),
            ]);
        }
        write!(f, "{table}")
    }
}

impl fmt::Display for LinkStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.connected {
            write!(f, "the robot answers")?;
        } else {
            write!(
                f,
                "ROBOT LOST for {}: {} attempts to reach it, the next in {}",
                age(self.lost_s),
                self.attempts,
                age(self.next_attempt_s)
            )?;
        }
        if self.losses > 0 {
            write!(f, "; times it was lost: {}", self.losses)?;
        }
        if self.reboots > 0 {
            write!(f, "; times it restarted: {}", self.reboots)?;
        }
        match self.cause {
            None => Ok(()),
            Some(cause) if self.stopped && !self.at_rest => {
                write!(f, "; NOT SEEN AT REST; it {}: {cause}", self.robot)
            }
            Some(cause) => write!(f, "; it {}: {cause}", self.robot),
        }
    }
}
