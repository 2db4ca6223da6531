//! Cargo builds the executable for this test, so that the system tests find it beside `firsthand`.

use std::process::Command;

#[test]
fn the_executable_answers() {
    let output =
        Command::new(env!("CARGO_BIN_EXE_firsthand-remote")).arg("--version").output().unwrap();
    assert!(output.status.success() && output.stdout.starts_with(b"firsthand"), "{output:?}");
}
