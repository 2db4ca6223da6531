//! Certificate of trials on real processes: attempts, losses, bounds.
//!
//! Each part runs on two robots at once.

mod fuzz;

use std::{collections::BTreeMap, fs, path::PathBuf, sync::LazyLock, thread, time::Instant};

use clap::{Args, Parser as _, ValueEnum as _, builder::PossibleValuesParser};
use console::output::{print_text, write_stderr};
use serde::{Deserialize, Serialize};
use simulation::RobotFault;

use crate::{
    chaos::{self, Judged},
    error::{OrCannot as _, Result},
    missions::{results::Table, runner::in_parallel, statistics::most_by_95_percent},
};

/// Test robots with signals and faults, and write attempts and failures to a page, with 95 %
/// bounds.
#[derive(Debug, Args)]
#[command(override_usage = "firsthand-lab certify [OPTIONS]")]
pub struct Arguments {
    /// Directory of the page and of `rows.csv`, which is appended to.
    #[arg(long, default_value = "certificate")]
    out: PathBuf,
    /// Share of the whole campaign to run now.
    #[arg(long, default_value_t = 0.001)]
    share: f64,
    /// Parts to run, separated by commas; by default all.
    #[arg(long, value_delimiter = ',', value_parser = PossibleValuesParser::new(PARTS.iter().map(|part| &*part.name)))]
    parts: Vec<String>,
    /// Number of inputs for the part `fuzz`, instead of its share.
    #[arg(long, value_name = "N")]
    inputs: Option<u32>,
}

#[derive(Deserialize)]
struct Part {
    name: String,
    what: String,
    whole: u32,
    /// Options of `firsthand bench chaos`, without numbers; none if it does not apply.
    options: Option<String>,
}

const FUZZ: &str = "fuzz";

static PARTS: LazyLock<Vec<Part>> =
    LazyLock::new(|| crate::rows(include_str!("certify/parts.csv").as_bytes()).unwrap_or_default());

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    part: String,
    seed: u64,
    tried: u64,
    lost: u64,
    worst: String,
    took_s: f64,
    version: String,
    processors: usize,
    command: String,
}

pub fn main(arguments: &Arguments) -> Result {
    let Arguments { out, share, parts, .. } = arguments;
    fs::create_dir_all(out).or_cannot_file("make", out)?;
    let mut rows = Table::open(out.join("rows.csv"))?;
    let before = rows.rows.len();
    let is_asked = |part: &&Part| parts.is_empty() || parts.contains(&part.name);
    for part in PARTS.iter().filter(is_asked) {
        write_stderr(&format!("{}: {}\n", part.name, part.what));
        let inputs = arguments.inputs.filter(|_| part.name == FUZZ);
        let share = inputs.map_or(*share, |inputs| f64::from(inputs) / f64::from(part.whole));
        // The row number determines the seed.
        let number = rows.rows.len() as u64;
        let tried =
            |number: &u64, _| one(part, share / 2.0, *number).map_err(|error| error.to_string());
        in_parallel(vec![number, number + 1], 2, tried, |row| rows.add(row?))?;
        let page = out.join("certificate.md");
        fs::write(&page, certificate(&rows.rows)).or_cannot_file("write", &page)?;
    }
    print_text(certificate(&rows.rows))?;
    match rows.rows[before..].iter().map(|row| row.lost).sum::<u64>() {
        0 => Ok(()),
        lost => Err(format!(
            "{lost} attempts of this command were lost; see rows.csv in {}",
            out.display()
        )
        .into()),
    }
}

#[derive(Debug, clap::Parser)]
struct Chaos {
    #[command(flatten)]
    asked: chaos::Arguments,
}

fn one(part: &Part, share: f64, number: u64) -> Result<Row> {
    let began = Instant::now();
    let many = (f64::from(part.whole) * share).ceil().max(1.0);
    let seed = 1 + number * 10_000;
    let (Judged { tried, lost, worst, .. }, command) = match &part.options {
        None => (
            fuzz::judge(many as u64, seed)?,
            format!("firsthand-lab certify --parts {FUZZ}, {many} of seed {seed}"),
        ),
        Some(options) => {
            let faults = RobotFault::value_variants().len() as f64;
            let count = match options.contains("--robot-faults") {
                true => format!("--missions {}", (many / faults).ceil()),
                false => format!("--kills {many}"),
            };
            let robot = format!("cert{}-{}", std::process::id(), number % 10);
            let words = format!("chaos {options} {count} --seed {seed} --robot {robot}");
            let asked = Chaos::try_parse_from(words.split(' ')).or_cannot("try")?.asked;
            (chaos::judge(&asked)?, format!("firsthand bench {words}"))
        }
    };
    Ok(Row {
        part: part.name.clone(),
        seed,
        tried,
        lost,
        worst,
        took_s: began.elapsed().as_secs_f64(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        processors: thread::available_parallelism().map_or(0, usize::from),
        command,
    })
}

fn certificate(rows: &[Row]) -> String {
    let mut parts: BTreeMap<&str, Vec<&Row>> = BTreeMap::new();
    for row in rows {
        parts.entry(&row.part).or_default().push(row);
    }
    let mut text = "| part | tried | lost | upper bound (95 %) | worst case | hours |\n|---|---|---|---|---|---|\n".to_owned();
    for (name, rows) in parts {
        let what = PARTS.iter().find(|part| part.name == name).map_or("", |part| &part.what);
        let sum = |of: fn(&Row) -> u64| rows.iter().map(|row| of(row)).sum::<u64>();
        let (tried, lost) = (sum(|row| row.tried), sum(|row| row.lost));
        let worst = rows.iter().rfind(|row| row.lost > 0).or(rows.last());
        let hours = rows.iter().map(|row| row.took_s).sum::<f64>() / 3600.0;
        text += &format!(
            "| {name}: {what} | {tried} | {lost} | {:.1e} | {} | {hours:.2} |\n",
            most_by_95_percent(lost, tried),
            worst.map_or("", |row| &row.worst).replace('|', "/"),
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_several_runs_add_up_and_the_worst_case_is_one_that_was_lost() {
        let row = |seed: u64, lost: u64, worst: &str| Row {
            part: "signals".to_owned(),
            seed,
            tried: 5000,
            lost,
            worst: worst.to_owned(),
            took_s: 3600.0,
            version: String::new(),
            processors: 2,
            command: String::new(),
        };
        let none = certificate(&[row(1, 0, "1 mm"), row(2, 0, "2 mm")]);
        assert!(none.contains("| 10000 | 0 | 3.0e-4 | 2 mm | 2.00 |"), "{none}");
        let one = certificate(&[row(1, 1, "touched"), row(2, 0, "2 mm")]);
        assert!(one.contains("| 10000 | 1 | 4.7e-4 | touched | 2.00 |"), "{one}");
    }

    #[test]
    fn every_part_is_a_chaos_that_its_options_allow() {
        for options in PARTS.iter().filter_map(|part| part.options.as_ref()) {
            let words = format!("chaos --seed 1 {options}");
            assert!(Chaos::try_parse_from(words.split(' ')).is_ok(), "{options}");
        }
    }
}
