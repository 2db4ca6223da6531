//! `firsthand bench chaos`: random signals to stages at random times, as a test of the supervisor
//! through real processes; and faults of robots, each mission in one process.
//!
//! Each attacked mission runs twice with one seed: undisturbed, then attacked. It must reach its
//! target without contact, with about the pose error of the undisturbed run, and leave nothing on
//! the machine.

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
    output::{print_text, write_stderr},
};
use serde::Serialize;

use crate::error::{OrCannot as _, Result};
use report::Series;

/// Exit code after a failed mission or a faulty robot that stopped late.
const NOT_CLEAN: u8 = 8;

struct Judged {
    lost: u64,
    text: String,
}

fn text(result: &impl Serialize, json: bool, plain: String) -> Result<String> {
    Ok(if json { serde_json::to_string(result)? + "\n" } else { plain })
}

pub fn main(arguments: &Arguments) -> Result<ExitCode> {
    let judged = judge(arguments)?;
    print_text(&judged.text)?;
    Ok(ExitCode::from(if judged.lost == 0 { 0 } else { NOT_CLEAN }))
}

/// Keeps the missions' directory after a failure.
fn judge(arguments: &Arguments) -> Result<Judged> {
    if let Some(faults) = &arguments.robot_faults {
        let mission = missions::load(&arguments.mission, &arguments.set)?;
        let table = robot_faults::run(&mission, faults, arguments.seed, arguments.missions)?;
        if let Some(directory) = &arguments.out {
            fs::create_dir_all(directory).or_cannot_file("make", directory)?;
            table.write(&arguments.robot.to_string(), &directory.join("stop_times.csv"))?;
        }
        return table.judged(arguments.json);
    }
    let options = Options::of(arguments)?;
    let directory = options.directory.display();
    match run(&options).and_then(|report| report.judged(arguments.json)) {
        Ok(judged) if judged.lost == 0 => {
            fs::remove_dir_all(&options.directory)?;
            Ok(judged)
        }
        Ok(judged) => {
            write_stderr(&format!(
                "firsthand: the files of the failed missions are in {directory}\n"
            ));
            Ok(judged)
        }
        Err(error) if fs::remove_dir(&options.directory).is_ok() => Err(error),
        Err(error) => Err(format!("{error}; see {directory}").into()),
    }
}

fn run(options: &Options) -> Result<report::Report> {
    let began = Instant::now();
    let mut series = Series::new(options)?;
    while !series.is_over() {
        let seed = options.asked.seed + series.report.missions;
        let undisturbed = mission::undisturbed(options, seed)?;
        mission::attack(&mut series, seed, &undisturbed)?;
        let left = leftovers::find(&options.asked.robot, &options.directory);
        let report = &mut series.report;
        let (kills, missions) = (report.signals, report.missions);
        report
            .leftovers
            .extend(left.iter().map(|what| format!("after mission {missions}: {what}")));
        write_stderr(&format!("{kills} of {} signals, {missions} missions\n", options.asked.kills));
    }
    series.report.took_s = began.elapsed().as_secs_f64();
    Ok(series.report)
}
