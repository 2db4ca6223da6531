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
    let header = match name {
        "capabilities" | "versions" | "figures" => String::new(),
        _ => {
            let columns: Vec<_> = header.iter().skip(1).collect();
            format!("| {} |\n|{}\n", columns.join(" | "), "---|".repeat(columns.len()))
        }
    };
    let rows =
        reader.records().flatten().map(|row| line(name, &row.iter().skip(1).collect::<Vec<_>>()));
    header + &rows.collect::<String>()
}

pub fn results() -> String {
    RESULTS
        .iter()
        .map(|(name, text)| format!("{name}\n\n{}", markdown(name, text)))
        .collect::<Vec<_>>()
        .join("\n")
}

/// Returns an item of a list, or a row of a table.
fn line(name: &str, row: &[&str]) -> String {
    match (name, row) {
        ("capabilities", [text, verdict, ""]) => item(&format!("{verdict}: {text}")),
        ("capabilities", [text, verdict, tests]) => {
            item(&format!("{verdict}: {text}: {}", named(tests)))
        }
        // How another version of a file or robot is handled. `STATES` is the version of states.
        ("versions", [what, version, another, tests]) => {
            let states = checkpoint::VERSION.escape_ascii().to_string();
            let version = version.replace("STATES", &states);
            item(&format!("{what} ({version}): {another}: {}", named(tests)))
        }
        // A figure above its command.
        ("figures", [what, realism, n, figure, command]) => {
            let realism = if realism.is_empty() { String::new() } else { format!("{realism}, ") };
            format!("{}  `{command}`\n", item(&format!("{what} ({realism}n = {n}): {figure}")))
        }
        _ => format!("| {} |\n", row.join(" | ")),
    }
}

fn named(tests: &str) -> String {
    tests.split(' ').map(|test| format!("`{test}`")).collect::<Vec<_>>().join(" ")
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
