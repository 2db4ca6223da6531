//! `firsthand table`, and the tables of topics and stages: Markdown, as the guide shows it.

use std::{fmt::Write as _, process::ExitCode};

use clap::{Args, Subcommand};
use common::{
    faults,
    topics::{self, Logged, Rate},
    wiring::{EVERY_STAGE_READS, EVERY_STAGE_WRITES, Persists, Topics},
};
use supervisor::stages;
use x80_link::failsafe;

use crate::console::{failure::Failure, output::print_text};

/// Print the tables of the failsafe and of the faults.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    table: Table,
}

#[derive(Debug, Subcommand)]
enum Table {
    /// Print what slows the robot, stops it or ends its mission.
    Failsafe,
    /// Print the faults that can be put into stages (`firsthand stage fault`).
    Faults,
}

pub(crate) fn main(arguments: &Arguments) -> Result<ExitCode, Failure> {
    print_text(&match arguments.table {
        Table::Failsafe => failsafe(),
        Table::Faults => faults(),
    })?;
    Ok(ExitCode::SUCCESS)
}

/// The topics as a Markdown table.
pub(super) fn topics() -> String {
    let mut table = String::from(
        "| topic | payload | written by | rate | logged | meaning |\n|---|---|---|---|---|---|\n",
    );
    for topic in topics::TABLE {
        let spec = topic.spec();
        let rate = match spec.rate {
            Rate::EachTick => "each tick".to_owned(),
            Rate::EachFrame => "each frame of the robot".to_owned(),
            Rate::WhenItHappens => "when it happens".to_owned(),
            Rate::OnChange {
                at_most_every,
                again_after,
            } => {
                let limit = match at_most_every.as_millis() {
                    0 => String::new(),
                    limit => format!(" at most every {limit} ms"),
                };
                format!(
                    "on change{limit}, again after {} ms",
                    again_after.as_millis()
                )
            }
        };
        let logged = match spec.logged {
            Logged::Yes => "yes",
            Logged::WithFields => "with `--fields`",
        };
        // Writing to a String cannot fail.
        let _ = writeln!(
            table,
            "| `{}` | `{}` | {} | {rate} | {logged} | {} |",
            spec.name,
            topic.payload(),
            spec.writer,
            spec.meaning.trim()
        );
    }
    table
}

/// The stages as a Markdown table.
pub(super) fn stages() -> String {
    let mut table = String::from(
        "| stage | reads | is woken by | writes | persists | ready within | beats within | answers within | each, for a million cells more | while it is down the robot |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    let list = |topics: &[Topics]| {
        let topics = topics.iter().copied().flatten();
        let names: Vec<_> = topics
            .map(|topic| format!("`{}`", topic.spec().name))
            .collect();
        names.join(", ")
    };
    for stage in stages::TABLE {
        let wiring = stage.wiring;
        let _ = writeln!(
            table,
            "| `{}` | {} | {} | {} | {} | {} ms | {} ms | {} ms | {} ms | {} |",
            stage.name,
            list(&[wiring.inputs, wiring.feedback]),
            list(&[wiring.wakes]),
            list(&[wiring.outputs]),
            match wiring.persists {
                Persists::Nothing => "nothing".to_owned(),
                Persists::State(bytes) => format!("its state, {bytes} bytes"),
                Persists::Journal => "its inputs since a snapshot".to_owned(),
            },
            stage.deadlines.startup.as_millis(),
            stage.deadlines.heartbeat.as_millis(),
            stage.deadlines.answers.as_millis(),
            stage.per_million_cells.as_millis(),
            stage.while_down
        );
    }
    let (reads, writes) = (list(&[EVERY_STAGE_READS]), list(&[EVERY_STAGE_WRITES]));
    let _ = writeln!(
        table,
        "\nEvery stage also reads {reads} and writes {writes}."
    );
    table
}

/// The rules of the link's failsafe as a Markdown table.
fn failsafe() -> String {
    let mut table = String::from("| cause | when | the robot | until |\n|---|---|---|---|\n");
    for rule in failsafe::TABLE {
        let _ = writeln!(
            table,
            "| {} | {} | {} | {} |",
            rule.cause.name(),
            rule.when,
            rule.action.effect(),
            rule.clears
        );
    }
    table
}

/// The faults as a Markdown table.
fn faults() -> String {
    let mut table = String::from("| stage | fault | what it does | until |\n|---|---|---|---|\n");
    for fault in &faults::TABLE {
        let stage = fault
            .stage
            .map_or("any".to_owned(), |stage| format!("`{stage}`"));
        let _ = writeln!(
            table,
            "| {stage} | `{}` | {} | {} |",
            fault.name, fault.meaning, fault.ends
        );
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_guide_shows_the_tables_as_they_are() {
        let guide = include_str!("../../../guide/tables.md");
        let tables = [
            ("topic list", topics()),
            ("stage list", stages()),
            ("table failsafe", failsafe()),
            ("table faults", faults()),
        ];
        for (command, table) in tables {
            assert!(
                guide.contains(&table),
                "supervisor/guide/tables.md is behind; paste the output of `firsthand {command}`:\n{table}"
            );
        }
    }

    #[test]
    fn every_fault_is_of_a_stage_that_exists() {
        let its = faults::TABLE.iter().filter_map(|fault| fault.stage);
        for stage in its {
            assert!(stages::find(stage).is_some(), "{stage}");
        }
    }
}
