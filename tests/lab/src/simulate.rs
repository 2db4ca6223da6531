//! `simulate`: runs of the whole robot in one process, each from one seed.

use std::{
    process::ExitCode,
    time::{Instant, SystemTime},
};

use clap::Args;
use common::VERSION;
use console::{missions, output::print_line};
use simulation::{Broken, Scenario};

use crate::error::Result;

/// Simulate runs in one process, with faults drawn from a seed, and check invariants after every
/// event.
#[derive(Debug, Args)]
pub struct Arguments {
    /// A shipped mission or a mission file.
    #[arg(default_value = "obstacle-course")]
    mission: String,
    /// Number of seeds.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    count: u64,
    /// First seed; each run takes the next one. Without it the clock draws one.
    #[arg(long)]
    seed: Option<u64>,
    /// Remove disturbances while the same invariant breaks.
    #[arg(long)]
    shrink: bool,
    /// Print the disturbances and the result of each run.
    #[arg(long)]
    verbose: bool,
    /// Run the mission in lockstep without any disturbance.
    #[arg(long)]
    undisturbed: bool,
    /// Set a mission key; repeatable.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

pub fn main(arguments: &Arguments) -> Result<ExitCode> {
    let mission = missions::load(&arguments.mission, &arguments.set)?;
    let first = arguments.seed.unwrap_or_else(|| {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        now.map_or(0, |since| since.as_nanos() as u64)
    });
    let began = Instant::now();
    let mut failures = 0_u64;
    let (mut events, mut simulated_s, mut supervisors) = (0, 0.0, 0);
    for seed in (0..arguments.count).map(|nth| first.wrapping_add(nth)) {
        let scenario = match arguments.undisturbed {
            true => Scenario::lockstep(&mission),
            false => Scenario::draw(&mission, seed),
        };
        let ran = scenario.run();
        events += ran.events;
        simulated_s += ran.simulated.as_secs_f64();
        supervisors += ran.supervisors - 1;
        if arguments.verbose {
            show(&scenario)?;
            let outcome = ran.finished.as_ref().map(|finished| &finished.ending);
            print_line(format!("seed {seed:#x}: {outcome:?} after {} events", ran.events))?;
        }
        if let Some(broken) = ran.broken {
            failures += 1;
            report(&scenario, &broken, arguments)?;
        }
    }
    print_line(format!(
        "{} runs from seed {first:#x}: {failures} broke an invariant; {events} events in {simulated_s:.0} s of mission, {supervisors} supervisors killed, {:.1} s",
        arguments.count,
        began.elapsed().as_secs_f64()
    ))?;
    Ok(if failures == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn show(scenario: &Scenario) -> Result {
    print_line(format!("load {:?}", scenario.load))?;
    for disturbance in &scenario.disturbances {
        print_line(disturbance.to_string())?;
    }
    Ok(())
}

fn report(scenario: &Scenario, broken: &Broken, arguments: &Arguments) -> Result {
    print_line(format!("simulation: seed {:#x} at {VERSION}: {broken}", scenario.seed))?;
    if arguments.shrink {
        show(&scenario.shrink(broken))?;
    }
    Ok(())
}
