use std::{
    fs,
    path::{Path, PathBuf},
    process::Stdio,
    time::{Duration, Instant},
};

use clap::ValueEnum as _;
use common::{
    follower::{Event, Follower},
    ground_truth::GroundTruthTick,
    samples::LinkSample,
    topics,
};
use console::{missions, output::write_stderr};
use mission_control::surroundings::SimulatedRobot as _;
use mission_control::{operator::sign_off, outcome::RIGHT_PLACE_M, simulator::Simulator};
use processes::process::Process;
use rustix::process::Signal;

use crate::chaos::{
    attack::send,
    mission,
    options::Options,
    proxy::Proxy,
    robot_fault::{Promise, RobotFault},
    stop_time_table::{Entry, StopTimeTable},
};
use simulation::Random;

use crate::{
    error::{OrCannot as _, Result},
    robot::{Run, command_lines, firsthand},
    ros2_robot::Ros2Robot,
};

/// Minimum, and width of the random range.
const FAULT_AFTER_S: (f64, f64) = (1.0, 4.0);
const DEPARTED_M: f64 = 0.1;
/// Watch time of a faulty robot: several times as long as it may move.
const WATCHED: Duration = Duration::from_secs(10);
/// Watch time of a faulty robot that may go on: until arrival, when it can report a wrong place.
const WATCHED_ON_ITS_WAY: Duration = Duration::from_secs(90);
const DEPARTS_WITHIN: Duration = Duration::from_secs(60);
const END_GRACE: Duration = Duration::from_secs(5);
const LOOK: Duration = Duration::from_millis(10);

