use std::path::PathBuf;

use clap::Args;
use common::{domain::RobotName, samples::DoubtsSample, topics::DOUBTS};
use console::{
    failure::Result,
    output::{print_line, print_rows},
    runs,
    table::Table,
};
use recording::Recording;
use serde::Serialize;

/// Show the evidence of a run's link against a healthy robot.
///
/// Each doubt has its greatest evidence, the mission time of that, and its course over the run. At
/// 1 the robot stands. In lockstep, a simulated robot is not doubted.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Recording, or the directory of its run, instead of the robot's current or newest run.
    #[arg(value_name = "RUN|RUN.mcap")]
    run: Option<PathBuf>,
    /// Name of the robot.
    #[arg(long, default_value_t, conflicts_with = "run")]
    robot: RobotName,
    /// Directory that holds the directories of runs.
    #[arg(long, value_name = "DIR", default_value = "runs", conflicts_with = "run")]
    runs: PathBuf,
    /// Print a line of JSON per doubt, with all evidence.
    #[arg(long)]
    json: bool,
}

/// Of a course.
const COLUMNS: usize = 40;
const LEVELS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

#[derive(Serialize)]
struct Doubt {
    doubt: &'static str,
    meaning: &'static str,
    greatest: f64,
    /// Mission time of the greatest, seconds.
    at_s: f64,
    /// Mission times, seconds, and evidence other than 0.
    evidence: Vec<(f64, f64)>,
}

impl Doubt {
    /// Draws the greatest evidence in each part of the time up to `end_s`.
    fn course(&self, end_s: f64) -> String {
        let mut parts = [0.0_f64; COLUMNS];
        for (at_s, evidence) in &self.evidence {
            let part = (at_s / end_s * COLUMNS as f64) as usize;
            let part = &mut parts[part.min(COLUMNS - 1)];
            *part = part.max(*evidence);
        }
        let level = |part: f64| (part * (LEVELS.len() - 1) as f64).ceil() as usize;
        parts.map(|part| LEVELS[level(part).min(LEVELS.len() - 1)]).into_iter().collect()
    }
}

pub fn main(arguments: &Arguments) -> Result {
    let current = || runs::current_or_newest(&arguments.runs, &arguments.robot);
    let run = arguments.run.clone().map_or_else(current, Ok)?;
    let mut doubts: Vec<Doubt> = DoubtsSample::default()
        .each()
        .into_iter()
        .map(|(doubt, meaning, _)| Doubt {
            doubt,
            meaning,
            greatest: 0.0,
            at_s: 0.0,
            evidence: Vec::new(),
        })
        .collect();
    let mut end_s = 0.0_f64;
    for sample in Recording::open(&run)?.samples(&DOUBTS)? {
        let sample = sample?;
        let at_s = sample.stamp.seconds();
        end_s = end_s.max(at_s);
        for (doubt, (.., evidence)) in doubts.iter_mut().zip(sample.each()) {
            if evidence > doubt.greatest {
                (doubt.greatest, doubt.at_s) = (evidence, at_s);
            }
            if evidence != 0.0 {
                doubt.evidence.push((at_s, evidence));
            }
        }
    }
    doubts.sort_by(|one, other| other.greatest.total_cmp(&one.greatest));
    if !arguments.json && doubts.iter().all(|doubt| doubt.greatest == 0.0) {
        return print_line(
            "no evidence against the robot, or the recording is older than the topic `doubts`",
        );
    }
    let mut table = Table::new(["doubt", ">greatest", ">at", "course", "meaning"]);
    for doubt in doubts.iter().filter(|doubt| doubt.greatest > 0.0) {
        let (greatest, at) = (format!("{:.2}", doubt.greatest), format!("{:.1} s", doubt.at_s));
        table.row([&doubt.doubt, &greatest, &at, &doubt.course(end_s), &doubt.meaning]);
    }
    print_rows(&doubts, arguments.json, table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_course_shows_the_greatest_evidence_of_each_part_of_the_run() {
        let evidence = vec![(0.0, 0.1), (0.1, 0.5), (40.0, 2.0), (20.0, 1e-3)];
        let doubt = Doubt { doubt: "deaf", meaning: "", greatest: 2.0, at_s: 40.0, evidence };
        let course = format!("▄{:19}▁{:18}█", "", "");
        assert_eq!(doubt.course(40.0), course);
    }
}
