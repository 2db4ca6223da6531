//! `firsthand evaluate`: success rates on many worlds, judged by the ground truth.

mod report;

use std::{
    num::NonZero,
    path::{Path, PathBuf},
};

use clap::Args;
use common::clock::Pace;
use console::{missions, output::write_stderr};
use glam::DVec2;
use processes::planner_executable;

use crate::{
    baselines::process::BASELINES,
    error::Result,
    missions::{
        HARMONIC, Setting,
        results::Results,
        runner::{self, NoiseSeeds, Plan},
        trial::swept_m,
    },
    worlds::{
        self, Asked,
        ends::{self, Ends},
    },
};

/// Run missions on many worlds and count successes by the ground truth, with 95 % intervals, and a
/// picture and page of every failure. The seed determines worlds and noise.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Worlds: rooms, doors, rotated-rooms, rotated-doors, traps, corridors, straight-corridors,
    /// furnished, glazed, moving-cylinders, people, meeting; a mission file, a ROS map (.yaml), a
    /// BARN .world or cylinders.csv; or a folder of such files.
    #[arg(long, default_value = "rooms")]
    worlds: String,
    /// Number of worlds; by default 100 if drawn, all if read, and ten starts and targets on a map
    /// without any.
    #[arg(long)]
    count: Option<usize>,
    /// Start and heading of the robot on a ROS map, in the map's metres and degrees.
    #[arg(long, value_name = "X,Y,DEG", requires = "target", allow_hyphen_values = true, value_parser = numbers::<3>)]
    start: Option<[f64; 3]>,
    /// Target on a ROS map, in the map's metres.
    #[arg(long, value_name = "X,Y", requires = "start", allow_hyphen_values = true, value_parser = numbers::<2>)]
    target: Option<[f64; 2]>,
    /// Seed of the worlds and their noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of missions on each world, each with its own noise.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    repeats: u64,
    /// Method: evidential or paper. Several methods, separated by commas, are compared on the same
    /// worlds.
    #[arg(long, value_delimiter = ',', default_value = "evidential")]
    method: Vec<String>,
    /// Planner: harmonic; the baseline wavefront (shortest paths); or any planner executable.
    /// Several planners, separated by commas, are compared on the same worlds.
    #[arg(long, value_delimiter = ',', default_value = HARMONIC)]
    planner: Vec<String>,
    /// Sensors of the evidential method: front (the front sonar), front+infrared, three-front (the
    /// front sonar and its two neighbours), laser or all, the default. The paper's method only has
    /// the front sonar. Several values, separated by commas, are compared on the same worlds.
    #[arg(long, value_delimiter = ',')]
    sensors: Vec<String>,
    /// Realism of the simulator: laboratory, measured or harsh.
    #[arg(long, default_value = "measured")]
    realism: String,
    /// Calibrate each mission's robot first, by `firsthand calibrate`. If calibration fails,
    /// standard error says why, and the mission runs uncalibrated.
    #[arg(long)]
    calibrate: bool,
    /// Robot model.
    #[arg(long, default_value = "x80")]
    robot: String,
    /// Set a key of every mission; repeatable.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Further setting to compare with the first on the same worlds: KEY=VALUE over it, several
    /// with commas.
    #[arg(long, value_name = "KEY=VALUE,...")]
    versus: Vec<String>,
    /// Drive on a wall clock, R times as fast, where more causes may stop the robot. Such missions
    /// do not repeat bit for bit.
    #[arg(long, value_name = "R", default_value = "max")]
    pace: Pace,
    /// Number of missions at once; by default one per processor.
    #[arg(long)]
    jobs: Option<NonZero<usize>>,
    /// Drive each mission through real processes, which also measures latencies, not in one process.
    #[arg(long)]
    processes: bool,
    /// Directory of rows, worlds, pictures and the page.
    #[arg(long, value_name = "DIR", default_value = "evaluation")]
    out: PathBuf,
    /// Resume the evaluation in the directory of --out, which the same command must have begun.
    #[arg(long)]
    resume: bool,
    /// Print only one line of JSON, at the end, on standard output. It describes the first setting;
    /// `versus` has the others.
    #[arg(long)]
    json: bool,
}