pub fn run(options: &Options) -> Result<StopTimeTable> {
    let asked = &options.asked;
    let protocol = options.protocol();
    let named = asked.robot_faults.as_deref().filter(|named| !named.is_empty());
    let faults = named.unwrap_or(RobotFault::value_variants()).iter().copied();
    let (faults, left_out): (Vec<_>, Vec<_>) =
        faults.partition(|fault| fault.has_meaning(protocol));
    if !left_out.is_empty() {
        let names: Vec<_> = left_out.iter().map(|fault| &*fault.row().name).collect();
        let left_out = format!("this robot's protocol has no such faults: {}", names.join(", "));
        if faults.is_empty() {
            return Err(left_out.into());
        }
        write_stderr(&format!("skipped: {left_out}\n"));
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
    let Options { asked, loaded, .. } = options;
    let directory = files.join("run");
    let mut robot = mission::robot(options, seed, files, fault.is_kill())?;
    let proxy = Proxy::start(robot.address(), fault, loaded.robot.protocol(), seed);
    let proxy = proxy.or_cannot("start a proxy")?;
    let mut start = mission::command(options, seed, asked.pace, &directory);
    let node = if asked.ros2 {
        let stated =
            |keys: &[String]| missions::load(&asked.mission, &[&asked.set[..], keys].concat());
        Some(Ros2Robot::start(proxy.address, fault as u64, 1.0, stated)?)
    } else {
        None
    };
    let address = [format!("robot.address='udp://{}'", proxy.address)];
    let keys = node.as_ref().map_or(&address[..], |node| &node.keys);
    start.args(keys.iter().flat_map(|key| ["--set", key]));
    let mut run = Run::start(start, &directory, false)?;
    let entry = watch(options, fault, seed, &mut run, &mut robot, &proxy);
    // A frozen supervisor cannot end cleanly.
    run.process.signal(Signal::CONT);
    run.process.end(END_GRACE);
    // The robot ends here, so its rest will be unobserved.
    sign_off(&asked.robot).or_cannot("sign the robot off")?;
    entry
}

fn watch(
    options: &Options,
    fault: RobotFault,
    seed: u64,
    run: &mut Run,
    robot: &mut Simulator,
    proxy: &Proxy,
) -> Result<Entry> {
    let row = fault.row();
    let Options { asked, loaded, .. } = options;
    let (least, more) = FAULT_AFTER_S;
    let fault_after_s = least + more * Random::new(seed, 17 + fault as u128).share();
    let watched = match row.promise {
        Promise::Unharmed | Promise::EndsAtRest => WATCHED_ON_ITS_WAY,
        _ => WATCHED,
    };
    let began = Instant::now();
    let mut fault_began = None;
    let (mut departed_s, mut stop, mut link) = (None, None, None);
    // A mission may leave its bus behind.
    let domain = asked.robot.domain();
    let mut links = Follower::new(domain, "chaos", &topics::LINK, |bus| bus.reader(&topics::LINK));
    // Ground truth counts only until the run ends, which stops the robot.
    let (ended, moving, is_over) = loop {
        let (now, moving) = (Instant::now(), proxy.last_moving());
        robot.poll()?;
        if let Ok(Event::Samples(reader)) = links.wait(Duration::ZERO) {
            while let Some(sample) = reader.next_sample()? {
                link = Some(sample);
            }
        }
        let is_over = run.process.try_reap().or_cannot("reap")?.is_some() && !fault.is_kill();
        let patience = fault_began.map_or(began + DEPARTS_WITHIN, |(at, _)| at + watched);
        if is_over || Instant::now() >= patience {
            break (now, moving, is_over);
        }
        let newest = robot.truth().last();
        let gone = newest.filter(|tick| tick.x.hypot(tick.y) >= DEPARTED_M);
        departed_s = departed_s.or(gone.map(|tick| tick.time_s));
        // The fault begins at a tick, from which times count.
        let due = newest
            .zip(departed_s)
            .is_some_and(|(tick, departed_s): (_, f64)| tick.time_s >= departed_s + fault_after_s);
        if fault_began.is_none() && (fault == RobotFault::LateFromBoot || due) {
            proxy.begin_fault();
            fault_began = Some((Instant::now(), robot.truth().len()));
            if fault.is_kill() {
                kill(fault, &run.process, &directory(options, fault, seed));
            }
            if matches!(fault, RobotFault::DoesNotStop | RobotFault::AllKilled) {
                stop = Some(operator_stop(options)?);
            }
        }
        std::thread::park_timeout(LOOK);
    };
    if let Some(mut stop) = stop {
        stop.end(END_GRACE);
    }
    let truth = robot.truth();
    let (mut outcome, reason) = if fault.is_kill() {
        ("killed".to_owned(), row.name.clone())
    } else if is_over {
        run.summary().map(|it| (it.outcome.as_str().to_owned(), it.reason)).unwrap_or_default()
    } else {
        let stopped = link.filter(LinkSample::stopped);
        ("goes on".to_owned(), stopped.map_or("", |link| link.cause().name()).to_owned())
    };
    let target = loaded.target;
    let is_wrong =
        |tick: &GroundTruthTick| (tick.x - target.x).hypot(tick.y - target.y) > RIGHT_PLACE_M;
    if outcome == "reached" && truth.last().is_some_and(is_wrong) {
        outcome = "wrong_place".to_owned();
    }
    let (began, first) = fault_began.unwrap_or((ended, truth.len()));
    let since_fault = |time: Instant| time.saturating_duration_since(began).as_secs_f64();
    // The previous tick is the newest at the start of the fault.
    let watched = &truth[first.saturating_sub(1).min(truth.len())..];
    let ways = watched.windows(2).map(|two| (two[1].x - two[0].x).hypot(two[1].y - two[0].y));
    let began_s = watched.first().map_or(0.0, |tick| tick.time_s);
    let track_m = loaded.body().track_m;
    let turning = watched.iter().skip(1).rfind(|tick| !is_at_rest(tick, track_m));
    let contacts = |tick: Option<&GroundTruthTick>| tick.map_or(0, |tick| tick.contacts);
    Ok(Entry {
        fault,
        seed,
        promised_s: fault.rest_within_s(loaded, options.protocol()),
        fault_began: fault_began.is_some(),
        last_moving_s: fault_began.map(|_| since_fault(moving)),
        rest_s: fault_began.map(|_| turning.map_or(0.0, |tick| tick.time_s - began_s)),
        way_m: ways.sum(),
        watched_s: since_fault(ended),
        collisions: contacts(watched.last()).saturating_sub(contacts(watched.first())),
        outcome,
        reason,
    })
}

fn is_at_rest(tick: &GroundTruthTick, track_m: f64) -> bool {
    tick.v.abs() + tick.omega.abs() * track_m / 2.0 < GroundTruthTick::AT_REST_M_S
}

fn directory(options: &Options, fault: RobotFault, seed: u64) -> PathBuf {
    options.directory.join(format!("{}-{seed}", fault.row().name))
}

fn kill(fault: RobotFault, supervisor: &Process, directory: &Path) {
    let run = directory.join("run");
    let run = run.to_string_lossy();
    // A stopped supervisor starts no other link.
    supervisor.signal(match fault {
        RobotFault::LinkKilled => Signal::STOP,
        _ => Signal::KILL,
    });
    for (process, line) in command_lines().filter(|(_, line)| line.contains(&*run)) {
        let is_hit = match fault {
            RobotFault::LinkKilled => line.split(' ').any(|word| word == "link"),
            fault => fault == RobotFault::AllKilled,
        };
        if is_hit {
            send(process, Signal::KILL);
        }
    }
}

fn operator_stop(options: &Options) -> Result<Process> {
    let mut command = firsthand(&["stop", "--robot", &options.asked.robot.to_string()]);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    Process::spawn(command).or_cannot("stop the robot")
}
