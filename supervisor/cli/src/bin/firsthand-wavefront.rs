//! The planner stage as the shortest path over the map, to compare with: `planner.executable = "firsthand-wavefront"`.

use std::{io, process::ExitCode};

use evaluation::baselines::{shell::Shell, wavefront::Wavefront};

fn main() -> ExitCode {
    let log = tracing_subscriber::fmt().with_ansi(false);
    log.with_writer(io::stderr).init();
    common::shell::main::<Shell<Wavefront>>()
}
