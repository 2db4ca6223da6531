// Included by crates whose executable Cargo must build beside `firsthand` for the system tests.

use std::process::Command;

#[test]
fn the_executable_answers() {
    let executable = env!(concat!("CARGO_BIN_EXE_", env!("CARGO_PKG_NAME")));
    let output = Command::new(executable).arg("--version").output().unwrap();
    assert!(output.status.success() && output.stdout.starts_with(b"firsthand"), "{output:?}");
}
