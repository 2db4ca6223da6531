//! `firsthand bench`: random faults and measurements.

mod chaos;
mod consumer;
mod sources;
mod tick;

use std::process::ExitCode;

use clap::{Args, Subcommand};

use crate::field;
use console::failure::Failure;

/// Measure ticks and fields; send random signals to a robot's processes; publish fixes of a simulated robot.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Tick(tick::Arguments),
    Field(field::Arguments),
    Chaos(Box<chaos::Arguments>),
    Consumer(consumer::Arguments),
    Sources(sources::Arguments),
}

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    match &arguments.command {
        Command::Tick(arguments) => tick::main(arguments).map(|()| ExitCode::SUCCESS),
        Command::Field(arguments) => field::main(arguments).map(|()| ExitCode::SUCCESS),
        Command::Chaos(arguments) => chaos::main(arguments),
        Command::Sources(arguments) => sources::main(arguments).map(|()| ExitCode::SUCCESS),
        Command::Consumer(arguments) => consumer::main(arguments),
    }
}
