//! `firsthand bench chaos`: random signals to stages at random times, as a test of the supervisor
//! through real processes; and faults of robots, each mission in one process.
//!
//! Each mission runs twice with one seed: undisturbed in one process, then attacked. It must reach
//! its target without contact, with about the pose error of the undisturbed run, and leave nothing
//! on the machine.

mod attack;
pub mod consumers;
mod leftovers;
mod mission;
mod options;
mod replays;
mod report;
mod robot_faults;
mod schedule;
mod stop_time_table;

pub use options::Arguments;

use std::{fs, process::ExitCode};

use console::{
    missions,
    output::{print_rows, say, write_stderr},
};

use crate::error::{OrCannot as _, Result};
use report::Series;

/// Exit code after a failed mission or a faulty robot that stopped late.
const NOT_CLEAN: u8 = 8;

pub fn main(arguments: &Arguments) -> Result<ExitCode> {
    Ok(ExitCode::from(if judge(arguments)? { 0 } else { NOT_CLEAN }))
}

/// Prints the result, and returns whether it is clean. Keeps the missions' directory after a
/// failure.
fn judge(arguments: &Arguments) -> Result<bool> {
    if let Some(faults) = &arguments.robot_faults {
        let mission = missions::load(&arguments.mission, &arguments.set)?;
        let table = robot_faults::run(&mission, faults, arguments.seed, arguments.missions)?;
        if let Some(directory) = &arguments.out {
            fs::create_dir_all(directory).or_cannot_file("make", directory)?;
            table.write(&arguments.robot.to_string(), &directory.join("stop_times.csv"))?;
        }
        print_rows(&[&table], arguments.json, table.text())?;
        return Ok(table.is_kept());
    }
    let mut series = Series::new(arguments)?;
    let ran = run(&mut series);
    let Series { directory, report, .. } = series;
    let see = format!("see {}", directory.display());
    ran.map_err(|error| format!("{error}; {see}"))?;
    let is_clean = report.wrong.is_empty() && report.leftovers.is_empty();
    if is_clean {
        fs::remove_dir_all(&directory)?;
    } else {
        say(format_args!("missions failed; {see}"));
    }
    crate::print(&report, arguments.json)?;
    Ok(is_clean)
}

fn run(series: &mut Series) -> Result {
    while !series.is_over() {
        mission::attack(series)?;
        let Series { asked, directory, report, .. } = series;
        let left = leftovers::find(&asked.robot, directory);
        let (signals, missions) = (report.signals, report.missions);
        report.leftovers.extend(left.iter().map(|it| format!("after mission {missions}: {it}")));
        write_stderr(&format!("{signals} of {} signals, {missions} missions\n", asked.kills));
    }
    Ok(())
}
