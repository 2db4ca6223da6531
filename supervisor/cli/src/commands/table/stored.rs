//! Results, capabilities and versions, as CSV files beside the guide. The first column names the
//! section of a page that shows the row.

use common::checkpoint;
use console::item::item;

macro_rules! stored {
    ($($name:literal in $file:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../../../guide/results/", $file)))),*]
    };
}

static RESULTS: &[(&str, &str)] = stored! {
    "figures" in "figures.csv",
    "worlds" in "worlds.csv",
    "paired" in "paired.csv",
    "experiments" in "experiments.csv",
    "claims" in "claims.csv",
    "stop-times" in "stop_times.csv",
    "corpus" in "corpus.csv",
    "doubts" in "doubts.csv",
    "seeds" in "seeds.csv",
    "tick" in "tick.csv",
    "tick-at-7-hz" in "tick_at_7_hz.csv",
    "field" in "field.csv",
    "nav2-planners" in "nav2_planners.csv",
    "small-machine" in "small_machine.csv",
    "small-machine-processes" in "small_machine_processes.csv",
};

/// Returns the rows of the stored file called `name`, whose content is `text`.
pub fn markdown(name: &str, text: &str) -> String {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().cloned().unwrap_or_default();
    let rows: Vec<Vec<String>> = reader
        .records()
        .flatten()
        .map(|row| row.iter().skip(1).map(str::to_owned).collect())
        .collect();
    match name {
        "capabilities" => rows.iter().map(|row| capability(row)).collect(),
        "versions" => rows.iter().map(|row| version(row)).collect(),
        "figures" => rows.iter().map(|row| figure(row)).collect(),
        _ => table(header.iter().skip(1), &rows),
    }
}

pub fn results() -> String {
    let printed = RESULTS.iter().map(|(name, text)| format!("{name}\n\n{}", markdown(name, text)));
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
        table += &format!("| {} |\n", row.join(" | "));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_every_stored_file_is_a_row() {
        for (name, text) in RESULTS {
            let records = csv::Reader::from_reader(text.as_bytes()).into_records();
            let broken = records.filter(Result::is_err).count();
            assert_eq!(broken, 0, "{name}");
        }
    }
}
