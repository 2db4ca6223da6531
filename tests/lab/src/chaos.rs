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

pub use options::{Arguments, Options};

use std::{fs, process::ExitCode, time::Instant};

use console::{
    missions,
    output::{print_rows, write_stderr},
};

use crate::error::{OrCannot as _, Result};
use report::{Report, Series};

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
    let options = Options::of(arguments)?;
    let directory = options.directory.display();
    let report = match run(&options) {
        Ok(report) => report,
        Err(error) if fs::remove_dir(&options.directory).is_ok() => return Err(error),
        Err(error) => return Err(format!("{error}; see {directory}").into()),
    };
    let is_clean = report.wrong.is_empty() && report.leftovers.is_empty();
    if is_clean {
        fs::remove_dir_all(&options.directory)?;
    } else {
        write_stderr(&format!("firsthand: the files of the failed missions are in {directory}\n"));
    }
    print_rows(&[&report], arguments.json, crate::text(&report))?;
    Ok(is_clean)
}

fn run(options: &Options) -> Result<Report> {
    let began = Instant::now();
    let mut series = Series::new(options)?;
    while !series.is_over() {
        mission::attack(&mut series)?;
        let left = leftovers::find(&options.asked.robot, &options.directory);
        let Report { signals, missions, leftovers, .. } = &mut series.report;
        leftovers.extend(left.iter().map(|what| format!("after mission {missions}: {what}")));
        let kills = options.asked.kills;
        write_stderr(&format!("{signals} of {kills} signals, {missions} missions\n"));
    }
    series.report.took_s = began.elapsed().as_secs_f64();
    Ok(series.report)
}
