//! `firsthand bench chaos`: signals to random stages at random times, and the results of the missions: a test of the supervisor through real processes.
//!
//! Each mission is run twice with one seed: undisturbed, then attacked. It must reach its target without touching
//! anything, know its pose about as well as the undisturbed one, and leave nothing on the machine.
//!
//! | module | holds |
//! |---|---|
//! | [`Options`] | the mission that is attacked, and the kinds of attack |
//! | `schedule` | the seeded schedule of signals, and their kinds |
//! | `mission` | one mission, undisturbed and attacked |
//! | `attack` | the attacker of one mission, and its readers on the bus |
//! | [`consumers`] | consumers that are hit and restarted, and end with chaos |
//! | `changes` | targets that change meanwhile |
//! | `replays` | replays of the missions' recordings |
//! | `leftovers` | files and processes that outlived a mission |
//! | `report` | the result of all missions, and the table of signals |
//! | `robot_fault` | THE table of robot faults |
//! | `robot_faults`, `proxy`, `fault_injector` | missions of faulty robots; the proxy before the robot; the changes of its bytes |
//! | `stop_time_table` | how long each moved after its fault |

mod attack;
mod changes;
pub mod consumers;
mod fault_injector;
mod leftovers;
mod mission;
mod options;
mod proxy;
mod replays;
mod report;
mod robot_fault;
mod robot_faults;
mod schedule;
mod stop_time_table;

pub use options::{Arguments, Options};
pub use robot_fault::RobotFault;

use std::{fmt::Display, fs, process::ExitCode, time::Instant};

use console::output::{print_text, write_stderr};
use serde::Serialize;

use crate::error::Result;
use report::Series;

/// The exit code if a mission did not arrive, touched something, lost its pose, aborted a healthy stage, or left something
/// behind; or if a robot with a fault did not come to rest in time.
const NOT_CLEAN: u8 = 8;

/// What a chaos tried, what went wrong, the worst case in words, and the whole result as text.
pub struct Judged {
    pub tried: u64,
    pub lost: u64,
    pub worst: String,
    pub text: String,
}

fn text(result: &(impl Display + Serialize), json: bool) -> Result<String> {
    Ok(if json { serde_json::to_string(result)? + "\n" } else { result.to_string() })
}

pub fn main(arguments: &Arguments) -> Result<ExitCode> {
    let judged = judge(arguments)?;
    print_text(&judged.text)?;
    Ok(ExitCode::from(if judged.lost == 0 { 0 } else { NOT_CLEAN }))
}

/// Run and judge without printing. The missions' directory stays if something went wrong.
pub fn judge(arguments: &Arguments) -> Result<Judged> {
    let options = Options::of(arguments)?;
    let directory = options.directory.display();
    let judged = match arguments.robot_faults {
        Some(_) => robot_faults::run(&options).and_then(|table| table.judged(arguments.json)),
        None => run(&options).and_then(|report| report.judged(arguments.json)),
    };
    match judged {
        Ok(judged) if judged.lost == 0 => {
            fs::remove_dir_all(&options.directory)?;
            Ok(judged)
        }
        Ok(judged) => {
            write_stderr(&format!(
                "firsthand: the files of the missions that went wrong are in {directory}\n"
            ));
            Ok(judged)
        }
        // An empty directory is of no use.
        Err(error) if fs::remove_dir(&options.directory).is_ok() => Err(error),
        Err(error) => Err(format!("{error}; see {directory}").into()),
    }
}

/// Attack missions, one after the other, until enough signals are sent.
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
        report.leftovers.extend(left.iter().map(|what| format!("by mission {missions}: {what}")));
        write_stderr(&format!("{kills} of {} signals, {missions} missions\n", options.asked.kills));
    }
    series.report.took_s = began.elapsed().as_secs_f64();
    Ok(series.report)
}
