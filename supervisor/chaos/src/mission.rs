//! One mission under attack.

use std::{
    fs::{self, File},
    path::Path,
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use common::mission::Mission;
use serde_json::Value;

use super::{
    ChaosError, Options,
    attack::Attack,
    report::{End, Report},
    schedule::Chance,
    system,
};
use supervisor::{
    process::{Process, firsthand},
    simulator::Simulator,
};

/// Nothing that is waited for takes longer; a mission at a wall-clock pace takes half a minute.
pub(super) const PATIENCE: Duration = Duration::from_secs(600);

fn command(options: &Options, seed: u64, pace: &str, out: &Path) -> Result<Command, ChaosError> {
    let mut command = firsthand(&["run", &options.mission, "--json", "--pace", pace]);
    command.args(["--robot", &options.robot.to_string()]);
    command.args(["--seed", &seed.to_string(), "--out"]);
    command.arg(out);
    for setting in &options.set {
        command.args(["--set", setting]);
    }
    ours(command, out)
}

/// The run whose supervisor was hit, once more.
fn resume(directory: &Path) -> Result<Command, ChaosError> {
    let mut command = firsthand(&["run", "--json", "--resume"]);
    command.arg(directory);
    ours(command, directory)
}

/// A run that ends with us, and tells us alone; what it says on the way, and at last should it fall over, beside its
/// directory.
fn ours(mut command: Command, directory: &Path) -> Result<Command, ChaosError> {
    let said = directory.with_extension("stderr");
    let said = File::options().create(true).append(true).open(said);
    let said = said.map_err(system("keep what a mission says"))?;
    command.args(["--parent", &std::process::id().to_string()]);
    command.stdout(Stdio::piped()).stderr(said);
    Ok(command)
}

fn parse(stdout: &[u8]) -> Result<Value, ChaosError> {
    let text = String::from_utf8_lossy(stdout);
    serde_json::from_str(text.trim()).map_err(|_| ChaosError::NoSummary(text.into_owned()))
}

/// The same mission left alone: what there is to compare with.
pub(super) fn undisturbed(options: &Options, seed: u64) -> Result<Value, ChaosError> {
    let directory = options.directory.join("calm");
    let output = command(options, seed, "max", &directory)?
        .output()
        .map_err(system("start a mission"))?;
    fs::remove_dir_all(directory).map_err(system("remove its directory"))?;
    parse(&output.stdout)
}

/// The same mission under attack; what happened goes into `report`. What the mission wrote is kept if it went wrong.
pub(super) fn attack(
    options: &Options,
    seed: u64,
    chance: &mut Chance,
    report: &mut Report,
    calm: &Value,
) -> Result<(), ChaosError> {
    let before = report.kills();
    let place = options.directory.join(format!("seed-{seed}"));
    fs::create_dir(&place).map_err(system("make a directory"))?;
    let directory = place.join("run");
    let mut robot = options
        .supervisor
        .then(|| robot(options, seed, &place.join("robot")))
        .transpose()?;
    let mut start = command(options, seed, &options.pace.to_string(), &directory)?;
    if let Some(robot) = &robot {
        let address = robot.address();
        start.args(["--set", &format!("robot.address='udp://{address}'")]);
    }
    let mut attack = Attack::default();
    let began = Instant::now();
    let summary = loop {
        let summary = one_supervisor(options, start, robot.as_mut(), &mut attack, chance, report)?;
        // A supervisor that was hit leaves no summary, one that was spared by a hair does.
        if !attack.supervisor_is_down() || !summary.is_empty() || began.elapsed() >= PATIENCE {
            break parse(&summary)?;
        }
        start = resume(&directory)?;
    };
    let number = |of: &Value, key: &str| of[key].as_f64().unwrap_or_default();
    let kills = report.kills() - before;
    let mut end = End {
        seed,
        outcome: summary["outcome"].as_str().unwrap_or("lost").to_owned(),
        reason: summary["reason"].as_str().unwrap_or_default().to_owned(),
        collisions: summary["collisions"].as_u64().unwrap_or_default(),
        pose_excess_m: number(&summary, "pose_error_m") - number(calm, "pose_error_m"),
        stopping_time_s: number(&summary, "stopping_time_s"),
        // What a count that was lost may cost, for each of them.
        pose_allowance_m: f64::from(kills) * options.loaded.body().metres_per_count(),
        kills,
    };
    if let Some(mut robot) = robot {
        robot.stop()?;
        let truth = robot.truth();
        let last = truth.last();
        end.collisions = last.map_or(0, |tick| tick.contacts);
        end.stopping_time_s = last.map_or(0.0, |tick| tick.stopping_time_s);
        let error = attack.pose_error(truth).unwrap_or(f64::INFINITY);
        end.pose_excess_m = error - number(calm, "pose_error_m");
    }
    if report.ended(&end) {
        fs::remove_dir_all(&place).map_err(system("remove its directory"))?;
    }
    Ok(())
}

/// A robot that does not die with its supervisor.
fn robot(options: &Options, seed: u64, directory: &Path) -> Result<Simulator, ChaosError> {
    fs::create_dir(directory).map_err(system("make a directory"))?;
    let mission = Mission {
        seed,
        ..options.loaded.clone()
    };
    Ok(Simulator::start(directory, &mission, options.pace)?)
}

/// One life of a supervisor under attack; what it says at its end.
fn one_supervisor(
    options: &Options,
    start: Command,
    robot: Option<&mut Simulator>,
    attack: &mut Attack,
    chance: &mut Chance,
    report: &mut Report,
) -> Result<Vec<u8>, ChaosError> {
    let mut child = Process::spawn(start).map_err(system("start a mission"))?;
    let stdout = child.take_stdout();
    // Read beside, or a long summary could block it.
    let summary = std::thread::spawn(move || {
        let mut text = Vec::new();
        if let Some(mut stdout) = stdout {
            let _ = std::io::Read::read_to_end(&mut stdout, &mut text);
        }
        text
    });
    let attacked = attack.until_the_end(options, &mut child, robot, chance, report);
    child.end(Duration::from_secs(2));
    let summary = summary.join().unwrap_or_default();
    attacked.map(|()| summary)
}