pub fn main(arguments: &Arguments) -> Result {
    let settings = settings(arguments)?;
    let Arguments { start, target, seed, .. } = *arguments;
    let ends = start.zip(target).map(|([x, y, heading_deg], target)| Ends {
        start: DVec2::new(x, y),
        heading: heading_deg.to_radians(),
        target: target.into(),
    });
    // Invalid keys are refused before the first mission.
    let robots: Result<Vec<_>, _> = settings
        .iter()
        .map(|setting| missions::parsed("target = [1, 0]", "its missions", &setting.set))
        .collect();
    let swept_m = swept_m(&robots?[0]);
    let asked = Asked { count: arguments.count, seed, ends, swept_m };
    // A damaged world is no error of the mission on the command line.
    let found = worlds::find(&arguments.worlds, asked).map_err(|error| error.to_string())?;
    let mut results = Results::open(&arguments.out, arguments.resume)?;
    write_stderr(&format!(
        "{} worlds that the robot's body can cross on a 5 cm grid ({} others skipped)\n",
        found.trials.len(),
        found.unsolvable
    ));
    let plan = Plan {
        trials: found.trials,
        settings,
        repeats: arguments.repeats,
        noise: NoiseSeeds::Derived(seed),
        jobs: arguments.jobs,
        pace: arguments.pace,
        pictured_seed: None,
        calibrates: arguments.calibrate,
        processes: arguments.processes,
    };
    runner::run(&plan, &mut results, "evaluation")?;
    results.sort()?;
    let report = report::report(&plan.settings, &results.rows.rows);
    report::save_page(&results, &report)?;
    crate::print(&report, arguments.json)
}

/// Parses `N` comma-separated numbers up to 1000 km.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let parsed: Option<Vec<f64>> = text.split(',').map(ends::number).collect();
    let numbers = parsed.and_then(|it| it.try_into().ok());
    numbers.ok_or_else(|| format!("give {N} numbers, separated by commas"))
}

/// Returns names and assignments of each method with each sensor set. The paper's method only has
/// the sonar.
fn methods(arguments: &Arguments) -> Vec<(String, Vec<String>)> {
    let mut methods = Vec::new();
    for method in &arguments.method {
        let set = format!("method='{method}'");
        if arguments.sensors.is_empty() || method == "paper" {
            methods.push((method.clone(), vec![set]));
            continue;
        }
        for sensors in &arguments.sensors {
            let set = vec![set.clone(), format!("sensors='{sensors}'")];
            methods.push((format!("{method} {sensors}"), set));
        }
    }
    methods
}

fn settings(arguments: &Arguments) -> Result<Vec<Setting>> {
    let Arguments { realism, robot, planner: planners, .. } = arguments;
    let common = [format!("simulation.realism='{realism}'"), format!("robot.model='{robot}'")];
    let methods = methods(arguments);
    let mut settings = Vec::new();
    for planner in planners {
        let mut executable = Vec::new();
        if planner != HARMONIC {
            planner_executable::find_planner(Path::new(planner), BASELINES)?;
            executable.push(format!("planner.executable={}", toml::Value::from(&**planner)));
        }
        for (method, chosen) in &methods {
            let set = [&common, &*arguments.set, chosen, &executable].concat();
            let name = match (&planners[..], &methods[..]) {
                ([_], _) if executable.is_empty() => method.clone(),
                (_, [_]) => planner.clone(),
                _ => format!("{planner} {method}"),
            };
            settings.push(Setting { name, planner: planner.clone(), set });
        }
    }
    for versus in &arguments.versus {
        let mut setting = Setting { name: versus.clone(), ..settings[0].clone() };
        setting.set.extend(versus.split(',').map(str::to_owned));
        settings.push(setting);
    }
    Ok(settings)
}
