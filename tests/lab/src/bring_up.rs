//! `firsthand bring-up` of simulated robots that were assembled with faults: what it names, and what it names of right ones.

use std::{collections::BTreeSet, fs, path::PathBuf, process::Stdio, sync::Mutex, time::Duration};

use clap::Args;
use common::clock::Pace;
use console::{missions, output::print_text};
use mission_control::simulator::Simulator;
use serde::Deserialize;

use crate::{
    error::{OrCannot as _, Result},
    random::Random,
    robot,
};

/// Bring up simulated robots with faults of assembly, and count what is found and what is invented.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Robots with one or two faults.
    #[arg(long, default_value_t = 60)]
    faulty: u64,
    /// Robots without a fault.
    #[arg(long, default_value_t = 20)]
    right: u64,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Robots at once; each takes about a minute of wall-clock time.
    #[arg(long, default_value_t = 6)]
    jobs: usize,
    /// The directory of the runs.
    #[arg(long, value_name = "DIR", default_value = "bring-up")]
    out: PathBuf,
}

/// A fault: its name, the parts of which one must be found wrong, and the keys that the robot has instead of the stated ones.
type Fault = (&'static str, &'static [&'static str], fn(&mut Random) -> Vec<String>);

fn laser(keys: &str) -> Vec<String> {
    vec![format!("robot.sensor=[{{name='laser',kind='scan',model='rplidar-a1',{keys}}}]")]
}

fn either(random: &mut Random, from: f64, to: f64) -> f64 {
    random.within(from, to) * if random.below(2) == 0 { 1.0 } else { -1.0 }
}

const OF_X80: &[Fault] = &[
    ("wheels swapped", &["motors"], |_| {
        vec![
            "robot.left={channel=1,reversed=false}".into(),
            "robot.right={channel=0,reversed=true}".into(),
        ]
    }),
    ("left motor reversed", &["motors", "wheels"], |_| {
        vec!["robot.left={channel=0,reversed=false}".into()]
    }),
    ("right motor reversed", &["motors", "wheels"], |_| {
        vec!["robot.right={channel=1,reversed=true}".into()]
    }),
    ("both motors reversed", &["motors"], |_| {
        vec![
            "robot.left={channel=0,reversed=false}".into(),
            "robot.right={channel=1,reversed=true}".into(),
        ]
    }),
    ("counts per turn", &["wheel size"], |random| {
        vec![format!("robot.counts_per_turn={:.0}", 1200.0 * [0.63, 1.5][random.below(2)])]
    }),
    ("a late base", &["response"], |random| {
        vec![format!("robot.response.delay_s={:.2}", random.within(0.2, 0.4))]
    }),
];

const OF_LASER: &[Fault] = &[
    ("laser's yaw", &["laser"], |random| {
        laser(&format!(
            "forward_m=0.05,bearing_deg=0.0,turned_deg={:.1}",
            either(random, 6.0, 120.0)
        ))
    }),
    ("laser upside down", &["laser"], |_| laser("forward_m=0.05,bearing_deg=0.0,roll_deg=180")),
    ("laser's place", &["laser"], |random| {
        laser(&format!("forward_m={:.2},bearing_deg=0.0", random.within(-0.15, -0.05)))
    }),
    ("laser's delay", &["laser"], |random| {
        vec![format!(
            "simulation.laser={{delay_s={:.2},stated_share=0.0}}",
            random.within(0.1, 0.3)
        )]
    }),
    ("track", &["track"], |random| {
        vec![format!("robot.track_m={:.3}", 0.23 * (1.0 + either(random, 0.08, 0.2)))]
    }),
    ("wheel radius", &["wheel size"], |random| {
        vec![format!("robot.wheel_radius_m={:.4}", 0.0352 * (1.0 + either(random, 0.08, 0.15)))]
    }),
    ("wheel ratio", &["wheel ratio"], |random| {
        vec![format!("simulation.wheels.diameter_ratio={:.3}", 1.0 + either(random, 0.05, 0.08))]
    }),
    ("a late base", &["response"], |random| {
        vec![format!("robot.response.delay_s={:.2}", random.within(0.2, 0.4))]
    }),
];

const ROOM: &str = "target = [0.8, 0]\nsensors = 'all'\nsimulation.realism = 'measured'\n[perimeter]\nwidth_m = 8.0\ncentre = [0.0, 0.0]\n";
const X80: &str = "[robot]\nmodel = 'x80'\n";
const KOBUKI: &str = "[robot]\nmodel = 'kobuki'\nrate_hz = 10.0\n[[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nmodel = 'rplidar-a1'\nforward_m = 0.05\nbearing_deg = 0.0\n";
/// Longer than a bring-up on a loaded machine.
const PATIENCE: Duration = Duration::from_secs(400);
const LOOK: Duration = Duration::from_millis(100);

/// Walls around the robot, a little otherwise for each.
fn walls(random: &mut Random) -> String {
    let corners = [(1.4, -1.8), (1.4, 1.6), (-0.4, 2.0), (-1.8, 0.5), (-1.6, -1.9), (1.4, -1.8)];
    let shift = random.within(-0.15, 0.15);
    let corner = |(x, y): &(f64, f64)| format!("[{:.2}, {:.2}]", x + shift, y * (1.0 + shift));
    let corners: Vec<_> = corners.iter().map(corner).collect();
    format!("[[world.wall]]\npoints = [{}]\n", corners.join(", "))
}

#[derive(Deserialize)]
struct Found {
    part: String,
    verdict: String,
}

#[derive(Deserialize)]
struct Said {
    findings: Vec<Found>,
}

pub fn main(arguments: &Arguments) -> Result {
    robot::path()?;
    fs::create_dir_all(&arguments.out).or_cannot_file("make", &arguments.out)?;
    let all = arguments.faulty + arguments.right;
    let next = Mutex::new(0..all);
    let lines = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..arguments.jobs.max(1) {
            scope.spawn(|| {
                while let Some(number) = next.lock().ok().and_then(|mut next| next.next()) {
                    let told = one(arguments, number)
                        .unwrap_or_else(|why| (false, format!("failed: {why}")));
                    if let Ok(mut lines) = lines.lock() {
                        lines.push(told);
                    }
                }
            });
        }
    });
    let lines = lines.into_inner().or_cannot("read the results")?;
    for (_, line) in lines.iter().filter(|it| !it.0) {
        print_text(&format!("{line}\n"))?;
    }
    let right = lines.iter().filter(|it| it.0).count();
    print_text(&format!("{right} of {all} robots were told right\n"))?;
    (right as u64 == all).then_some(()).ok_or_else(|| "a fault was missed or invented".into())
}

