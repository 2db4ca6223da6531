//! `firsthand doctor`: this machine, a verdict a line.

use std::{
    collections::BTreeSet,
    fs,
    net::TcpListener,
    path::Path,
    process::{Command, ExitCode},
    time::{SystemTime, UNIX_EPOCH},
};

use clap::Args;
use common::{VERSION, clock::monotonic_ns, domain::Domain};
use console::{
    addresses,
    failure::Result,
    missions,
    output::print_line,
    robots::{self, Robot},
};
use processes::{DomainError, domain, executable};
use rustix::{
    fs::{Access, access},
    process::{Resource, getrlimit},
};
use serde_json::json;

use crate::companions;

/// Examine this machine: memory, limits, clock, ports, serial lines, versions, what other runs left.
///
/// Each line is ok, a note, or a problem with its remedy. The exit code is 1 if there is a problem.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Print one JSON object per line.
    #[arg(long)]
    json: bool,
}

/// `ok`, `note` or `problem`, and why or the remedy.
type Verdict = (&'static str, String);

pub fn main(arguments: &Arguments) -> Result<ExitCode> {
    let mut is_ill = false;
    let mut tell = |check: &str, (verdict, text): Verdict| {
        is_ill |= verdict == "problem";
        if arguments.json {
            print_line(json!({ "check": check, "verdict": verdict, "text": text }))
        } else {
            print_line(format_args!("{verdict:<8} {check}: {text}"))
        }
    };
    let clocks_s = || {
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        (since_1970.as_secs_f64(), monotonic_ns() as f64 * 1e-9)
    };
    let (began_s, since_s) = clocks_s();
    let cells = missions::load("obstacle-course", &[])?.grid_frame().area();
    for (part, found) in domain::check_machine(&Domain::of("any".parse()?), cells) {
        tell(part, needed(found))?;
    }
    for (viewer, address) in [("page", addresses::PAGE), ("foxglove", addresses::FOXGLOVE)] {
        tell(address, port(viewer, TcpListener::bind(address).is_ok()))?;
    }
    for entry in fs::read_dir("/dev")?.flatten() {
        let name = entry.path().display().to_string();
        if name.starts_with("/dev/ttyUSB") || name.starts_with("/dev/ttyACM") {
            let may_use = access(&name, Access::READ_OK | Access::WRITE_OK).is_ok();
            let group = printed(Command::new("stat").args(["-c", "%G", &name]));
            tell(&name, serial(may_use, &group.unwrap_or_default()))?;
        }
    }
    let may_raise = getrlimit(Resource::Rtprio).current != Some(0);
    let text = if may_raise { "you may set it" } else { "you may not set it, which is optional" };
    tell("real-time priority", ("note", text.to_owned()))?;
    for name in BTreeSet::from_iter(companions::TABLE.iter().map(|it| it.executable)) {
        let version_of = executable::find(Path::new(name))
            .ok()
            .and_then(|path| printed(Command::new(path).arg("--version")));
        tell(name, version(version_of.as_deref()))?;
    }
    tell("other robots", others(&robots::own().1, &robots::other_users()))?;
    let (now_s, went_s) = clocks_s();
    let timesync = Path::new("/run/systemd/timesync");
    let is_synchronised = timesync.exists().then(|| timesync.join("synchronized").exists());
    let jumped_s = now_s - began_s - (went_s - since_s);
    tell("clock", clock(now_s, jumped_s, is_synchronised))?;
    Ok(u8::from(is_ill).into())
}

/// `None` if it does not start.
fn printed(command: &mut Command) -> Option<String> {
    Some(String::from_utf8_lossy(&command.output().ok()?.stdout).trim().to_owned())
}

fn needed(it: Result<(), DomainError>) -> Verdict {
    it.map_or_else(
        |error| ("problem", error.to_string()),
        |()| ("ok", "sufficient for a robot".to_owned()),
    )
}

/// `now_s` counts from 1970. `jumped_s` is the clock's recent gain on the monotonic one.
fn clock(now_s: f64, jumped_s: f64, is_synchronised: Option<bool>) -> Verdict {
    let (verdict, text) = match is_synchronised {
        // In 2025 and before.
        _ if now_s < 1.767e9 => (
            "problem",
            "its time is before the release of firsthand; set it: `timedatectl set-ntp true`",
        ),
        _ if jumped_s.abs() > 0.1 => {
            ("note", "another program set it just now; logs use this clock, missions do not")
        }
        Some(true) => ("ok", "NTP synchronises it"),
        Some(false) => ("note", "NTP has not synchronised it yet; logs use this clock"),
        None => ("ok", "it runs; whether NTP synchronises it is unknown"),
    };
    (verdict, text.to_owned())
}

fn port(viewer: &str, is_free: bool) -> Verdict {
    if is_free {
        return ("ok", format!("free for `firsthand {viewer}`"));
    }
    (
        "note",
        format!(
            "another program uses it; if that is not `firsthand {viewer}`, give the viewer another port with --listen"
        ),
    )
}

fn serial(may_use: bool, group: &str) -> Verdict {
    if may_use {
        return ("ok", "you may read and write it".to_owned());
    }
    (
        "problem",
        format!(
            "you may not use it; join its group, often dialout, and log in again: `sudo usermod -aG {group} $USER`"
        ),
    )
}

/// Takes the output of `--version`; `None` without the executable.
fn version(printed: Option<&str>) -> Verdict {
    match printed {
        None => {
            ("note", "not installed; build it with `cargo build --release --workspace`".to_owned())
        }
        Some(printed) if printed.ends_with(VERSION) => ("ok", printed.to_owned()),
        Some(other) => {
            ("problem", format!("it is {other:?}, but firsthand is {VERSION}; install both anew"))
        }
    }
}

/// Takes the robots of killed supervisors, and other users with robots.
pub fn others(killed: &[Robot], users: &[u32]) -> Verdict {
    let killed = killed.iter().map(|robot| {
        format!(
            "the supervisor of {} was killed; its next `firsthand run` clears it up",
            robot.name
        )
    });
    let users = users.iter().map(|user| {
        format!("user {user} has robots; list them with `sudo -u '#{user}' firsthand status --all`")
    });
    let notes: Vec<_> = killed.chain(users).collect();
    if notes.is_empty() {
        return ("ok", "no killed run, no other user's robot".to_owned());
    }
    ("note", notes.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_reading_of_the_machine_has_its_verdict_and_each_problem_its_remedy() {
        let own = format!("firsthand-page {VERSION}");
        for ((verdict, text), expected, says) in [
            (needed(Ok(())), "ok", "sufficient"),
            (needed(Err(DomainError::Descriptors { limit: 9 })), "problem", "ulimit -Hn"),
            (clock(3600.0, 0.0, Some(true)), "problem", "timedatectl"),
            (clock(2e9, -3.0, Some(true)), "note", "just now"),
            (clock(2e9, 0.001, Some(false)), "note", "not synchronised"),
            (clock(2e9, 0.001, Some(true)), "ok", "NTP synchronises"),
            (clock(2e9, 0.001, None), "ok", "unknown"),
            (port("page", true), "ok", "firsthand page"),
            (port("page", false), "note", "--listen"),
            (serial(true, "uucp"), "ok", "read and write"),
            (serial(false, "uucp"), "problem", "-aG uucp"),
            (version(None), "note", "cargo build"),
            (version(Some(&own)), "ok", VERSION),
            (version(Some("firsthand-page 0.0.9")), "problem", "0.0.9"),
            (version(Some("")), "problem", "install both"),
            (others(&[], &[]), "ok", "no killed run"),
            (others(&[Robot::find("x80".parse().unwrap())], &[]), "note", "of x80 was killed"),
            (others(&[], &[1000]), "note", "user 1000 has"),
        ] {
            assert_eq!(verdict, expected, "{text}");
            assert!(text.contains(says), "{says}: {text}");
        }
    }
}
