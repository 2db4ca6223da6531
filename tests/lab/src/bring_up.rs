//! `firsthand bring-up` of simulated robots, correct and misassembled: which faults it names.

use std::{
    collections::BTreeSet,
    fs::{self, File},
    num::NonZero,
    path::PathBuf,
    process::Stdio,
    time::{Duration, Instant},
};

use clap::{Args, builder::PossibleValuesParser};
use console::{missions, output::print_line};
use mission_control::surroundings::SimulatedRobot as _;
use processes::process::Process;
use serde::Deserialize;
use serde_json::Value;

use simulation::Random;

use crate::{
    error::{OrCannot as _, Result},
    missions::runner::in_parallel,
    robot,
    ros2_robot::Ros2Robot,
};

/// Bring up simulated robots with assembly faults, and count found and invented faults.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Number of robots with one or two faults.
    #[arg(long, default_value_t = 60)]
    faulty: u64,
    /// Number of robots without a fault.
    #[arg(long, default_value_t = 20)]
    right: u64,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Kinds of robots, taken in turn: by default x80, kobuki (JSON), arduino and sonars. ros2 and
    /// burger speak ROS 2, which requires a firsthand built with --features ros2.
    #[arg(long, value_delimiter = ',', default_value = "x80,kobuki,arduino,sonars", value_parser = PossibleValuesParser::new(ROBOTS.map(|it| it.0)))]
    robots: Vec<String>,
    /// Number of robots at once; each takes about a minute of wall-clock time.
    #[arg(long, default_value_t = 6)]
    jobs: usize,
    /// Directory of the runs.
    #[arg(long, value_name = "DIR", default_value = "bring-up")]
    out: PathBuf,
}

/// Row of `faults.csv`: parts of which one must be found wrong, and true keys, with VALUE from one
/// of two ranges.
#[derive(Deserialize)]
struct Fault {
    robot: String,
    name: String,
    parts: String,
    keys: String,
    from: Option<f64>,
    to: Option<f64>,
    or_from: Option<f64>,
    or_to: Option<f64>,
}

impl Fault {
    fn keys(&self, random: &mut Random) -> Vec<String> {
        let ranges = [self.from.zip(self.to), self.or_from.zip(self.or_to)];
        let keys = ranges[random.below(2)].map_or(self.keys.clone(), |(from, to)| {
            let value = (random.within(from, to) * 1e4).round() / 1e4;
            self.keys.replace("VALUE", &value.to_string())
        });
        keys.split(';').map(str::to_owned).collect()
    }
}

const ROOM: &str = "target = [0.8, 0]\nsensors = 'all'\nsimulation.realism = 'measured'\n[perimeter]\nwidth_m = 8.0\ncentre = [0.0, 0.0]\n";
/// Placeholder for the simulator's address. Robots that speak ROS 2 lack it; their simulators speak
/// JSON.
const ADDRESS: &str = "#ADDRESS";
static ROBOTS: [(&str, &str); 6] = [
    ("x80", "[robot]\n#ADDRESS\nmodel = 'x80'\n"),
    (
        "kobuki",
        "[robot]\n#ADDRESS\nmodel = 'kobuki'\nrate_hz = 10.0\n[[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nmodel = 'rplidar-a1'\nforward_m = 0.05\nbearing_deg = 0.0\n",
    ),
    (
        "arduino",
        "[robot]\n#ADDRESS\nprotocol = 'arduino'\nrate_hz = 10.0\nwheel_radius_m = 0.0325\ntrack_m = 0.20\nradius_m = 0.15\ntop_speed_m_s = 0.5\ncounts_per_turn = 1320.0\n[[robot.sensor]]\nname = 'laser'\n#ADDRESS\nkind = 'scan'\nmodel = 'rplidar-a1'\nforward_m = 0.05\nbearing_deg = 0.0\n",
    ),
    (
        "sonars",
        "[robot]\n#ADDRESS\nprotocol = 'arduino'\nrate_hz = 10.0\nwheel_radius_m = 0.0325\ntrack_m = 0.20\nradius_m = 0.15\ntop_speed_m_s = 0.5\ncounts_per_turn = 1320.0\narduino.sonars = { front = 4, left = 5, right = 6 }\n[[robot.sensor]]\nname = 'front'\nkind = 'cone'\nforward_m = 0.12\nbearing_deg = 0.0\n[[robot.sensor]]\nname = 'left'\nkind = 'cone'\nforward_m = 0.12\nbearing_deg = 40.0\n[[robot.sensor]]\nname = 'right'\nkind = 'cone'\nforward_m = 0.12\nbearing_deg = -40.0\n",
    ),
    (
        "ros2",
        "[robot]\nmodel = 'kobuki'\nrate_hz = 10.0\n[[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nmodel = 'rplidar-a1'\nforward_m = 0.05\nbearing_deg = 0.0\n[simulation.laser]\nsweep_s = 0.1\n",
    ),
    (
        "burger",
        "[robot]\nmodel = 'turtlebot3-burger'\nrate_hz = 10.0\n[[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nmodel = 'lds-02'\nforward_m = -0.032\nbearing_deg = 0.0\n[simulation.laser]\nsweep_s = 0.1\n",
    ),
];
/// Pseudo-key: ratio of the turn by odometry to the turn of the wheels.
const ODOMETRY_TURNS: &str = "odometry.turns=";
const DRAWS: u32 = 20;
const PATIENCE: Duration = Duration::from_secs(400);
const LOOK: Duration = Duration::from_millis(100);

