//! Results, capabilities, versions and keys, as CSV files beside the guide, with page sections in
//! the first column.

use std::fmt::Write as _;

use common::checkpoint;
use console::item::item;

macro_rules! stored {
    ($($name:literal in $file:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../../../guide/", $file)))),*]
    };
}

static FILES: &[(&str, &str)] = stored! {
    "capabilities" in "capabilities.csv",
    "versions" in "versions.csv",
    "mission-keys" in "mission-keys.csv",
    "simulation-keys" in "simulation-keys.csv",
    "summary-keys" in "summary-keys.csv",
    "figures" in "results/figures.csv",
    "worlds" in "results/worlds.csv",
    "paired" in "results/paired.csv",
    "experiments" in "results/experiments.csv",
    "claims" in "results/claims.csv",
    "stop-times" in "results/stop_times.csv",
    "corpus" in "results/corpus.csv",
    "seeds" in "results/seeds.csv",
    "tick" in "results/tick.csv",
    "tick-at-7-hz" in "results/tick_at_7_hz.csv",
    "field" in "results/field.csv",
    "nav2-planners" in "results/nav2_planners.csv",
    "small-machine" in "results/small_machine.csv",
    "small-machine-processes" in "results/small_machine_processes.csv",
};

/// Returns rows of all or some sections (`a,b`), or `None` if there are none.
pub fn markdown(name: &str, section: Option<&str>) -> Option<String> {
    let (_, text) = FILES.iter().find(|(file, _)| *file == name)?;
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().ok()?.clone();
    let rows: Vec<Vec<String>> = reader
        .records()
        .flatten()
        .filter(|row| {
            section.is_none_or(|asked| asked.split(',').any(|asked| row.get(0) == Some(asked)))
        })
        .map(|row| row.iter().skip(1).map(str::to_owned).collect())
        .collect();
    if rows.is_empty() {
        return None;
    }
    Some(match name {
        "capabilities" => rows.iter().map(|row| capability(row)).collect(),
        "versions" => rows.iter().map(|row| version(row)).collect(),
        "figures" => rows.iter().map(|row| figure(row)).collect(),
        _ => table(header.iter().skip(1), &rows),
    })
}

pub fn results() -> String {
    let is_result =
        |name: &str| !["capabilities", "versions"].contains(&name) && !name.ends_with("-keys");
    let of_results = FILES.iter().filter(|(name, _)| is_result(name));
    let printed =
        of_results.filter_map(|(name, _)| Some(format!("{name}\n\n{}", markdown(name, None)?)));
    printed.collect::<Vec<_>>().join("\n")
}

fn capability(row: &[String]) -> String {
    let [text, verdict, tests] = row else {
        return String::new();
    };
    let said = match tests.as_str() {
        "" => text.to_owned(),
        tests => format!("{text}: {}", named(tests)),
    };
    item(&format!("{verdict}: {said}"))
}

fn named(tests: &str) -> String {
    tests.split(' ').map(|test| format!("`{test}`")).collect::<Vec<_>>().join(" ")
}

/// Describes how another version of a file or robot is handled. `STATES` is the version of states.
fn version(row: &[String]) -> String {
    let [what, version, another, tests] = row else {
        return String::new();
    };
    let version = version.replace("STATES", &checkpoint::VERSION.escape_ascii().to_string());
    item(&format!("{what} ({version}): {another}: {}", named(tests)))
}

/// Prints a figure above its command.
fn figure(row: &[String]) -> String {
    let [what, realism, n, figure, command] = row else {
        return String::new();
    };
    let realism = match realism.as_str() {
        "" => String::new(),
        realism => format!("{realism}, "),
    };
    format!("{}  `{command}`\n", item(&format!("{what} ({realism}n = {n}): {figure}")))
}

fn table<'a>(header: impl Iterator<Item = &'a str>, rows: &[Vec<String>]) -> String {
    let header: Vec<&str> = header.collect();
    let mut table = format!("| {} |\n|{}\n", header.join(" | "), "---|".repeat(header.len()));
    for row in rows {
        // Infallible for a String.
        let _ = writeln!(table, "| {} |", row.join(" | "));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_every_stored_file_is_a_row() {
        for (name, text) in FILES {
            let records = csv::Reader::from_reader(text.as_bytes()).into_records();
            let broken = records.filter(Result::is_err).count();
            assert_eq!(broken, 0, "{name}");
        }
    }
}
