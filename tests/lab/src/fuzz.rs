//! External inputs for all decoders: random, and mutated from valid messages. Where panics abort
//! (release builds), the first one ends the command.

use std::{
    ffi::OsStr,
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
};

use clap::Args;
use common::{
    clock::{MissionTime, Pace},
    journal::Journal,
    mission::Mission,
    samples::{HoldReason, Order},
};
use console::{missions::SHIPPED, output::print_text};
use link::step::{Entry, Event, Link, State};
use recording::Recording;

use simulation::Random;

use crate::error::{OrCannot as _, Result};

/// Give random and mutated inputs to the decoders of wires, missions, states, maps and recordings.
#[derive(Debug, Args)]
#[command(override_usage = "firsthand-lab fuzz [OPTIONS]")]
pub struct Arguments {
    /// Number of inputs.
    #[arg(long, default_value_t = 100_000)]
    inputs: u64,
    /// Seed of the inputs.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Inputs from coverage-guided fuzzing, and a recording's first bytes.
const X80: &str = include_str!("../../../common/wire/x80/fuzz/decoder-corpus.hex");
const RECORDING: &[u8] = include_bytes!("../../golden/open-room.mcap");
const PGM: &str = "P5\n4 4\n255\n0123456789abcdef";
const JSON: &str = "{\"clock_s\":12.5,\"wheels\":[1.5,2],\"speeds\":[0,1],\"ranges\":{\"front\":null,\"left\":1e308},\"scan\":[1,null,-1],\"scan_age_s\":0.1,\"scan_time_s\":0.1,\"heard\":1}\n{\"odometry\":[0,1,2],\"held\":[true,false],\"touched\":{\"bumper\":true},\"battery_v\":12,\"scans\":{\"a\":{\"ranges\":[1]}}}\n";
const ARDUINO: &str = "e 100 -100\r\n123 456\r\nOK\r\n";
const ROS_MAP: &str = "image: map.pgm\nresolution: 0.05\norigin: [0.0, -1.5, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\nmode: trinary\n";
const MOVING_AI: &str = "type octile\nheight 2\nwidth 3\nmap\n.@.\n..T\n";
const RPLIDAR: &[u8] = b"\xa5Z\x03\x00\x00\x00\x06\x00\x00\x00\xa5Z\x05\x00\x00@\x81=\x01\x00\x10\x10>\x81\x00\x10\x10";
const TELLING: &[u8] = b"\0\xff\x7f\x80 -.9e[{\"\n";
const STATE_BYTES: usize = 4096;
const PERIOD_NS: u64 = 20_000_000;

type Persisted = Vec<(u64, Option<String>, f64)>;

const BOARD: &str = "robot.protocol = 'arduino'\nrobot.counts_per_turn = 1200\n";
const NODE: &str = "robot.protocol = 'ros2'\nrobot.address = 'ros2:0'\n";
const LASER: &str = "[[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nmodel = 'rplidar-a1'\nforward_m = 0\nbearing_deg = 0";

/// Decoder under test: bytes go to a link, or to a file that is opened.
struct Target {
    name: &'static str,
    seed: Vec<u8>,
    link: Option<Link>,
}

impl Target {
    fn file(name: &'static str, seed: impl Into<Vec<u8>>) -> Self {
        Self { name, seed: seed.into(), link: None }
    }

    fn wire(name: &'static str, robot: &str, seed: impl Into<Vec<u8>>) -> Result<Self> {
        let text = format!("target = [3, 0]\n{robot}");
        let mission = Mission::parse(&text, name).or_cannot("fuzz")?;
        let mut link = Link::new(&mission);
        link.restore(State { pace: Pace::Rate(1.0), next_tick: 0 });
        Ok(Self { link: Some(link), ..Self::file(name, seed) })
    }

