//! One mission, undisturbed and under attack.

use std::{
    fs::{self, File},
    path::Path,
    process::{Command, Stdio},
    thread::JoinHandle,
    time::{Duration, Instant},
};

use common::{clock::Pace, mission::Mission};
use serde_json::Value;

use crate::chaos::{
    attack::Attack,
    changes::Operator,
    consumers::Consumers,
    options::{Arguments, Options},
    report::End,
    series::Series,
};
use crate::{
    error::{self, OrCannot as _, Result},
    robot::{self, firsthand},
};
use mission_control::simulator::Simulator;
use processes::{DEATHS, process::Process};
use summary::Summary;

/// The time after which a mission is stopped. In wall-clock time a mission takes half a minute.
const PATIENCE: Duration = Duration::from_secs(600);

pub fn command(
    options: &Options,
    seed: u64,
    pace: &str,
    out: &Path,
    records: bool,
) -> Result<Command> {
    let Arguments { mission, robot, set, .. } = &options.asked;
    let mut command = robot::mission("run", mission, robot, set);
    command.args(["--pace", pace, "--seed", &seed.to_string(), "--out"]).arg(out);
    child(command, out, records)
}

/// Make `command` a child that ends with this process. Its standard output is piped; its standard error goes to a file
/// beside the run's directory.
fn child(mut command: Command, directory: &Path, records: bool) -> Result<Command> {
    let stderr = directory.with_extension("stderr");
    let stderr = File::options().create(true).append(true).open(stderr);
    let stderr = stderr.or_cannot("write a mission's standard error")?;
    command.args((!records).then_some("--no-record"));
    command.args(["--parent", &std::process::id().to_string()]);
    command.stdout(Stdio::piped()).stderr(stderr);
    Ok(command)
}

/// The summary of the mission without an attack, to compare with. If ticks are compared, it runs at the same pace.
pub fn undisturbed(options: &Options, seed: u64) -> Result<Summary> {
    let directory = options.directory.join("undisturbed");
    let pace = if options.asked.only_consumers { options.asked.pace } else { Pace::Max };
    let output = command(options, seed, &pace.to_string(), &directory, false)?
        .output()
        .or_cannot("start a mission")?;
    fs::remove_dir_all(directory).or_cannot("remove its directory")?;
    error::summary(&output.stdout, &output.stdout)
}

