//! `firsthand evaluate`: how often a robot arrives, on many worlds, judged by the ground truth.

use std::{
    num::NonZero,
    path::{Path, PathBuf},
};

use clap::Args;
use common::mission::{Mission, Model};
use console::{
    failure::Failure,
    output::{print_text, write_stderr},
};
use glam::DVec2;
use processes::planner_executable;
use serde_json::{Value, json};

use crate::{
    baselines::stage::BASELINES,
    missions::{
        directory,
        report::{self, Report},
        results::Results,
        runner::{self, NoiseSeeds, Plan, processors},
        setting::{HARMONIC, Setting},
        statistics::Estimate,
        totals::Totals,
        trial::BodySize,
    },
    worlds::{self, Ends, Worlds},
};

/// Run missions on many worlds and count successes by the ground truth, with 95 % intervals, a picture and a page of every failure.
/// Worlds and noise follow from the seed.
#[derive(Debug, Args)]
pub struct Arguments {
    /// rooms, doors, rotated-rooms, rotated-doors, traps, corridors, straight-corridors, furnished, glazed, moving-cylinders; a mission file, a ROS map (.yaml), a BARN .world or
    /// cylinders.csv; a folder of such files.
    #[arg(long, default_value = "rooms")]
    worlds: Worlds,
    /// Number of worlds; by default 100 if they are drawn, all if they are read, ten starts and targets on a map without any.
    #[arg(long)]
    count: Option<usize>,
    /// On a ROS map: start and heading of the robot, metres and degrees of the map.
    #[arg(long, value_name = "X,Y,DEG", requires = "target", allow_hyphen_values = true, value_parser = numbers::<3>)]
    start: Option<[f64; 3]>,
    /// On a ROS map: the target, metres of the map.
    #[arg(long, value_name = "X,Y", requires = "start", allow_hyphen_values = true, value_parser = numbers::<2>)]
    target: Option<[f64; 2]>,
    /// Seed of the worlds and of the noise in them.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Missions on each world, each with noise of its own.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    repeats: u64,
    /// evidential or paper; several, with commas, are compared on the same worlds.
    #[arg(long, value_delimiter = ',')]
    method: Vec<String>,
    /// harmonic; the baselines wavefront (shortest paths) and bug (Bug2); any executable of a planner. Several, with
    /// commas, are compared on the same worlds.
    #[arg(long, value_delimiter = ',', default_value = HARMONIC)]
    planner: Vec<String>,
    /// front (the front sonar alone), front+infrared, three-front (the front sonar and the two beside it), laser or all, the default: what the
    /// evidential method senses; the paper's has the front sonar alone. Several, with commas, are compared on the same worlds.
    #[arg(long, value_delimiter = ',')]
    sensors: Vec<String>,
    /// laboratory, measured or harsh.
    #[arg(long, default_value = "measured")]
    realism: String,
    /// Calibrate the robot of each mission before it, by `firsthand calibrate`. Where that fails the mission runs as it is.
    #[arg(long)]
    calibrate: bool,
    /// The robot's model.
    #[arg(long, default_value = "x80")]
    robot: String,
    /// Set a key of every mission, as often as needed.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// A further setting to compare with the first on the same worlds: KEY=VALUE over it, several with commas.
    #[arg(long, value_name = "KEY=VALUE,...")]
    versus: Vec<String>,
    /// Missions at once; by default one for each processor.
    #[arg(long)]
    jobs: Option<NonZero<usize>>,
    /// The directory of rows, worlds, pictures and the page.
    #[arg(long, value_name = "DIR", default_value = "evaluation")]
    out: PathBuf,
    /// Go on with the evaluation in the directory of --out, which the same command must have begun.
    #[arg(long)]
    resume: bool,
    /// Print one line of JSON at the end, and nothing else on standard output. It is about the first setting; `versus` has the
    /// others.
    #[arg(long)]
    json: bool,
}

/// Free ground on both sides of the body in the narrowest way of a world, metres.
const MARGIN_M: f64 = 0.05;

pub fn main(arguments: &Arguments) -> Result<(), Failure> {
    let settings = settings(arguments)?;
    let described = described(arguments, &settings);
    let directory = directory::claim(&arguments.out, &described, arguments.resume)?;
    let found = worlds::find(
        &arguments.worlds,
        arguments.count,
        arguments.seed,
        arguments.ends(),
        &body(&arguments.robot, &arguments.set)?,
    )?;
    let plan = Plan {
        trials: found.trials,
        settings,
        repeats: arguments.repeats,
        noise: NoiseSeeds::Derived(arguments.seed),
        jobs: processors(arguments.jobs),
        pictured_seed: None,
        calibrates: arguments.calibrate,
        directory,
    };
    write_stderr(&format!(
        "{} worlds, each crossed by the body on a grid of 5 cm ({} others were left out)\n",
        plan.trials.len(),
        found.unsolvable
    ));
    let mut results = Results::open(&plan.directory)?;
    runner::run(&plan, &mut results, "")?;
    results.sort()?;
    let page = directory::save_page(&plan.directory, &report::html(&plan, &results, &described))?;
    let report = Report::new(&plan, results.rows.rows());
    let text = if arguments.json {
        format!("{}\n", object(&report))
    } else {
        format!("{report}rows and pictures: {}\n", page.display())
    };
    Ok(print_text(&text)?)
}