fn walls(random: &mut Random) -> String {
    let corners = [(1.4, -1.8), (1.4, 1.6), (-0.4, 2.0), (-1.8, 0.5), (-1.6, -1.9), (1.4, -1.8)];
    let shift = random.within(-0.15, 0.15);
    let corners = corners.map(|(x, y)| format!("[{:.2}, {:.2}]", x + shift, y * (1.0 + shift)));
    format!("[[world.wall]]\npoints = [{}]\n", corners.join(", "))
}

pub fn main(arguments: &Arguments) -> Result {
    robot::path()?;
    fs::create_dir_all(&arguments.out).or_cannot_file("make", &arguments.out)?;
    let table: Vec<Fault> = crate::rows(include_str!("bring_up/faults.csv").as_bytes())?;
    let all = arguments.faulty + arguments.right;
    let mut right = 0;
    let one = |number: &u64, _: usize| one(arguments, &table, *number);
    let jobs = NonZero::new(arguments.jobs.max(1));
    in_parallel((0..all).collect(), jobs, one, |_, found| {
        match found {
            Ok(None) => right += 1,
            Ok(Some(wrong)) => print_line(wrong)?,
            Err(why) => print_line(format!("failed: {why}"))?,
        }
        Ok(())
    })?;
    print_line(format!("findings of {right} of {all} robots are right"))?;
    if right == all {
        return Ok(());
    }
    Err("the findings missed a fault or named one that does not exist".into())
}

/// Brings up a robot. Returns its faults and findings unless these are right.
fn one(arguments: &Arguments, table: &[Fault], number: u64) -> Result<Option<String>> {
    let mut random = Random::of_world(arguments.seed, 0, number);
    let robot = &*arguments.robots[number as usize % arguments.robots.len()];
    let body = ROBOTS.iter().find(|it| it.0 == robot).map_or("", |it| it.1);
    let text = format!("seed = {}\n{ROOM}{body}{}", number + 1, walls(&mut random));
    let most = match robot {
        _ if number >= arguments.faulty => 0,
        // Sonars alone cannot distinguish two wheel faults.
        "x80" | "sonars" => 1,
        _ => 1 + random.below(2),
    };
    let table: Vec<&Fault> = table.iter().filter(|fault| fault.robot == robot).collect();
    let mut faults: Vec<&Fault> = Vec::new();
    // A motor that turns backwards hides other faults.
    let hides = |fault: &Fault| fault.parts.contains("motors");
    for _ in 0..DRAWS {
        let fault = table[random.below(table.len())];
        let shows = |it: &&Fault| it.parts != fault.parts && !hides(it) && !hides(fault);
        if faults.len() < most && faults.iter().all(shows) {
            faults.push(fault);
        }
    }
    let keys: Vec<_> = faults.iter().flat_map(|fault| fault.keys(&mut random)).collect();
    let turns = keys.iter().find_map(|key| key.strip_prefix(ODOMETRY_TURNS));
    let mut of_mission = keys.clone();
    of_mission.retain(|key| !key.starts_with(ODOMETRY_TURNS));
    let mission = missions::parsed(&text, "bring-up", &of_mission)?;
    let directory = arguments.out.join(number.to_string());
    let mut simulator = robot::simulated(&directory, &mission)?;
    let stated = directory.join("stated.toml");
    let address = format!("address = 'udp://{}'", simulator.address());
    fs::write(&stated, text.replace(ADDRESS, &address)).or_cannot_file("write", &stated)?;
    let node = if body.contains(ADDRESS) {
        None
    } else {
        let turns = turns.map_or(Ok(1.0), str::parse).or_cannot("read a fault")?;
        let stated = |keys: &[String]| missions::parsed(&text, "bring-up", keys);
        Some(Ros2Robot::start(simulator.address(), number, turns, stated)?)
    };
    let set = node.as_ref().map_or(&[][..], |node| &node.keys);
    let name = format!("bring-up{}-{number}", std::process::id());
    let mut command = robot::mission("bring-up", &stated, name, set);
    let found = directory.join("findings.json");
    let file = File::create(&found).or_cannot_file("write", &found)?;
    command
        .args(["--yes", "--runs"])
        .arg(directory.join("runs"))
        .stdout(file)
        .stderr(Stdio::null());
    let mut child = Process::spawn(command).or_cannot("start firsthand bring-up")?;
    let began = Instant::now();
    while child.try_reap()?.is_none() && began.elapsed() < PATIENCE {
        // A simulator stops if its ground truth is unread.
        simulator.poll()?;
        std::thread::sleep(LOOK);
    }
    drop(child);
    let said: Value = serde_json::from_slice(&fs::read(&found)?).map_err(|_| {
        format!("robot {number} ({robot}) gave no findings; see {}", directory.display())
    })?;
    let findings = said["findings"].as_array().into_iter().flatten();
    let wrong = findings.filter(|it| it["verdict"] == "WRONG");
    let wrong: BTreeSet<&str> = wrong.filter_map(|it| it["part"].as_str()).collect();
    let found = faults.iter().all(|fault| fault.parts.split(';').any(|part| wrong.contains(part)));
    let parts: BTreeSet<&str> = faults.iter().flat_map(|fault| fault.parts.split(';')).collect();
    if found && wrong.is_subset(&parts) {
        return Ok(None);
    }
    let names: Vec<_> = faults.iter().map(|fault| &*fault.name).collect();
    let (names, keys) = (names.join(", "), keys.join(" "));
    Ok(Some(format!("robot {number}: {names} ({keys}): found {wrong:?}")))
}
