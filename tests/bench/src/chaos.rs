//! Signals to random stages at random times, and what became of the missions: a test of the supervisor through real
//! processes.
//!
//! Each mission is run twice with one seed: undisturbed, then attacked. It must reach its target without touching
//! anything, know its pose about as well as the undisturbed one, and leave nothing on the machine.
//!
//! | module | holds |
//! |---|---|
//! | [`Options`] | what is attacked, and how |
//! | `schedule` | which stage gets which signal when, seeded |
//! | `mission` | one mission, undisturbed and attacked |
//! | `series` | what the missions have in common |
//! | `attack`, `subscriptions` | the attacker of one mission; what it reads from the bus |
//! | `kind`, `recovery` | how a process is hit; one that was, until its successor works |
//! | [`Consumer`], `consumers`, `terminal`, `words` | consumers that are hit, and started again; a terminal for one that draws; a user's command |
//! | `replays` | the missions' recordings, replayed |
//! | `resources`, `leftovers` | what a process holds; what outlived a mission |
//! | [`Report`] | the result of all missions |
//! | [`signals`] | the table of signals, THE file format |
//! | [`robot_fault`] | THE table of the ways in which a robot lies to its link |
//! | `robot_faults`, `proxy`, `fault_injector` | missions of such robots; the wire, and what becomes of the bytes on it |
//! | [`StopTimeTable`] | how long each moved after that |

mod attack;
mod consumer;
mod consumers;
mod error;
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
mod words;

pub use consumer::{Consumer, ConsumerError, GivenConsumer, SUBCOMMAND};
pub use error::ChaosError;
pub use options::Options;
pub use report::Report;
pub use robot_faults::{FaultOptions, check, run_robot_faults};
pub use stop_time_table::{Entry, StopTimeTable};

use series::Series;

/// Attack missions, one after the other, until enough signals were sent. `show` is called after each.
pub fn run(options: &Options, show: &mut dyn FnMut(&Report)) -> Result<Report, ChaosError> {
    let mut series = Series::new(options)?;
    while !series.is_over() {
        let seed = options.seed + series.report.missions();
        let undisturbed = mission::undisturbed(options, seed)?;
        mission::attack(&mut series, seed, &undisturbed)?;
        let left = leftovers::find(&options.robot, &options.directory);
        series.report.left_behind(left);
        show(&series.report);
    }
    series.report.end();
    Ok(series.report)
}
