//! Makes Cargo build the executable beside `firsthand` for the system tests.

use std::process::Command;

#[test]
fn the_executable_answers() {
    let output =
        Command::new(env!("CARGO_BIN_EXE_firsthand-top")).arg("--version").output().unwrap();
    assert!(output.status.success() && output.stdout.starts_with(b"firsthand"), "{output:?}");
}
