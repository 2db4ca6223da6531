//! `firsthand bench chaos`: signals to random stages at random times, and the results of the missions.

use std::{path::Path, process::ExitCode};

use crate::chaos::{
    self, Arguments, FaultOptions, Faults, Options, robot_fault::RobotFault, signals,
};
use common::{clock::Pace, mission::Mission};

use console::{
    failure::Failure,
    missions,
    output::{print, write_stderr},
};

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
        write_stderr(&format!("{kills} of {} signals, {missions} missions\n", arguments.kills));
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

/// Remove the `directory` of missions if all were `right`, or else print its path.
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
    Ok(Options { asked: arguments.clone(), loaded, set, pace, directory })
}

fn robot_faults(
    arguments: &Arguments,
    loaded: Mission,
    set: Vec<String>,
    faults: Vec<RobotFault>,
) -> Result<ExitCode, Failure> {
    chaos::check(&loaded)?;
    let protocol = loaded.robot.protocol();
    let (faults, left_out): (Vec<_>, Vec<_>) =
        faults.into_iter().partition(|fault| fault.has_meaning(protocol));
    if !left_out.is_empty() {
        let names: Vec<_> = left_out.iter().map(|fault| fault.row().name).collect();
        let left_out = format!("no faults of this robot's protocol: {}", names.join(", "));
        if faults.is_empty() {
            return Err(left_out.into());
        }
        write_stderr(&format!("left out, {left_out}\n"));
    }
    let options = FaultOptions { base: options(arguments, loaded, set, Pace::Rate(1.0))?, faults };
    let directory = options.base.directory.clone();
    let of = options.faults.len() as u64 * u64::from(arguments.missions);
    let ended = chaos::run_robot_faults(&options, &mut |table| {
        write_stderr(&format!("{} of {of} missions\n", table.entries.len()));
    });
    let table = ended.map_err(|error| format!("{error}; see {}", directory.display()))?;
    remove_unless_wrong(table.is_kept(), &directory)?;
    print(&table, arguments.json)?;
    Ok(ExitCode::from(if table.is_kept() { 0 } else { NOT_CLEAN }))
}
