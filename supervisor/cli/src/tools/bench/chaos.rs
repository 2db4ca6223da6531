//! `firsthand bench chaos`: signals to random stages at random times, and what became of the missions.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use bench::chaos::{
    self, Consumer, FaultOptions, GivenConsumer, Options,
    robot_fault::{RobotFault, TABLE},
    signals,
};
use clap::Args;
use common::{clock::Pace, domain::RobotName, mission::Mission};

use crate::console::{
    failure::Failure,
    missions,
    output::{print, write_stderr},
};

/// Send random signals to random stages at random times, mission after mission, and report.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// A shipped mission or a mission file.
    #[arg(default_value = "obstacle-course")]
    mission: String,
    /// Number of signals; after the last one the mission goes on to its end.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..))]
    kills: u32,
    /// Seed of the schedule; the missions' own seeds count up from it.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Hit some successors again within their first 12 ms: about a fifth of all signals.
    #[arg(long)]
    include_startup: bool,
    /// Hit the supervisor too, one in twenty signals, and go on with its run each time. The robot is then a process
    /// of its own, and mission time is wall-clock.
    #[arg(long, conflicts_with = "pace")]
    include_supervisor: bool,
    /// Kill and freeze consumers too, one in two signals: the run's own recorder, another one, `top` (without terminals
    /// `hz`) and `logs -f`.
    #[arg(long, conflicts_with = "robot_faults")]
    include_consumers: bool,
    /// Kill and freeze a consumer of yours: a program and its arguments, without a shell. As often as needed.
    #[arg(long, value_name = "COMMAND", conflicts_with = "robot_faults")]
    consumer: Vec<GivenConsumer>,
    /// Hit consumers only, and compare ticks with those of the same missions without any.
    #[arg(long, conflicts_with_all = ["include_startup", "include_supervisor", "freeze_all"])]
    only_consumers: bool,
    /// Freeze supervisor and stages together too, for 0.3 to 1.5 s, one in two signals, as if the machine stood still.
    #[arg(long)]
    freeze_all: bool,
    /// Record the missions, and replay every generation of every stage, which must be equal to the bit.
    #[arg(long)]
    replay: bool,
    /// Mission time, R times wall-clock.
    #[arg(long, default_value = "4")]
    pace: Pace,
    /// Set a key of the mission, as often as needed.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Write a row for each signal to DIR/signals.csv.
    #[arg(long, value_name = "DIR", conflicts_with = "robot_faults")]
    out: Option<PathBuf>,
    /// Name of the robot, which also names its shared memory.
    #[arg(long, default_value = "chaos")]
    robot: RobotName,
    /// Instead of signals, put a fault into the robot's frames from a random moment on, mission after mission: all faults, or
    /// those named. The stop-time table at the end has the time from each fault to the last moving command and to wheels at rest.
    #[arg(
        long, value_name = "FAULT,...", num_args = 0..=1, require_equals = true, default_missing_value = "all",
        value_parser = parse_faults, conflicts_with_all = ["kills", "include_startup", "include_supervisor", "pace"]
    )]
    robot_faults: Option<Faults>,
    /// Missions for each fault.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..), requires = "robot_faults")]
    missions: u32,
    /// One line of JSON.
    #[arg(long)]
    json: bool,
}

/// Faults of the robot.
#[derive(Clone, Debug)]
struct Faults(Vec<RobotFault>);

fn parse_faults(names: &str) -> Result<Faults, String> {
    if names == "all" {
        return Ok(Faults(TABLE.iter().map(|row| row.fault).collect()));
    }
    let named = |name: &str| {
        RobotFault::named(name).ok_or_else(|| {
            let all: Vec<_> = TABLE.iter().map(|row| row.name).collect();
            format!("no robot fault {name:?}; give some of {}", all.join(", "))
        })
    };
    names.split(',').map(named).collect::<Result<_, _>>().map(Faults)
}

/// The exit code if a mission did not arrive, touched something, lost its pose, aborted a healthy stage, or left something
/// behind; or if a robot with a fault did not come to rest in time.
const NOT_CLEAN: u8 = 8;

