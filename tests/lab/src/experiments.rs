//! `firsthand experiments`: the paper's experiments, repeated with many seeds, beside the paper's values.

mod report;
mod table;

use std::{num::NonZero, path::PathBuf};

use clap::Args;
use common::{clock::Pace, mission::Odometry};

use crate::{
    error::Result,
    missions::{
        HARMONIC, Setting,
        results::Results,
        runner::{self, NoiseSeeds, Plan},
    },
};
use table::METHODS;

/// Repeat the paper's experiments with its method and the default one, and compare the results with
/// the paper's.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Number of missions per experiment and method, with noise seeds from 1.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: u64,
    /// Experiments to run, with commas: 1a, 1b, 2, 3, 4-180, 4-90, 4-0, 5-constant, 5-modulated.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    only: Vec<String>,
    /// measured or harsh: the errors of real robots, and the radio out 20 % of the time; or
    /// laboratory.
    #[arg(long, default_value = "measured", value_parser = ["measured", "harsh", LABORATORY])]
    realism: String,
    /// Number of missions at once; by default one per processor.
    #[arg(long)]
    jobs: Option<NonZero<usize>>,
    /// Drive each mission through real processes, which also measures latencies, not in one process.
    #[arg(long)]
    processes: bool,
    /// Directory of rows, missions, pictures and the page.
    #[arg(long, value_name = "DIR", default_value = "experiments")]
    out: PathBuf,
    /// Resume the experiments in the directory of --out, which the same command must have begun.
    #[arg(long)]
    resume: bool,
    /// Print only one line of JSON per experiment on standard output.
    #[arg(long)]
    json: bool,
}

const LABORATORY: &str = "laboratory";
const FIRST_SEED: u64 = 1;
/// Radio outage except with laboratory realism. The paper's link fades by an unstated amount.
const OUTAGE: &str = "simulation.radio.outage_share=0.2";

/// Returns the odometry deviations of unmeasured wheels. The paper's mission files state ideal
/// ones, which other realism makes false.
fn uncalibrated() -> [String; 3] {
    let Odometry { diameter_ratio_sd, track_scale_sd, distance_scale_sd, .. } = Odometry::default();
    [
        format!("robot.odometry.diameter_ratio_sd={diameter_ratio_sd}"),
        format!("robot.odometry.track_scale_sd={track_scale_sd}"),
        format!("robot.odometry.distance_scale_sd={distance_scale_sd}"),
    ]
}

pub fn main(arguments: &Arguments) -> Result {
    let Arguments { seeds, realism, .. } = arguments;
    let chosen = table::named(&arguments.only)?;
    let mut results = Results::open(&arguments.out, arguments.resume)?;
    for (method, own) in METHODS {
        let mut set: Vec<_> = own.iter().map(|&text| text.to_owned()).collect();
        if realism != LABORATORY {
            set.extend([format!("simulation.realism='{realism}'"), OUTAGE.to_owned()]);
            set.extend(uncalibrated());
        }
        let its = chosen.iter().filter(|it| it.is_run_by(method));
        let plan = Plan {
            pace: Pace::Max,
            calibrates: false,
            processes: arguments.processes,
            trials: its.map(|it| it.trial()).collect::<Result<_>>()?,
            settings: vec![Setting { name: method.to_owned(), planner: HARMONIC.to_owned(), set }],
            repeats: *seeds,
            noise: NoiseSeeds::Counted(FIRST_SEED),
            pictured_seed: Some(FIRST_SEED),
            jobs: arguments.jobs,
        };
        runner::run(&plan, &mut results, method)?;
    }
    results.sort()?;
    let report = report::report(&chosen, &results.rows.rows)?;
    report::save_page(&results, &chosen, &report)?;
    report.iter().try_for_each(|object| crate::print(object, arguments.json))
}
