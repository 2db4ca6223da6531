//! Commands of the real executable, and their output.

use std::process::{Child, Command, Output, Stdio};

use common::domain::SUITE_VARIABLE;
use serde_json::Value;

use super::{robot::suite, run::assert_reached};

/// Returns a command that gets SIGKILL when the thread that starts it ends.
pub fn with_parent(line: &[&str]) -> Command {
    let mut command = Command::new("setpriv");
    command.args(["--pdeathsig", "KILL", "--"]).args(line).env(SUITE_VARIABLE, suite());
    command
}

pub fn firsthand(arguments: &[&str]) -> Command {
    firsthand_under(&[], arguments)
}

/// Returns a command that runs `firsthand` through the command line `wrapper`.
pub fn firsthand_under(wrapper: &[&str], arguments: &[&str]) -> Command {
    let mut command = with_parent(wrapper);
    command.arg(env!("CARGO_BIN_EXE_firsthand"));
    command.args(arguments).stdin(Stdio::null());
    command
}

pub fn start_quietly(command: &mut Command) -> Child {
    let quiet = command.stdout(Stdio::null()).stderr(Stdio::null());
    quiet.spawn().unwrap()
}

/// Starts a command whose output is read while it runs.
pub fn start_piped(command: &mut Command) -> Child {
    command.stdout(Stdio::piped()).spawn().unwrap()
}

/// Ends a process with SIGKILL.
pub fn kill(child: &mut Child) {
    child.kill().unwrap();
    child.wait().unwrap();
}

pub fn output(arguments: &[&str]) -> Output {
    firsthand(arguments).output().unwrap()
}

/// Returns the output of `firsthand`, which must succeed.
pub fn printed(arguments: &[&str]) -> String {
    let output = output(arguments);
    assert!(output.status.success(), "{arguments:?}: {output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// Returns a command's exit code and its JSON lines.
pub fn json_of(output: &Output) -> (Option<i32>, Vec<Value>) {
    (output.status.code(), json_lines(&String::from_utf8_lossy(&output.stdout)))
}

#[track_caller]
pub fn json_lines(text: &str) -> Vec<Value> {
    let line = |line| serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {text}"));
    text.lines().map(line).collect()
}

/// Returns the words of a command line, none of which contains a blank.
pub fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// Asserts the success of a command line.
pub fn operate(robot: &str, line: &str) {
    printed(&words(&format!("{line} --robot {robot}")));
}

/// Runs `firsthand`, and asserts that it fails with the error `code` and mentions all `names`, the
/// wrong input or the remedy.
///
/// `code` is "usage" for a wrong command line, and "" for none. Returns the exit code.
#[track_caller]
pub fn refused(arguments: &[&str], code: &str, names: &[&str]) -> Option<i32> {
    assert_refused(&output(arguments), code, names)
}

/// [`refused`] for a finished command.
#[track_caller]
pub fn assert_refused(output: &Output, code: &str, names: &[&str]) -> Option<i32> {
    let said = String::from_utf8_lossy(&output.stderr);
    let exit = output.status.code();
    assert!(!output.status.success(), "{output:?}");
    assert!(!said.contains("panicked"), "{said}");
    let coded = |line: &str| Some(line.strip_suffix(']')?.rsplit_once(" [")?.1.to_owned());
    let found = match exit {
        Some(2) => "usage".to_owned(),
        _ => said.lines().find_map(coded).unwrap_or_default(),
    };
    assert_eq!(found, code, "{said}");
    assert_said(output, names);
    exit
}

/// Asserts that the messages of a finished command contain all `parts`.
#[track_caller]
pub fn assert_said(output: &Output, parts: &[&str]) {
    let said = String::from_utf8_lossy(&output.stderr);
    for part in parts {
        assert!(said.contains(part), "{part:?} is not said: {said}");
    }
}

/// Asserts that a finished run with `--json` reached its target untouched. Returns its summary.
#[track_caller]
pub fn reached(output: &Output) -> Value {
    let (code, mut summary) = json_of(output);
    assert_reached(code, &summary[0]);
    summary.remove(0)
}
