//! Main function of viewers and the laboratory.

use std::process::{ExitCode, Termination};

use clap::Parser;

use crate::{
    completion,
    failure::{self, Result},
    logging,
};

/// Answers a completion request, or logs to standard error from `log_level` up and calls `execute`.
pub fn run<A: Parser, T: Termination>(log_level: &str, execute: fn(&A) -> Result<T>) -> ExitCode {
    completion::answer_shell(A::command, Vec::new);
    let arguments = A::parse();
    logging::to_stderr(log_level);
    failure::report(execute(&arguments).map(Termination::report))
}
