//! Laboratory: measurements of robots, and planners for comparison. Robots run without it.

// `pub` marks use by another module.
#![allow(unreachable_pub)]

mod background;
mod baselines;
mod both_ways;
mod bring_up;
mod chaos;
mod corpus;
mod error;
mod evaluate;
mod experiments;
mod field;
mod fuzz;
mod missions;
mod robot;
mod ros2_robot;
mod simulate;
mod tick;
mod worlds;

use std::{
    io::Read,
    process::{ExitCode, Termination as _},
};

use clap::{Parser, Subcommand};
use serde::{Serialize, de::DeserializeOwned};

/// Measure robots: missions on many worlds, the paper's experiments, random faults, tick latency,
/// fields.
#[derive(Debug, Parser)]
#[command(name = "firsthand-lab", bin_name = "firsthand", version)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Evaluate(evaluate::Arguments),
    Experiments(experiments::Arguments),
    Field(field::Arguments),
    Fuzz(fuzz::Arguments),
    Simulate(simulate::Arguments),
    BothWays(both_ways::Arguments),
    Corpus(corpus::Arguments),
    /// Measure tick latency; test a robot with random signals and faults.
    #[command(subcommand)]
    Bench(Bench),
    #[command(hide = true)]
    Stage(baselines::process::Arguments),
}

#[derive(Debug, Subcommand)]
enum Bench {
    Tick(tick::Arguments),
    Chaos(Box<chaos::Arguments>),
    BringUp(bring_up::Arguments),
    Consumer(chaos::consumers::Arguments),
    Ros2Robot(ros2_robot::Arguments),
}

fn rows<T: DeserializeOwned>(table: impl Read) -> csv::Result<Vec<T>> {
    csv::Reader::from_reader(table).into_deserialize().collect()
}

fn text(report: &impl Serialize) -> String {
    toml::to_string(report).unwrap_or_else(|error| error.to_string())
}

fn print(report: &impl Serialize, json: bool) -> error::Result {
    let text = if json { serde_json::to_string(report)? } else { text(report) };
    console::output::print_line(text)
}

pub fn main() -> ExitCode {
    console::executable::run("error,rustdds=off", execute)
}

fn execute(arguments: &Arguments) -> error::Result<ExitCode> {
    let done = match &arguments.command {
        Command::Evaluate(arguments) => evaluate::main(arguments),
        Command::Experiments(arguments) => experiments::main(arguments),
        Command::Fuzz(arguments) => fuzz::main(arguments),
        Command::Simulate(arguments) => return simulate::main(arguments),
        Command::BothWays(arguments) => return both_ways::main(arguments),
        Command::Corpus(arguments) => corpus::main(arguments),
        Command::Field(arguments) => field::main(arguments),
        Command::Stage(arguments) => baselines::process::main(arguments),
        Command::Bench(bench) => match bench {
            Bench::Tick(arguments) => tick::main(arguments),
            Bench::Chaos(arguments) => return chaos::main(arguments),
            Bench::BringUp(arguments) => bring_up::main(arguments),
            Bench::Consumer(arguments) => chaos::consumers::main(arguments),
            Bench::Ros2Robot(arguments) => ros2_robot::main(arguments),
        },
    };
    Ok(done?.report())
}
