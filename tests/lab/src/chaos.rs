//! `firsthand bench chaos`: signals to random stages at random times, and the results of the missions: a test of the supervisor through real processes.
//!
//! Each mission is run twice with one seed: undisturbed, then attacked. It must reach its target without touching
//! anything, know its pose about as well as the undisturbed one, and leave nothing on the machine.
//!
//! | module | holds |
//! |---|---|
//! | [`Options`] | the mission that is attacked, and the kinds of attack |
//! | `schedule` | the seeded schedule of signals |
//! | `mission` | one mission, undisturbed and attacked |
//! | `series` | the state that the missions share |
//! | `attack`, `subscriptions` | the attacker of one mission; its readers on the bus |
//! | `kind`, `recovery` | how a process is hit; the recovery until its successor works |
//! | `consumer`, `consumer_process`, `consumers` | consumers that are hit and restarted, and end with chaos |
//! | `changes` | targets that change meanwhile |
//! | `replays` | replays of the missions' recordings |
//! | `leftovers` | files and processes that outlived a mission |
//! | `report` | the result of all missions |
//! | `signals` | the table of signals, THE file format |
//! | `robot_fault` | THE table of robot faults |
//! | `robot_faults`, `proxy`, `fault_injector` | missions of faulty robots; the proxy before the robot; the changes of its bytes |
//! | `stop_time_table` | how long each moved after its fault |

mod attack;
mod changes;
mod consumer;
pub mod consumer_process;
mod consumers;
mod fault_injector;
mod kind;
mod leftovers;
mod mission;
mod options;
mod proxy;
mod recovery;
mod replays;
mod report;
mod robot_fault;
mod robot_faults;
mod schedule;
mod series;
mod signals;
mod stop_time_table;
mod subscriptions;
mod tick_latencies;

pub use options::{Arguments, Options};

use std::{fmt::Display, fs, process::ExitCode, time::Instant};

use console::output::{print, write_stderr};
use serde::Serialize;

use crate::error::Result;
use report::Report;
use series::Series;
use stop_time_table::StopTimeTable;

/// The exit code if a mission did not arrive, touched something, lost its pose, aborted a healthy stage, or left something
/// behind; or if a robot with a fault did not come to rest in time.
const NOT_CLEAN: u8 = 8;

pub fn main(arguments: &Arguments) -> Result<ExitCode> {
    let options = Options::of(arguments)?;
    if arguments.robot_faults.is_some() {
        let kept = |table: &StopTimeTable| [table.is_kept(); 2];
        return finish(&options, robot_faults::run(&options), kept);
    }
    let ended = run(&options);
    if let (Some(out), Ok(_)) = (&arguments.out, &ended) {
        let table = out.join(signals::FILE_NAME);
        write_stderr(&format!("results: {}\n", table.display()));
    }
    finish(&options, ended, |report: &Report| [report.is_right(), report.is_clean()])
}

/// The number of kinds of robot faults.
pub const FAULTS: usize = robot_fault::TABLE.len();

/// What a chaos tried, what went wrong, and the worst case in words.
#[derive(Debug)]
pub struct Judged {
    pub tried: u64,
    pub lost: u64,
    pub worst: String,
}

/// Run and judge without printing. The missions' directory stays if something went wrong.
pub fn judge(arguments: &Arguments) -> Result<Judged> {
    let options = Options::of(arguments)?;
    let judged = match arguments.robot_faults {
        Some(_) => robot_faults::run(&options)?.judged(),
        None => run(&options)?.judged(),
    };
    if judged.lost == 0 {
        fs::remove_dir_all(&options.directory)?;
    }
    Ok(judged)
}

/// Print the result of all missions. Their directory stays if something went wrong. `judge` says of a result whether all missions were
/// right, and whether the command succeeded.
fn finish<R: Display + Serialize>(
    options: &Options,
    ended: Result<R>,
    judge: fn(&R) -> [bool; 2],
) -> Result<ExitCode> {
    let directory = options.directory.display();
    let result = match ended {
        Ok(result) => result,
        // An empty directory is of no use.
        Err(error) if fs::remove_dir(&options.directory).is_ok() => return Err(error),
        Err(error) => return Err(format!("{error}; see {directory}").into()),
    };
    let [right, clean] = judge(&result);
    if right {
        fs::remove_dir_all(&options.directory)?;
    } else {
        write_stderr(&format!(
            "firsthand: the files of the missions that went wrong are in {directory}\n"
        ));
    }
    print(&result, options.asked.json)?;
    Ok(ExitCode::from(if clean { 0 } else { NOT_CLEAN }))
}

/// Attack missions, one after the other, until enough signals are sent.
fn run(options: &Options) -> Result<Report> {
    let began = Instant::now();
    let mut series = Series::new(options)?;
    while !series.is_over() {
        let seed = options.asked.seed + series.report.missions;
        let undisturbed = mission::undisturbed(options, seed)?;
        mission::attack(&mut series, seed, &undisturbed)?;
        let left = leftovers::find(&options.asked.robot, &options.directory);
        let report = &mut series.report;
        report.left_behind(&left);
        let (kills, missions) = (report.signals(), report.missions);
        write_stderr(&format!("{kills} of {} signals, {missions} missions\n", options.asked.kills));
    }
    series.report.took_s = began.elapsed().as_secs_f64();
    Ok(series.report)
}
