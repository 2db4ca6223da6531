//! The one executable: a robot's supervisor, its stages, the simulated robot, and the tools around them.
//!
//! | module | holds |
//! |---|---|
//! | [`stages`] | THE table of stages |
//! | [`policy`] | what to do with one stage, pure |
//! | [`flow`] | whether each stage answers what it reads, pure |
//! | [`death`] | the record of a death |
//! | [`stall`] | what to do when the robot does not get on, pure, and the record of it |
//! | [`kept`] | what of a supervisor outlives it |
//! | [`process`], [`fleet`] | child processes; the stages under their policies |
//! | [`domain`], [`tenants`] | the robot's corner of the machine, held and wiped; who lives in it |
//! | [`simulator`] | the simulated robot as a child |
//! | [`observer`] | what is heard on the bus |
//! | [`supervisor`] | the loop |
//! | [`service`], [`logging`] | systemd told how it goes; logs where they are looked for |
//! | [`report`], [`picture`] | how a run ended |
//! | [`chaos`] | random deaths, for users who doubt |
//! | [`relay`] | bare hops, for comparison |
//! | [`maps`] | maps as others keep them |
//! | [`cli`] | the command line |

mod chaos;
mod cli;
mod death;
mod domain;
mod fleet;
mod flow;
mod kept;
mod logging;
mod maps;
mod observer;
mod picture;
mod policy;
mod process;
mod relay;
mod report;
mod service;
mod simulator;
mod stages;
mod stall;
mod supervisor;
mod tenants;

fn main() -> std::process::ExitCode {
    cli::main()
}
