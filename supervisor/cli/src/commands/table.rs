//! Tables as Markdown, as the guide shows them.

pub mod stored;

use clap::{Args, Subcommand};
use common::{
    faults,
    topics::{self, AnyTopic, Logged, Rate},
    wiring::{EVERY_STAGE_READS, EVERY_STAGE_WRITES, Persists, Topics},
};
use link::failsafe::{self, monitor::Clears};
use processes::stages;

use console::{failure::Result, item::item, output::print_text};

/// Print a table of the guide.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(subcommand)]
    table: Table,
}

#[derive(Debug, Subcommand)]
enum Table {
    /// Print the causes that slow or stop the robot or end its mission.
    Failsafe,
    /// Print the faults for `firsthand stage fault`.
    Faults,
    /// Print the measured results.
    Results,
    /// Print the guarantees and their tests.
    Capabilities,
    /// Print how other versions of files and robots are handled.
    Versions,
}

pub fn main(arguments: &Arguments) -> Result {
    print_text(match arguments.table {
        Table::Failsafe => failsafe(),
        Table::Faults => faults(),
        Table::Results => stored::results(),
        Table::Capabilities => {
            stored::markdown("capabilities", include_str!("../../../guide/capabilities.csv"))
        }
        Table::Versions => {
            stored::markdown("versions", include_str!("../../../guide/versions.csv"))
        }
    })
}

pub fn topics() -> String {
    topics::TABLE.iter().map(|topic| topic_row(*topic)).collect()
}

fn topic_row(topic: &dyn AnyTopic) -> String {
    let spec = topic.spec();
    let rate = match spec.rate {
        Rate::EachTick => "each tick".to_owned(),
        Rate::EachFrame => "each frame of the robot".to_owned(),
        Rate::WhenItHappens => "when it happens".to_owned(),
        Rate::OnChange { at_most_every, again_after } => {
            let limit = match at_most_every.as_millis() {
                0 => String::new(),
                limit => format!(" at most every {limit} ms"),
            };
            let again = again_after.as_millis();
            format!("on change{limit}, again after {again} ms")
        }
    };
    let logged = match spec.logged {
        Logged::Yes => "",
        Logged::No => "; not recorded",
        Logged::WithFields => "; recorded with `--fields`",
    };
    item(&format!(
        "`{}` (`{}`, {}, {rate}{logged}): {}",
        spec.name,
        topic.payload(),
        spec.writer,
        spec.meaning.trim()
    ))
}

pub fn stages() -> String {
    let list = |topics: &[Topics]| {
        topics
            .iter()
            .copied()
            .flatten()
            .map(|topic| format!("`{}`", topic.spec().name))
            .collect::<Vec<_>>()
            .join(", ")
    };
    let row = |stage: &stages::Stage| {
        let wiring = stage.wiring;
        let persists = match wiring.persists {
            Persists::Nothing => "nothing".to_owned(),
            Persists::State(bytes) => format!("its state, {bytes} bytes"),
            Persists::Journal => "its inputs since a snapshot".to_owned(),
        };
        let more = match stage.per_million_cells.as_millis() {
            0 => String::new(),
            more => format!(", {more} ms more for a million cells"),
        };
        item(&format!(
            "`{}` reads {}; is woken by {}; writes {}; persists {persists}; ready within {} ms, beats within {} ms, \
             answers within {} ms{more}; while it is down: {}",
            stage.name,
            list(&[wiring.inputs, wiring.feedback]),
            list(&[wiring.wakes]),
            list(&[wiring.outputs]),
            stage.deadlines.startup.as_millis(),
            stage.deadlines.heartbeat.as_millis(),
            stage.deadlines.answers.as_millis(),
            stage.while_down
        ))
    };
    let rows: String = stages::TABLE.iter().map(row).collect();
    let (reads, writes) = (list(&[EVERY_STAGE_READS]), list(&[EVERY_STAGE_WRITES]));
    rows + &item(&format!("every stage also reads {reads} and writes {writes}"))
}

pub fn failsafe() -> String {
    let row = |rule: &failsafe::Rule| {
        let until = match rule.clears {
            Clears::WithCondition => String::new(),
            clears => format!(" until {clears}"),
        };
        let (name, effect) = (rule.cause.name(), rule.action.effect());
        item(&format!("{name} ({effect}{until}): {}", rule.when))
    };
    failsafe::TABLE.iter().map(row).collect()
}

pub fn faults() -> String {
    let row = |fault: &faults::Fault| {
        let stage = fault.stage.unwrap_or("any stage");
        item(&format!("`{}` ({stage}): {}; until: {}", fault.name, fault.meaning, fault.ends))
    };
    faults::TABLE.iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_is_of_a_stage_that_exists() {
        let its = faults::TABLE.iter().filter_map(|fault| fault.stage);
        for stage in its {
            assert!(stages::find(stage).is_some(), "{stage}");
        }
    }
}
