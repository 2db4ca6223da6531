//! Missions of a robot that has a fault from some moment on, and the robot's behaviour after it.

use std::{
    fs,
    net::SocketAddr,
    path::{Path, PathBuf},
    process::Stdio,
    time::{Duration, Instant},
};

use common::{
    bus::Reader,
    domain::Domain,
    follower::{Event, Follower},
    ground_truth::GroundTruthTick,
    samples::LinkSample,
    topics,
};
use console::output::write_stderr;
use mission_control::{outcome::RIGHT_PLACE_M, simulator::Simulator};
use processes::process::Process;
use rustix::process::{Pid, Signal, kill_process};
use summary::Summary;

use crate::chaos::{
    mission,
    options::{Faults, Options},
    proxy::Proxy,
    robot_fault::{Promise, RobotFault},
    stop_time_table::{Entry, StopTimeTable},
};
use crate::{
    error::{OrCannot as _, Result},
    random::Random,
    robot::{command_line, firsthand, processes},
};

/// Time from the robot's departure to its fault, seconds: the least, and the width of the random range.
const FAULT_AFTER_S: (f64, f64) = (1.0, 4.0);
const DEPARTED_M: f64 = 0.1;
/// The time for which a faulty robot is watched: several times as long as it may move.
const WATCHED: Duration = Duration::from_secs(10);
/// The time for a faulty robot that may go on: until it has arrived, because only then it can report a wrong place.
const WATCHED_ON_ITS_WAY: Duration = Duration::from_secs(90);
const DEPARTS_WITHIN: Duration = Duration::from_secs(60);
const END_GRACE: Duration = Duration::from_secs(5);
const LOOK: Duration = Duration::from_millis(10);

/// Run missions of each fault that is asked for and that a robot of this protocol can have.
pub fn run(options: &Options) -> Result<StopTimeTable> {
    let asked = &options.asked;
    let protocol = options.loaded.robot.protocol();
    let faults = asked.robot_faults.iter().flat_map(|Faults(faults)| faults.iter().copied());
    let (faults, left_out): (Vec<_>, Vec<_>) =
        faults.partition(|fault| fault.has_meaning(protocol));
    if !left_out.is_empty() {
        let names: Vec<_> = left_out.iter().map(|fault| fault.row().name).collect();
        let left_out = format!("no faults of this robot's protocol: {}", names.join(", "));
        if faults.is_empty() {
            return Err(left_out.into());
        }
        write_stderr(&format!("left out, {left_out}\n"));
    }
    let all = faults.len() as u64 * u64::from(asked.missions);
    let mut table = StopTimeTable::default();
    for fault in faults {
        for number in 0..u64::from(asked.missions) {
            let seed = asked.seed + number;
            let files = directory(options, fault, seed);
            fs::create_dir(&files).or_cannot("make a directory")?;
            let entry = one(options, fault, seed, &files)?;
            if entry.is_kept() {
                fs::remove_dir_all(&files).or_cannot("remove its directory")?;
            }
            table.entries.push(entry);
            write_stderr(&format!("{} of {all} missions\n", table.entries.len()));
        }
    }
    Ok(table)
}

fn one(options: &Options, fault: RobotFault, seed: u64, files: &Path) -> Result<Entry> {
    let mut robot = mission::robot(options, seed, &files.join("robot"), fault.is_kill())?;
    let protocol = options.loaded.robot.protocol();
    let proxy = Proxy::start(robot.address(), fault, protocol, seed)?;
    let mut child = start(options, seed, proxy.address(), &files.join("run"))?;
    let summary = mission::read_stdout(&mut child);
    let mut observed = Observed::default();
    let watched = observed.watch(options, fault, seed, &mut child, &mut robot, &proxy);
    // A frozen supervisor does not end in order.
    child.signal(Signal::CONT);
    child.end(END_GRACE);
    let summary = summary.join().unwrap_or_default();
    robot.stop()?;
    watched?;
    Ok(observed.entry(options, fault, seed, robot.truth(), &summary))
}

fn start(options: &Options, seed: u64, robot: SocketAddr, directory: &Path) -> Result<Process> {
    let mut start = mission::command(options, seed, "1", directory, false)?;
    start.args(["--set", &format!("robot.address='udp://{robot}'")]);
    Process::spawn(start).or_cannot("start a mission")
}

