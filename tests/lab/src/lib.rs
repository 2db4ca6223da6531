//! The laboratory: what measures robots. It is a consumer like any other, starts `firsthand` from beside itself, and contains the
//! planners to compare with. No robot contains it.
//!
//! | module | holds |
//! |---|---|
//! | [`missions`] | missions on many worlds, judged by the ground truth |
//! | [`worlds`] | worlds, drawn from a seed or read from files |
//! | `evaluate` | the command that compares settings on worlds |
//! | `experiments` | the paper's experiments with many seeds |
//! | [`baselines`] | planners to compare with: shortest paths, Bug2 |
//! | [`chaos`] | signals to random processes at random times; faults of the robot |
//! | [`tick`] | the latency of a tick, compared with five bare hops on the bus |
//! | `certify` | the certificate: what was tried, what was lost, and bounds |
//! | `bring_up` | bring-ups of robots with faults of assembly |
//! | [`sources`] | simulated sources of fixes and turns |
//! | `field` | the field of a map |
//! | `background` | threads beside a measurement |
//! | `random` | random numbers |
//! | `robot` | the executable `firsthand`, its runs, and simulated robots |
//! | `ros2_robot` | a simulated robot as one of ROS 2 |
//! | `error` | why a bench ended early |

// No other crate uses these modules: `pub` means another module; what none uses is reported.
#![allow(unreachable_pub)]

mod background;
mod baselines;
mod bring_up;
mod certify;
mod chaos;
mod error;
mod evaluate;
mod experiments;
mod field;
mod missions;
mod random;
mod robot;
mod ros2_robot;
mod sources;
mod tick;
mod worlds;

use std::process::{ExitCode, Termination as _};

use clap::{Parser, Subcommand};
use serde::Serialize;

/// Measure robots: missions on many worlds, the paper's experiments, random faults, ticks, fields.
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
    Certify(certify::Arguments),
    /// Measure ticks and fields; send random signals to a robot's processes; publish fixes of a simulated robot.
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
    Sources(sources::Arguments),
}

/// The keys and values of a report's JSON as TOML, for people.
fn text(report: &impl Serialize) -> String {
    toml::to_string(report).unwrap_or_else(|error| error.to_string())
}

fn print(report: &impl Serialize, json: bool) -> error::Result {
    let text = if json { serde_json::to_string(report)? } else { text(report) };
    Ok(console::output::print_text(&format!("{text}\n"))?)
}

pub fn main() -> ExitCode {
    console::executable::run("error,rustdds=off", execute)
}

fn execute(arguments: &Arguments) -> error::Result<ExitCode> {
    let done = match &arguments.command {
        Command::Evaluate(arguments) => evaluate::main(arguments),
        Command::Experiments(arguments) => experiments::main(arguments),
        Command::Certify(arguments) => certify::main(arguments),
        Command::Field(arguments) => field::main(arguments),
        Command::Stage(arguments) => baselines::process::main(arguments),
        Command::Bench(Bench::Tick(arguments)) => tick::main(arguments),
        Command::Bench(Bench::Chaos(arguments)) => return chaos::main(arguments),
        Command::Bench(Bench::BringUp(arguments)) => bring_up::main(arguments),
        Command::Bench(Bench::Consumer(arguments)) => chaos::consumers::main(arguments),
        Command::Bench(Bench::Ros2Robot(arguments)) => ros2_robot::main(arguments),
        Command::Bench(Bench::Sources(arguments)) => sources::main(arguments),
    };
    Ok(done?.report())
}