impl Arguments {
    fn ends(&self) -> Option<Ends> {
        let ([x, y, heading_deg], [to_x, to_y]) = (self.start?, self.target?);
        Some(Ends {
            start: DVec2::new(x, y),
            heading: heading_deg.to_radians(),
            target: DVec2::new(to_x, to_y),
        })
    }
}

/// `N` numbers between commas, none beyond 1000 km.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let parsed: Result<Vec<f64>, _> = text.split(',').map(|it| it.trim().parse()).collect();
    let numbers = parsed.ok().and_then(|it| <[f64; N]>::try_from(it).ok());
    numbers
        .filter(|numbers| numbers.iter().all(|number| number.abs() <= 1e6))
        .ok_or_else(|| format!("give {N} numbers with commas between them"))
}

fn described(arguments: &Arguments, settings: &[Setting]) -> String {
    let worlds = &arguments.worlds;
    let count = arguments.count.map_or(String::new(), |count| format!(" --count {count}"));
    let ends = match (arguments.start, arguments.target) {
        (Some([x, y, deg]), Some([to_x, to_y])) => {
            format!(" --start {x},{y},{deg} --target {to_x},{to_y}")
        }
        _ => String::new(),
    };
    let settings: Vec<String> = settings
        .iter()
        .map(|setting| format!("{}: {}", setting.name, setting.set.join(" ")))
        .collect();
    format!(
        "firsthand evaluate --worlds {worlds}{ends}{count} --seed {} --repeats {} --robot {}{} [{}]",
        arguments.seed,
        arguments.repeats,
        arguments.robot,
        if arguments.calibrate { " --calibrate" } else { "" },
        settings.join("; ")
    )
}

/// The methods to compare, each as a name and its assignments: each method with each of the sensors, but the paper's method
/// once, because it has only the sonar.
fn methods(arguments: &Arguments) -> Vec<(String, Vec<String>)> {
    let methods = match &arguments.method[..] {
        [] => vec!["evidential".to_owned()],
        methods => methods.to_vec(),
    };
    let with_sensors = |method: String| {
        let set = format!("method='{method}'");
        if arguments.sensors.is_empty() || method == "paper" {
            return vec![(method, vec![set])];
        }
        let sensors = arguments.sensors.iter();
        sensors
            .map(|sensors| {
                let sensed = format!("sensors='{sensors}'");
                (format!("{method} {sensors}"), vec![set.clone(), sensed])
            })
            .collect()
    };
    methods.into_iter().flat_map(with_sensors).collect()
}

/// The settings to compare, each planner by each method; the others are compared with the first.
fn settings(arguments: &Arguments) -> Result<Vec<Setting>, Failure> {
    let mut set = vec![
        format!("simulation.realism='{}'", arguments.realism),
        format!("robot.model='{}'", arguments.robot),
    ];
    set.extend(arguments.set.iter().cloned());
    let methods = methods(arguments);
    let mut settings = Vec::new();
    for planner in &arguments.planner {
        let executable = executable(planner)?;
        for (method, chosen) in &methods {
            let mut set = [&set[..], chosen].concat();
            set.extend(executable.clone());
            settings.push(Setting {
                name: match (&arguments.planner[..], &methods[..]) {
                    ([_], _) if planner == HARMONIC => method.clone(),
                    (_, [_]) => planner.clone(),
                    _ => format!("{planner} {method}"),
                },
                planner: planner.clone(),
                set,
            });
        }
    }
    for versus in &arguments.versus {
        let first = settings[0].clone();
        let more = versus.split(',').map(str::to_owned);
        settings.push(Setting {
            name: versus.clone(),
            set: first.set.into_iter().chain(more).collect(),
            ..first
        });
    }
    Ok(settings)
}

/// The assignment for the planner of that name; none for the planner of `firsthand`.
fn executable(planner: &str) -> Result<Option<String>, Failure> {
    if planner == HARMONIC {
        return Ok(None);
    }
    // A missing executable is reported before anything starts.
    planner_executable::find_planner(Path::new(planner), BASELINES)?;
    let value = toml::Value::from(planner);
    Ok(Some(format!("planner.executable={value}")))
}

/// The body that must fit through every world, by the robot's model and the changes in `set`.
fn body(robot: &str, set: &[String]) -> Result<BodySize, Failure> {
    let radius = set.iter().rfind(|assignment| assignment.starts_with("robot.radius_m"));
    let radius = radius.map_or("", String::as_str);
    let text = format!("target = [1, 0]\nrobot.model = '{robot}'\n{radius}");
    let mission = Mission::parse(&text, Path::new("--robot"))?;
    let _: Model = mission.robot.model;
    Ok(BodySize { radius_m: mission.body().radius_m, margin_m: MARGIN_M })
}

fn object(report: &Report) -> Value {
    let mut objects = report.totals.iter().map(Totals::object);
    let mut object = objects.next().unwrap_or_default();
    let interval = |of: Estimate| [of.value, of.low, of.high];
    let others: Vec<Value> = objects
        .zip(&report.comparisons)
        .map(|(totals, comparison)| {
            json!({
                "totals": totals,
                "pairs": comparison.pairs,
                "success_change": interval(comparison.success),
                "collision_change": interval(comparison.collision),
                "time_ratio": comparison.time_ratio,
            })
        })
        .collect();
    if !others.is_empty() {
        object["versus"] = others.into();
    }
    object
}
