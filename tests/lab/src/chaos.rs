//! Signals to random stages at random times, and the results of the missions: a test of the supervisor through real processes.
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
//! | `consumer`, `consumers`, `terminal` | consumers that are hit and restarted; a terminal for one that draws |
//! | `changes` | targets that change meanwhile |
//! | `replays` | replays of the missions' recordings |
//! | `resources`, `leftovers` | resources of a process; files and processes that outlived a mission |
//! | [`Report`] | the result of all missions |
//! | [`signals`] | the table of signals, THE file format |
//! | [`robot_fault`] | THE table of robot faults |
//! | `robot_faults`, `proxy`, `fault_injector` | missions of faulty robots; the proxy before the robot; the changes of its bytes |
//! | [`StopTimeTable`] | how long each moved after its fault |

mod attack;
mod changes;
pub(crate) mod command;
mod consumer;
pub(crate) mod consumer_process;
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
mod resources;
pub mod robot_fault;
mod robot_faults;
mod schedule;
mod series;
pub mod signals;
mod stop_time_table;
mod subscriptions;
mod terminal;
mod tick_latencies;

pub use options::{Arguments, Faults, Options};
pub use report::Report;
pub use robot_faults::{FaultOptions, check, run_robot_faults};
pub use stop_time_table::{Entry, StopTimeTable};

use std::time::Instant;

use crate::error::BenchError;
use series::Series;

/// Attack missions, one after the other, until enough signals are sent. `show` is called after each.
pub fn run(options: &Options, show: &mut dyn FnMut(&Report)) -> Result<Report, BenchError> {
    let began = Instant::now();
    let mut series = Series::new(options)?;
    while !series.is_over() {
        let seed = options.asked.seed + series.report.missions();
        let undisturbed = mission::undisturbed(options, seed)?;
        mission::attack(&mut series, seed, &undisturbed)?;
        let left = leftovers::find(&options.asked.robot, &options.directory);
        series.report.left_behind(left);
        show(&series.report);
    }
    series.report.took_s = began.elapsed().as_secs_f64();
    Ok(series.report)
}