#[derive(Debug, Default)]
struct Observed {
    /// The time when the fault began, and the newest tick of the ground truth then.
    fault_began: Option<(Instant, usize)>,
    last_moving: Option<Instant>,
    ended: Option<Instant>,
    /// Whether the mission ended by itself before the fault.
    ended_by_itself: bool,
    link: Option<LinkSample>,
    /// The machine's time at the robot's mission time 0: the least estimate of all ticks, because a tick is read some time
    /// after it is written.
    epoch: Option<Instant>,
    ticks: usize,
}

impl Observed {
    /// Watch until the mission ends, or for as long as the fault needs.
    fn watch(
        &mut self,
        options: &Options,
        fault: RobotFault,
        seed: u64,
        child: &mut Process,
        robot: &mut Simulator,
        proxy: &Proxy,
    ) -> Result {
        let began = Instant::now();
        let (least, more) = FAULT_AFTER_S;
        let fault_after_s = least + more * Random::new(seed, 17 + fault as u128).share();
        let watched = match fault.row().promise {
            Promise::Unharmed | Promise::EndsAtRest => WATCHED_ON_ITS_WAY,
            _ => WATCHED,
        };
        let (mut departed, mut stop) = (None, None);
        // The process leaves the bus of the mission before, which that mission may have left behind.
        let robot_domain = Domain::of(options.asked.robot.clone());
        let mut link =
            Follower::new(robot_domain, "chaos", &topics::LINK, |bus| bus.reader(&topics::LINK));
        loop {
            self.ended = Some(Instant::now());
            self.last_moving = proxy.last_moving();
            robot.poll()?;
            self.take(robot.truth());
            if let Ok(Event::Samples(reader)) = link.wait(Duration::ZERO) {
                self.hear(reader)?;
            }
            self.ended_by_itself =
                child.try_reap().or_cannot("reap")?.is_some() && !fault.is_kill();
            let patience = self.fault_began.map_or(began + DEPARTS_WITHIN, |(at, _)| at + watched);
            if self.ended_by_itself || Instant::now() >= patience {
                break;
            }
            let newest = robot.truth().last();
            if departed.is_none() {
                let gone = newest.filter(|tick| tick.x.hypot(tick.y) >= DEPARTED_M);
                departed = gone.map(|tick| tick.time_s);
            }
            let due = |tick: &GroundTruthTick| {
                departed.is_some_and(|departed| tick.time_s >= departed + fault_after_s)
            };
            if self.fault_began.is_none() && (fault.begins_at_boot() || newest.is_some_and(due)) {
                proxy.begin_fault();
                self.fault_began = Some((Instant::now(), self.ticks));
                if fault.is_kill() {
                    kill(fault, child, &directory(options, fault, seed));
                }
                if matches!(fault, RobotFault::DoesNotStop | RobotFault::AllKilled) {
                    stop = Some(operator_stop(options)?);
                }
            }
            std::thread::park_timeout(LOOK);
        }
        if let Some(mut stop) = stop {
            stop.end(END_GRACE);
        }
        Ok(())
    }

    fn take(&mut self, truth: &[GroundTruthTick]) {
        let now = Instant::now();
        for tick in truth.get(self.ticks..).unwrap_or_default() {
            let since = Duration::try_from_secs_f64(tick.time_s).unwrap_or_default();
            let epoch = now.checked_sub(since);
            self.epoch = match (self.epoch, epoch) {
                (Some(known), Some(epoch)) => Some(known.min(epoch)),
                (known, epoch) => known.or(epoch),
            };
        }
        self.ticks = truth.len();
    }

    fn hear(&mut self, link: &mut Reader<LinkSample>) -> Result {
        while let Some(sample) = link.next_sample()? {
            self.link = Some(sample);
        }
        Ok(())
    }

