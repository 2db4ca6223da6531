//! `firsthand experiments`: the paper's experiments, repeated with many seeds.

use std::{fmt::Write as _, fs, num::NonZero, path::PathBuf};

use clap::Args;
use common::{file::FileError, mission::Realism};
use evaluation::{
    directory::{self, PAGE_FILE},
    experiments::{
        experiment::{self, Experiment},
        method::Method,
        report::Report,
    },
    results::Results,
    runner::{self, NoiseSeeds, Plan},
    trial::Trial,
};

use crate::mission_progress::{MissionProgress, jobs};
use console::{failure::Failure, output::print_text};

/// Repeat the paper's experiments with its method and with the default one, and compare the results with those of the paper.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Missions of each experiment and method, with noise seeds from 1 on.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: u64,
    /// Some of the experiments, with commas: 1a, 1b, 2, 3, 4-180, 4-90, 4-0, 5-constant, 5-modulated.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    only: Vec<String>,
    /// measured or harsh: the errors of real robots, and the radio out 20 % of the time; or laboratory.
    #[arg(long, default_value = "measured", value_parser = realism)]
    realism: Realism,
    /// Missions at once; by default one for each processor.
    #[arg(long)]
    jobs: Option<NonZero<usize>>,
    /// The directory of rows, missions, pictures and the page.
    #[arg(long, value_name = "DIR", default_value = "experiments")]
    out: PathBuf,
    /// Go on with the experiments in the directory of --out, which the same command must have begun.
    #[arg(long)]
    resume: bool,
    /// Print one line of JSON for each experiment, and nothing else on standard output.
    #[arg(long)]
    json: bool,
}

/// The first noise seed, whose missions are drawn.
const FIRST_SEED: u64 = 1;

fn realism(text: &str) -> Result<Realism, String> {
    let named = Realism::ALL.into_iter().find(|realism| realism.as_str() == text);
    named.ok_or_else(|| "give laboratory, measured or harsh".to_owned())
}

pub(crate) fn main(arguments: &Arguments) -> Result<(), Failure> {
    let chosen = experiment::named(&arguments.only)?;
    let described = described(arguments, &chosen);
    let directory = directory::claim(&arguments.out, &described, arguments.resume)?;
    let mut results = Results::open(&directory)?;
    for method in Method::ALL {
        let its = chosen.iter().filter(|it| it.is_run_by(method));
        let trials: Vec<Trial> = its.map(|it| it.trial()).collect::<Result<_, _>>()?;
        let plan = Plan {
            calibrates: false,
            trials,
            settings: vec![method.setting(arguments.realism)],
            repeats: arguments.seeds,
            noise: NoiseSeeds::Counted(FIRST_SEED),
            pictured_seed: Some(FIRST_SEED),
            jobs: jobs(arguments.jobs),
            directory: directory.clone(),
        };
        let mut console = MissionProgress::new(&format!("{}: ", method.as_str()));
        runner::run(&plan, &mut results, &mut |progress| console.show(progress))?;
        console.end();
    }
    results.sort()?;
    let report = Report::new(&chosen, results.rows.rows());
    let page = directory.join(PAGE_FILE);
    fs::write(&page, report.html(&described, FIRST_SEED)).map_err(FileError::of("write", &page))?;
    let mut text = String::new();
    if arguments.json {
        for object in report.objects() {
            writeln!(text, "{object}")?;
        }
    } else {
        writeln!(text, "{report}rows and pictures: {}", page.display())?;
    }
    Ok(print_text(&text)?)
}

/// The command that gives these rows.
fn described(arguments: &Arguments, chosen: &[&Experiment]) -> String {
    let names: Vec<_> = chosen.iter().map(|it| it.name).collect();
    let realism = arguments.realism.as_str();
    format!(
        "firsthand experiments --seeds {} --only {} --realism {realism}",
        arguments.seeds,
        names.join(",")
    )
}
