//! `firsthand init`: a mission file for a robot that answers.

use std::{
    fs::File,
    io::Write as _,
    path::PathBuf,
    time::{Duration, Instant},
};

use bring_up::seen::Seen;
use clap::Args;
use common::{
    address::Address, clock::monotonic_ns, domain::RobotName, file::FileError, mission::Protocol,
    poll, run::Run,
};
use console::{
    failure::{Result, refuse},
    missions,
    output::{print_line, say},
    robots,
};
use link::transport::Transport;
use rustix::io::Errno;
use serde::{
    Deserialize as _,
    de::{IntoDeserializer as _, value::Error as ValueError},
};

/// For each of three protocols.
const LISTENS: Duration = Duration::from_secs(4);
/// Bytes after which no robot is expected: more than any sends in that time.
const FLOOD: usize = 16 << 20;

/// Write a mission file for the robot that answers at ADDRESS: its protocol, sensors and rates. The
/// robot is asked, and never moved.
///
/// MEASURE and PLACEHOLDER mark what a robot cannot say. `init` tries JSON lines, then frames of an
/// X80, then ROSArduinoBridge, 4 s each. `init` sends nothing to a ROS 2 robot.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The robot's address: udp://192.168.0.20:5600, tcp://HOST:PORT, serial:///dev/ttyUSB0,
    /// ros2:0.
    address: Address<String>,
    /// The mission file to write, which must not exist.
    #[arg(long, value_name = "FILE", default_value = "robot.toml")]
    out: PathBuf,
    /// Ask the robot nothing, and write a file to complete for this protocol: json, x80, arduino or
    /// ros2.
    #[arg(long, value_parser = protocol)]
    protocol: Option<Protocol>,
    /// The name that the robot gets on this machine.
    #[arg(long, default_value_t)]
    robot: RobotName,
}

fn protocol(word: &str) -> Result<Protocol, ValueError> {
    Protocol::deserialize(word.into_deserializer())
}

pub fn main(Arguments { address, out, protocol, robot }: &Arguments) -> Result {
    let place = out.display();
    if out.exists() {
        return refuse("file-exists", format!("{place} exists; give another file with --out"));
    }
    let seen = match (protocol, address) {
        (Some(protocol), _) => Seen::new(*protocol)?,
        (None, Address::Ros2(_)) => Seen::new(Protocol::Ros2)?,
        (None, _) => heard(address)?,
    };
    let text = seen.mission_at(&address.to_string());
    missions::parsed(&text, "what the robot says", &[])?;
    // A file that appeared meanwhile stays.
    File::create_new(out)
        .and_then(|mut file| file.write_all(text.as_bytes()))
        .map_err(FileError::of("write", out))?;
    let said: String = text.split_inclusive('\n').filter(|line| line.starts_with("# -")).collect();
    print_line(format_args!(
        "{said}wrote {place}; next:\n  1. correct its lines with MEASURE and PLACEHOLDER\n  2. firsthand check {place}\n  3. firsthand bring-up {place} --robot {robot} --write"
    ))
}

fn heard(address: &Address<String>) -> Result<Seen> {
    let refused = |code, why: String| refuse(code, format!("{address}: {why}"));
    let resolved = address.resolve()?;
    let mut runs = robots::own().0.into_iter().filter_map(|robot| Run::load(&robot.run?).ok());
    if let Some(Run { robot, .. }) = runs.find(|run| run.address == resolved) {
        return refused(
            "address-in-use",
            format!("robot {robot} runs here and has it; end its run first"),
        );
    }
    say(format_args!("asking {address}, for 12 s at most"));
    let (mut first, mut refusal) = (Vec::new(), String::new());
    for protocol in [Protocol::Json, Protocol::X80, Protocol::Arduino] {
        let mut seen = Seen::new(protocol)?;
        let mut wire = Transport::of_base(&resolved, &seen.mission)?;
        let (began, mut came) = (Instant::now(), 0);
        while let at = began.elapsed()
            && at < LISTENS
            && came < FLOOD
        {
            wire.maintain(monotonic_ns())?;
            if let Some(bytes) = wire.receive(monotonic_ns())? {
                came += bytes.len();
                first.extend(bytes.iter().take(48 - first.len()));
                seen.hear(bytes, at.as_secs_f64());
            } else {
                wire.send(&seen.ask())?;
                poll::readable(wire.descriptor().as_slice(), Some(Duration::from_millis(100)))?;
            }
        }
        if seen.is_known() {
            return Ok(seen);
        }
        refusal += &seen.refused;
        let attempts = wire.attempts(monotonic_ns()).filter(|_| first.is_empty());
        if let Some((errno, remedy)) = attempts.and_then(|attempts| attempts.failed) {
            let code = match errno {
                Errno::ACCESS => "no-rights",
                Errno::AGAIN => "address-in-use",
                _ => "no-answer",
            };
            return refused(code, format!("{errno}: {remedy}"));
        }
    }
    if first.is_empty() {
        return refused(
            "no-answer",
            format!(
                "nothing answers; is the robot on, does its program run, is the address right? Other users with robots here: {:?}",
                robots::other_users()
            ),
        );
    }
    refused(
        "unknown-protocol",
        format!(
            "what answers speaks no known protocol, but says \"{}\": {refusal}; correct its program or the address",
            first.escape_ascii()
        ),
    )
}
