//! The table of microseconds by stage and item, from the files in which the stages' processes save their times.

use std::{
    collections::BTreeMap,
    fmt::{self, Write as _},
    fs,
    path::Path,
};

use common::latency_budget::{self, Answers, Item, TickTimes};
use processes::stages;
use serde::Serialize;

use crate::error::BenchError;

/// The path of a tick: every stage of the table, then again those with feedback.
fn way() -> impl Iterator<Item = (&'static str, Answers)> {
    let stages = stages::TABLE.iter();
    let again = stages.clone().filter(|stage| stage.wiring.is_passed_twice());
    let first = stages.map(|stage| (stage.name, Answers::Inputs));
    first.chain(again.map(|stage| (stage.name, Answers::Feedback)))
}

#[derive(Debug, Default)]
pub(super) struct Budget {
    /// Nanoseconds of each row of [`way`], by column.
    rows: BTreeMap<(usize, &'static str), Vec<u64>>,
}

/// The column before those of [`Item`].
const WAKE: &str = "wake";

impl Budget {
    /// Add the times that the stages of the run in `directory` saved. A killed stage has saved none.
    pub(super) fn add(&mut self, directory: &Path) -> Result<(), BenchError> {
        let mut published = BTreeMap::new();
        for (row, (stage, answers)) in way().enumerate() {
            let times = load(directory, stage, answers)?;
            for times in &times {
                // If a tick was given twice, the sample that woke the stage is not known.
                if let Some(since) = published.get(&times.tick)
                    && times.awake_ns >= *since
                {
                    self.column(row, WAKE).push(times.awake_ns - since);
                }
                for (item, ns) in Item::ALL.into_iter().zip(times.items_ns) {
                    self.column(row, item.name()).push(ns);
                }
            }
            published = times.iter().map(|times| (times.tick, times.published_ns)).collect();
        }
        Ok(())
    }

    fn column(&mut self, row: usize, name: &'static str) -> &mut Vec<u64> {
        self.rows.entry((row, name)).or_default()
    }

    /// The rows, in the order of the path.
    pub(super) fn rows(mut self) -> Vec<Row> {
        let mut rows = Vec::new();
        for (row, (stage, answers)) in way().enumerate() {
            let mut cells = Vec::new();
            for name in columns() {
                let times = self.column(row, name);
                let quantile = |share| {
                    let us = times.iter().map(|&ns| ns as f64 / 1e3);
                    crate::quantile(us, share)
                };
                cells.push(Cell { item: name, p50_us: quantile(0.5), p99_us: quantile(0.99) });
            }
            rows.push(Row { stage, on_feedback: answers == Answers::Feedback, cells });
        }
        rows
    }
}

fn columns() -> impl Iterator<Item = &'static str> {
    std::iter::once(WAKE).chain(Item::ALL.map(Item::name))
}

/// The times that all generations of `stage` saved.
fn load(directory: &Path, stage: &str, answers: Answers) -> Result<Vec<TickTimes>, BenchError> {
    let mut all = Vec::new();
    for generation in 1.. {
        let file = latency_budget::file(directory, stage, generation);
        let Ok(text) = fs::read_to_string(&file) else {
            break;
        };
        for line in text.lines() {
            let times: TickTimes = line.parse().map_err(|problem| BenchError::Times {
                file: file.clone(),
                problem: format!("{problem}"),
            })?;
            if times.answers == answers {
                all.push(times);
            }
        }
    }
    Ok(all)
}

/// A stage's part of a tick, or its second part if it has feedback.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    stage: &'static str,
    on_feedback: bool,
    cells: Vec<Cell>,
}

/// The time of one item, microseconds; none if it was not measured.
#[derive(Debug, Serialize)]
struct Cell {
    item: &'static str,
    p50_us: Option<f64>,
    p99_us: Option<f64>,
}

/// The rows as a Markdown table, of `p50 / p99` microseconds.
#[derive(Debug)]
pub(super) struct Table<'a>(pub(super) &'a [Row]);

impl fmt::Display for Table<'_> {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(to, "us, p50 / p99; \"after\" is behind the tick")?;
        write!(to, "| {:<22} |", "stage")?;
        for name in columns() {
            write!(to, " {name:>11} |")?;
        }
        writeln!(to, "\n|---|{}", "---:|".repeat(columns().count()))?;
        for row in self.0 {
            let again = if row.on_feedback { ", command" } else { "" };
            write!(to, "| {:<22} |", format!("{}{again}", row.stage))?;
            for cell in &row.cells {
                write!(to, " {:>11} |", cell.to_string())?;
            }
            to.write_char('\n')?;
        }
        let of_tick = self.0.iter().flat_map(|row| &row.cells);
        let of_tick = of_tick.filter(|cell| cell.item != Item::After.name());
        let sum: f64 = of_tick.filter_map(|cell| cell.p50_us).sum();
        writeln!(to, "sum of the medians of a tick {sum:.0} us")
    }
}

impl fmt::Display for Cell {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.p50_us, self.p99_us) {
            (Some(p50), Some(p99)) => write!(to, "{p50:.1} / {p99:.0}"),
            _ => to.write_char('-'),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stage_of_the_table_has_a_row_and_every_item_a_column() {
        let rows = Budget::default().rows();
        for stage in stages::TABLE {
            let ways = rows.iter().filter(|row| row.stage == stage.name).count();
            let expected = if stage.wiring.is_passed_twice() { 2 } else { 1 };
            assert_eq!(ways, expected, "{}", stage.name);
        }
        for row in &rows {
            let items: Vec<_> = row.cells.iter().map(|cell| cell.item).collect();
            assert_eq!(items, columns().collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_wake_is_from_the_output_of_the_row_before_to_awake() {
        let directory = tempfile::tempdir().unwrap();
        let save = |stage, number, lines: &str| {
            let file = latency_budget::file(directory.path(), stage, number);
            fs::write(file, lines).unwrap();
        };
        save("link", 1, "5 inputs 1000 9000 1 2 3 4 5\n5 feedback 90000 95000 1 2 3 4 5\n");
        save("dead-reckoning", 1, "4 inputs 1 2 3 4 5 6 7\n");
        save("dead-reckoning", 2, "5 inputs 19000 29000 1 2 3 4 5\n");
        let mut budget = Budget::default();
        budget.add(directory.path()).unwrap();
        let rows = budget.rows();
        assert_eq!(rows[0].cells[0].p50_us, None, "the robot's end is unknown");
        assert_eq!(rows[1].cells[0].p50_us, Some(10.0));
        assert_eq!(rows[1].cells[1].p99_us, Some(0.003));
        assert_eq!(rows[2].cells[1].p50_us, None, "killed");
        save("mapper", 1, "nonsense\n");
        assert!(Budget::default().add(directory.path()).is_err());
    }
}
