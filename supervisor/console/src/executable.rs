//! The main function of an executable beside `firsthand`: a viewer, or the laboratory.

use std::{error::Error, process::ExitCode};

use clap::Parser;

use crate::{
    completion,
    failure::{self, Failure},
    logging,
};

/// Answer a shell that asks for completions; or parse the command line, log to standard error from `log_level` on, and `execute`.
/// An error is reported with its code, or with that which `own_code` knows of errors that only this executable has.
pub fn run<A: Parser>(
    log_level: &str,
    execute: fn(&A) -> Result<ExitCode, Failure>,
    own_code: fn(&(dyn Error + 'static)) -> Option<&'static str>,
) -> ExitCode {
    completion::answer_shell(A::command, Vec::new);
    let arguments = A::parse();
    logging::to_stderr(log_level);
    failure::report(execute(&arguments), own_code)
}