/// Ten times the timeout of a mission.
const LONG_TIMEOUT: &str = "timeout_s=1800";

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let mut set = arguments.set.clone();
    if arguments.freeze_all {
        // The robot's clock goes on while its processes are frozen. A --set of the user comes later and wins.
        set.insert(0, LONG_TIMEOUT.to_owned());
    }
    // Errors in the mission are reported before anything starts.
    let loaded = missions::load(&arguments.mission, &set)?;
    if let Some(Faults(faults)) = &arguments.robot_faults {
        return robot_faults(arguments, loaded, set, faults.clone());
    }
    if arguments.include_supervisor && loaded.robot.address.is_some() {
        return Err("chaos brings its own robot; leave robot.address out".into());
    }
    if arguments.only_consumers && !arguments.include_consumers && arguments.consumer.is_empty() {
        return Err("--only-consumers hits nothing; give --include-consumers, or --consumer and your command, too".into());
    }
    if arguments.pace == Pace::Max {
        return Err("chaos needs a wall clock; give --pace R, 4 for four times as fast".into());
    }
    let pace = if arguments.include_supervisor { Pace::Rate(1.0) } else { arguments.pace };
    let options = options(arguments, loaded, set, pace)?;
    let directory = options.directory.clone();
    let ended = chaos::run(&options, &mut |report| {
        let (kills, missions) = (report.signals(), report.missions());
        write_stderr(&format!("{kills} of {} signals, {missions} missions\n", options.kills));
    });
    let report = match ended {
        Ok(report) => report,
        Err(error) => {
            // An empty directory is of no use.
            return Err(match std::fs::remove_dir(&directory) {
                Ok(()) => error.into(),
                Err(_) => format!("{error}; see {}", directory.display()).into(),
            });
        }
    };
    if let Some(out) = &arguments.out {
        let table = out.join(signals::FILE_NAME);
        write_stderr(&format!("results: {}\n", table.display()));
    }
    remove_unless_wrong(report.is_right(), &directory)?;
    print(&report, arguments.json)?;
    Ok(ExitCode::from(if report.is_clean() { 0 } else { NOT_CLEAN }))
}

/// Remove the `directory` of missions if all were `right`, or else tell where it is.
fn remove_unless_wrong(right: bool, directory: &Path) -> std::io::Result<()> {
    if right {
        return std::fs::remove_dir_all(directory);
    }
    let directory = directory.display();
    write_stderr(&format!(
        "firsthand: the files of the missions that went wrong are in {directory}\n"
    ));
    Ok(())
}

/// The options of the missions, which run in a new directory.
fn options(
    arguments: &Arguments,
    loaded: Mission,
    set: Vec<String>,
    pace: Pace,
) -> Result<Options, Failure> {
    let directory = std::env::temp_dir().join(format!("firsthand-chaos-{}", std::process::id()));
    std::fs::create_dir(&directory)
        .map_err(|error| format!("cannot make {}: {error}", directory.display()))?;
    let given = arguments.consumer.iter().cloned().map(Consumer::Given);
    let own = arguments.include_consumers.then(Consumer::own);
    Ok(Options {
        mission: arguments.mission.clone(),
        loaded,
        set,
        robot: arguments.robot.clone(),
        pace,
        supervisor: arguments.include_supervisor,
        kills: arguments.kills,
        seed: arguments.seed,
        startup: arguments.include_startup,
        freeze_all: arguments.freeze_all,
        replay: arguments.replay,
        consumers: own.into_iter().flatten().chain(given).collect(),
        only_consumers: arguments.only_consumers,
        out: arguments.out.clone(),
        directory,
    })
}

fn robot_faults(
    arguments: &Arguments,
    loaded: Mission,
    set: Vec<String>,
    faults: Vec<RobotFault>,
) -> Result<ExitCode, Failure> {
    chaos::check(&loaded)?;
    let options = FaultOptions {
        base: options(arguments, loaded, set, Pace::Rate(1.0))?,
        faults,
        missions: arguments.missions,
    };
    let directory = options.base.directory.clone();
    let of = options.faults.len() as u64 * u64::from(options.missions);
    let ended = chaos::run_robot_faults(&options, &mut |table| {
        write_stderr(&format!("{} of {of} missions\n", table.entries.len()));
    });
    let table = ended.map_err(|error| format!("{error}; see {}", directory.display()))?;
    remove_unless_wrong(table.is_kept(), &directory)?;
    print(&table, arguments.json)?;
    Ok(ExitCode::from(if table.is_kept() { 0 } else { NOT_CLEAN }))
}
