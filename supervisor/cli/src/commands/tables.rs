//! `firsthand topics`, `stages`, `failsafe` and `faults`: the tables, as the guide shows them.

use std::{fmt::Write as _, process::ExitCode};

use clap::Args;
use common::{
    faults,
    topics::{self, AnyTopic, Logged, Rate},
};
use x80_link::failsafe;

use super::{Failure, print_text, python};
use supervisor::stages;

/// Print the table of topics.
#[derive(Debug, Args)]
pub(crate) struct TopicArguments {
    /// Print a module for consumers in Python instead: the structs of all topics, and a class that follows a robot.
    #[arg(long)]
    python: bool,
}

/// Print the table of stages.
#[derive(Debug, Args)]
pub(crate) struct StageArguments {}

/// Print the table of what slows the robot, stops it or ends its mission.
#[derive(Debug, Args)]
pub(crate) struct FailsafeArguments {}

/// Print the table of faults.
#[derive(Debug, Args)]
pub(crate) struct FaultArguments {}

pub(crate) fn topics(arguments: &TopicArguments) -> Result<ExitCode, Failure> {
    print_text(&if arguments.python {
        python::module()
    } else {
        topic_table()
    })?;
    Ok(ExitCode::SUCCESS)
}

pub(crate) fn stages(_: &StageArguments) -> Result<ExitCode, Failure> {
    print_text(&stage_table())?;
    Ok(ExitCode::SUCCESS)
}

pub(crate) fn failsafe(_: &FailsafeArguments) -> Result<ExitCode, Failure> {
    print_text(&failsafe_table())?;
    Ok(ExitCode::SUCCESS)
}

pub(crate) fn faults(_: &FaultArguments) -> Result<ExitCode, Failure> {
    print_text(&fault_table())?;
    Ok(ExitCode::SUCCESS)
}

/// The topics as a Markdown table.
fn topic_table() -> String {
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
fn stage_table() -> String {
    let mut table = String::from(
        "| stage | reads | writes | ready within | beats within | answers within | each, for a million cells more | while it is down the robot |\n|---|---|---|---|---|---|---|---|\n",
    );
    for stage in &stages::TABLE {
        let list = |topics: &[&dyn AnyTopic]| {
            let names: Vec<_> = topics
                .iter()
                .map(|topic| format!("`{}`", topic.spec().name))
                .collect();
            names.join(", ")
        };
        let reads: Vec<&dyn AnyTopic> =
            stage.inputs.iter().chain(stage.feedback).copied().collect();
        let _ = writeln!(
            table,
            "| `{}` | {} | {} | {} ms | {} ms | {} ms | {} ms | {} |",
            stage.name,
            list(&reads),
            list(stage.outputs),
            stage.deadlines.startup.as_millis(),
            stage.deadlines.heartbeat.as_millis(),
            stage.deadlines.answers.as_millis(),
            stage.per_million_cells.as_millis(),
            stage.while_down
        );
    }
    table
}

/// The rules of the link's failsafe as a Markdown table.
fn failsafe_table() -> String {
    let mut table = String::from("| cause | when | the robot | until |\n|---|---|---|---|\n");
    for rule in failsafe::TABLE {
        let _ = writeln!(
            table,
            "| {} | {} | {} | {} |",
            rule.name,
            rule.when,
            failsafe::effect(rule.action),
            rule.until
        );
    }
    table
}

/// The faults as a Markdown table.
fn fault_table() -> String {
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
            ("topics", topic_table()),
            ("stages", stage_table()),
            ("failsafe", failsafe_table()),
            ("faults", fault_table()),
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