/// Attack the mission, and report. Its files stay if something was wrong.
pub fn attack(series: &mut Series<'_>, seed: u64, undisturbed: &Summary) -> Result {
    let options = series.options;
    let asked = &options.asked;
    let before = series.report.kills();
    let files = options.directory.join(format!("seed-{seed}"));
    fs::create_dir(&files).or_cannot("make a directory")?;
    let directory = files.join("run");
    let mut robot = asked
        .include_supervisor
        .then(|| robot(options, seed, &files.join("robot"), false))
        .transpose()?;
    let mut start = command(options, seed, &asked.pace.to_string(), &directory, options.records())?;
    if let Some(robot) = &robot {
        let address = robot.address();
        start.args(["--set", &format!("robot.address='udp://{address}'")]);
    }
    let consumers = files.join("consumers");
    let consumers = Consumers::start(options, consumers, &mut series.report)?;
    let operator =
        asked.targets.then(|| Operator::start(asked.robot.clone(), &options.loaded, seed));
    let mut attack = Attack::new(seed, consumers);
    let began = Instant::now();
    let summary = loop {
        let mut supervisor = Process::spawn(start).or_cannot("start a mission")?;
        let summary = read_stdout(&mut supervisor);
        let attacked = attack.run(series, &mut supervisor, robot.as_mut(), PATIENCE);
        supervisor.end(Duration::from_secs(2));
        let summary = summary.join().unwrap_or_default();
        attacked?;
        // A supervisor that was hit leaves no summary, unless the run had just ended.
        if !attack.supervisor_is_down() || !summary.is_empty() || began.elapsed() >= PATIENCE {
            break error::summary(&summary, &summary)?;
        }
        start = firsthand(&["run", "--json", "--resume"]);
        start.arg(&directory);
        start = child(start, &directory, options.records())?;
    };
    attack.end(series)?;
    let kills = series.report.kills() - before;
    let mut end = End {
        seed,
        outcome: summary.outcome,
        reason: summary.reason.clone(),
        collisions: summary.collisions.unwrap_or_default(),
        pose_excess_m: summary.pose_error_m.unwrap_or_default(),
        // An undisturbed robot whose target does not change takes another way.
        pose_allowance_m: match asked.targets {
            true => f64::INFINITY,
            false => pose_allowance_m(&options.loaded, kills, &summary),
        },
        healthy_aborted: attack.healthy_aborted(&deaths(&directory)),
    };
    let mut truth = Vec::new();
    if let Some(mut robot) = robot {
        robot.stop()?;
        truth = robot.truth().to_vec();
        end.collisions = truth.last().map_or(0, |tick| tick.contacts);
        end.pose_excess_m = attack.pose_error(&truth).unwrap_or(f64::INFINITY);
    }
    end.pose_excess_m -= undisturbed.pose_error_m.unwrap_or_default();
    let mut right = series.report.add_mission(&end);
    if let Some(operator) = operator {
        right &=
            series.report.targets.get_or_insert_default().add(seed, operator, &summary, &truth);
    }
    if asked.only_consumers {
        series.report.tick_latencies.get_or_insert_default().add(undisturbed, &summary);
    }
    if asked.replay {
        right &=
            series.report.replays.get_or_insert_default().add(seed, &directory, &attack.consumers);
    }
    if right {
        fs::remove_dir_all(&files).or_cannot("remove its directory")?;
    }
    Ok(())
}

/// The records of the deaths of the run in `directory`.
fn deaths(directory: &Path) -> Vec<Value> {
    let text = fs::read_to_string(directory.join(DEATHS)).unwrap_or_default();
    let lines = text.lines().map(serde_json::from_str);
    lines.filter_map(Result::ok).collect()
}

/// Allowed pose error at the end beyond that of the undisturbed run, metres. Each signal may cost one wheel count of travel.
/// Besides, a run that was hit takes another path, so its wheels are read at other fractions of a count: one count between the
/// wheels turns the heading by `count / track`, which displaces the robot by that fraction of the distance to the target. Slip
/// differs in each run, too: by three standard deviations of the robot's stated pose error, because a hundred missions include a
/// few beyond two.
fn pose_allowance_m(mission: &Mission, kills: u32, summary: &Summary) -> f64 {
    let body = mission.body();
    let target = mission.start_pose().position.distance(mission.target);
    let slips = mission.simulation.physics().wheels.slip_noise > 0.0;
    let slip_m = if slips { 1.5 * summary.pose_within_m.unwrap_or_default() } else { 0.0 };
    body.metres_per_count() * (f64::from(kills) + target / body.track_m) + slip_m
}

/// Start a robot that does not end with its supervisor.
pub fn robot(
    options: &Options,
    seed: u64,
    directory: &Path,
    ignores_time: bool,
) -> Result<Simulator> {
    fs::create_dir(directory).or_cannot("make a directory")?;
    let mut mission = Mission { seed, ..options.loaded.clone() };
    mission.simulation.ignores_time |= ignores_time;
    Ok(Simulator::start(firsthand(&[]), directory, &mission, options.asked.pace, None)?)
}

/// Read the standard output to the end in a thread, because a long summary would fill the pipe.
pub fn read_stdout(child: &mut Process) -> JoinHandle<Vec<u8>> {
    let stdout = child.take_stdout();
    std::thread::spawn(move || {
        let mut text = Vec::new();
        if let Some(mut stdout) = stdout {
            let _ = std::io::Read::read_to_end(&mut stdout, &mut text);
        }
        text
    })
}
