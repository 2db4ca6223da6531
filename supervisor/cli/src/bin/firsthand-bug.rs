//! The planner stage as Bug2, to compare with: `planner.executable = "firsthand-bug"`.

use std::{io, process::ExitCode};

use evaluation::baselines::{bug::Bug, shell::Shell};

fn main() -> ExitCode {
    let log = tracing_subscriber::fmt().with_ansi(false);
    log.with_writer(io::stderr).init();
    common::shell::main::<Shell<Bug>>()
}