    fn entry(
        &self,
        options: &Options,
        fault: RobotFault,
        seed: u64,
        truth: &[GroundTruthTick],
        summary: &[u8],
    ) -> Entry {
        let stopped = self.link.filter(LinkSample::stopped);
        let cause = stopped.map_or("", |link| link.cause().name());
        let (mut outcome, mut reason) = if self.ended_by_itself {
            let summary: Option<Summary> = serde_json::from_slice(summary).ok();
            summary.map(|it| (it.outcome.as_str().to_owned(), it.reason)).unwrap_or_default()
        } else {
            ("goes on".to_owned(), cause.to_owned())
        };
        if fault.is_kill() {
            (outcome, reason) = ("killed".to_owned(), fault.row().name.to_owned());
        }
        let last = truth.last();
        let target = options.loaded.target;
        let wrong =
            last.is_some_and(|tick| (tick.x - target.x).hypot(tick.y - target.y) > RIGHT_PLACE_M);
        if outcome == "reached" && wrong {
            outcome = "wrong_place".to_owned();
        }
        let mut entry = Entry {
            fault,
            seed,
            promised_s: fault.row().promise.rest_within_s(&options.loaded),
            fault_began: false,
            last_moving_s: None,
            rest_s: None,
            way_m: 0.0,
            watched_s: 0.0,
            collisions: 0,
            outcome,
            reason,
        };
        let (Some((began, tick)), Some(epoch), Some(ended)) =
            (self.fault_began, self.epoch, self.ended)
        else {
            return entry;
        };
        let since_fault = |time: Instant| time.saturating_duration_since(began).as_secs_f64();
        let at_time = |time_s: f64| {
            epoch.checked_add(Duration::try_from_secs_f64(time_s).unwrap_or_default())
        };
        entry.fault_began = true;
        entry.watched_s = since_fault(ended);
        entry.last_moving_s = Some(self.last_moving.map_or(0.0, since_fault));
        // The end of the run stops the robot, so only ticks before it count.
        let counts = |tick: &&GroundTruthTick| at_time(tick.time_s).is_some_and(|at| at <= ended);
        let track_m = options.loaded.body().track_m;
        let mut watched = truth.get(tick..).unwrap_or_default().iter().filter(counts);
        let along = watched.clone().zip(watched.clone().skip(1));
        entry.way_m = along.map(|(from, to)| (to.x - from.x).hypot(to.y - from.y)).sum();
        let moving = watched.clone().rfind(|tick| !is_at_rest(tick, track_m));
        let moved_until = moving.and_then(|tick| at_time(tick.time_s));
        entry.rest_s = Some(moved_until.map_or(0.0, since_fault));
        let contacts = |tick: Option<&GroundTruthTick>| tick.map_or(0, |tick| tick.contacts);
        let before = tick.checked_sub(1).and_then(|before| truth.get(before));
        entry.collisions = contacts(watched.next_back()).saturating_sub(contacts(before));
        entry
    }
}

fn is_at_rest(tick: &GroundTruthTick, track_m: f64) -> bool {
    tick.v.abs() + tick.omega.abs() * track_m / 2.0 < GroundTruthTick::AT_REST_M_S
}

fn directory(options: &Options, fault: RobotFault, seed: u64) -> PathBuf {
    options.directory.join(format!("{}-{seed}", fault.row().name))
}

/// Kill the processes that `fault` names, of the mission with its files in `directory`.
fn kill(fault: RobotFault, supervisor: &Process, directory: &Path) {
    let run = directory.join("run");
    let run = run.to_string_lossy();
    let lines =
        processes().map(|pid| (pid, String::from_utf8_lossy(&command_line(pid)).into_owned()));
    let others = lines.filter(|(pid, line)| *pid != std::process::id() && line.contains(&*run));
    let others: Vec<_> = others.collect();
    if fault == RobotFault::LinkKilled {
        // A stopped supervisor starts no other link.
        supervisor.signal(Signal::STOP);
    } else {
        supervisor.signal(Signal::KILL);
    }
    for (pid, line) in others {
        let is_hit = match fault {
            RobotFault::LinkKilled => line.split(['\0', ' ']).any(|word| word == "link"),
            fault => fault == RobotFault::AllKilled,
        };
        if let Some(pid) = Pid::from_raw(pid as i32).filter(|_| is_hit) {
            // A process that has ended needs no signal.
            let _ = kill_process(pid, Signal::KILL);
        }
    }
}

fn operator_stop(options: &Options) -> Result<Process> {
    let mut command = firsthand(&["stop", "--robot", &options.asked.robot.to_string()]);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    Process::spawn(command).or_cannot("stop the robot")
}