/// Whether the bring-up of a robot named its faults and no other, and what it said.
fn one(arguments: &Arguments, number: u64) -> Result<(bool, String)> {
    let mut random = Random::of_world(arguments.seed, 0, number);
    let (body, table) = if number.is_multiple_of(2) { (X80, OF_X80) } else { (KOBUKI, OF_LASER) };
    let text = format!("seed = {}\n{ROOM}{body}{}", number + 1, walls(&mut random));
    // Two faults of wheels that hide each other are not drawn; lasers have two now and then.
    let count = match (number < arguments.faulty, table.len() == OF_LASER.len()) {
        (false, _) => 0,
        (true, true) => 1 + random.below(2),
        (true, false) => 1,
    };
    let mut faults: Vec<&Fault> = Vec::new();
    while faults.len() < count {
        let fault = &table[random.below(table.len())];
        let same = |it: &&Fault| it.1 == fault.1;
        if !faults.iter().any(same) {
            faults.push(fault);
        }
    }
    let keys: Vec<String> = faults.iter().flat_map(|fault| fault.2(&mut random)).collect();
    let mission = missions::parsed(&text, "bring-up", &keys)?;
    let directory = arguments.out.join(number.to_string());
    fs::create_dir_all(&directory).or_cannot_file("make", &directory)?;
    let mut simulator =
        Simulator::start(robot::firsthand(&[]), &directory, &mission, Pace::Rate(1.0), None)?;
    let stated = directory.join("stated.toml");
    fs::write(&stated, &text).or_cannot_file("write", &stated)?;
    let address = format!("robot.address='udp://{}'", simulator.address());
    let mut command = robot::mission("bring-up", &stated, format!("bring-up-{number}"), &[address]);
    command.arg("--yes").arg("--runs").arg(directory.join("runs"));
    let mut child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .or_cannot("start firsthand bring-up")?;
    let began = std::time::Instant::now();
    while child.try_wait()?.is_none() && began.elapsed() < PATIENCE {
        // A simulator whose ground truth nobody reads stops.
        simulator.poll()?;
        std::thread::sleep(LOOK);
    }
    let _ = child.kill();
    let output = child.wait_with_output()?;
    let said: Said = serde_json::from_slice(&output.stdout)
        .map_err(|_| format!("robot {number} gave no findings; see {}", directory.display()))?;
    let wrong: BTreeSet<&str> = said
        .findings
        .iter()
        .filter(|it| it.verdict == "WRONG")
        .map(|it| it.part.as_str())
        .collect();
    let found = faults.iter().all(|fault| fault.1.iter().any(|part| wrong.contains(part)));
    let invented = wrong.iter().any(|part| !faults.iter().any(|fault| fault.1.contains(part)));
    let names: Vec<_> = faults.iter().map(|fault| fault.0).collect();
    let line =
        format!("robot {number}: {} ({}): found {wrong:?}", names.join(", "), keys.join(" "));
    Ok((found && !invented, line))
}