    fn take(&mut self, bytes: &[u8], directory: &Path, machine_ns: u64) {
        let Some(link) = &mut self.link else {
            let file = directory.join(self.name);
            // A full disk is no finding.
            return if fs::write(&file, bytes).is_ok() {
                open(&file);
            };
        };
        let drive = Event::Order(Order::Drive, HoldReason::None);
        for event in [drive, Event::Sensor(0, bytes), Event::Datagram(bytes)] {
            link.step(Entry { event, machine_ns, now: MissionTime(machine_ns) });
        }
    }
}

fn open(file: &Path) {
    match file.extension().and_then(OsStr::to_str) {
        Some("toml") => {
            let text = fs::read(file).unwrap_or_default();
            let _ = Mission::parse(&String::from_utf8_lossy(&text), file);
        }
        Some("mcap") => {
            let messages = Recording::open(file).and_then(|recording| recording.messages(&[]));
            messages.into_iter().flatten().for_each(drop);
        }
        Some("pgm" | "map" | "yaml") => drop(maps::load(file)),
        _ => drop(open_state(file)),
    }
}

fn open_state(file: &Path) -> Result<Journal> {
    let state = file.with_extension("");
    let opened = Journal::open::<Persisted, Persisted>(&state, STATE_BYTES, STATE_BYTES);
    Ok(opened.or_cannot("open")?.0)
}

fn targets(directory: &Path) -> Result<Vec<Target>> {
    let hex = |line: &str| -> Vec<u8> {
        let pairs = (0..line.len()).step_by(2).filter_map(|at| line.get(at..at + 2));
        pairs.filter_map(|pair| u8::from_str_radix(pair, 16).ok()).collect()
    };
    let mut journal = open_state(&directory.join("state"))?;
    let entry = vec![(7, Some("name".to_owned()), 0.5)];
    journal.snapshot(&entry).or_cannot("fuzz")?;
    journal.append(&entry).or_cannot("fuzz")?;
    let saved = |file| fs::read(directory.join(file)).or_cannot("fuzz");
    let mut targets = vec![
        Target::wire("json", "robot.model='kobuki'\nrobot.protocol='json'", JSON)?,
        Target::wire("arduino", &[BOARD, LASER].concat(), ARDUINO)?,
        Target::wire("ros2", &[NODE, LASER].concat(), [&[0, 0, 1, 0, 0][..], &[0; 760]].concat())?,
        Target::wire("rplidar", LASER, RPLIDAR)?,
        Target::file("state", saved("state")?),
        Target::file("state.journal", saved("state.journal")?),
        Target::file("map.pgm", PGM),
        Target::file("grid.map", MOVING_AI),
        Target::file("ros.yaml", ROS_MAP),
        Target::file("recording.mcap", &RECORDING[..60_000]),
    ];
    targets.extend(SHIPPED.map(|(_, text)| Target::file("mission.toml", text)));
    for frames in X80.lines().step_by(20) {
        targets.push(Target::wire("x80", "", hex(frames))?);
    }
    Ok(targets)
}

/// Mutates `seed` up to seven times; one in eight inputs starts from random bytes.
fn input(seed: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = match random.below(8) {
        0 => (0..random.below(300)).map(|_| random.bits() as u8).collect(),
        _ => seed.to_vec(),
    };
    for _ in 0..random.below(8) {
        let at = random.below(bytes.len() + 1);
        let to = (at + random.below(16)).min(bytes.len());
        match random.below(4) {
            0 => bytes.truncate(at),
            1 => bytes[at..to].fill(TELLING[random.below(TELLING.len())]),
            2 => bytes[at..to].iter_mut().for_each(|byte| *byte ^= 1 << random.below(8)),
            _ => {
                let piece = bytes[at..to].repeat(random.below(40));
                drop(bytes.splice(at..to, piece));
            }
        }
    }
    bytes
}

pub fn main(arguments: &Arguments) -> Result {
    let Arguments { inputs, seed } = *arguments;
    match fuzz(inputs, seed)? {
        None => print_text(format!("no panic of {inputs} inputs from seed {seed}\n")),
        Some(panic) => Err(panic.into()),
    }
}

/// Returns the last input at which a decoder panicked.
fn fuzz(inputs: u64, seed: u64) -> Result<Option<String>> {
    let directory = tempfile::tempdir().or_cannot("make a temporary directory")?;
    let mut targets = targets(directory.path())?;
    let count = targets.len();
    let mut panic = None;
    let mut random = Random::new(seed, 0xf022);
    for number in 0..inputs {
        let target = &mut targets[number as usize % count];
        let bytes = input(&target.seed, &mut random);
        let take = || target.take(&bytes, directory.path(), number * PERIOD_NS);
        if catch_unwind(AssertUnwindSafe(take)).is_err() {
            let bytes = bytes.escape_ascii();
            panic =
                Some(format!("{} panics at input {number} of seed {seed}: {bytes}", target.name));
        }
    }
    Ok(panic)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_decoder_panics_at_random_and_changed_inputs() {
        assert_eq!(fuzz(5000, 7).unwrap(), None);
    }
}
