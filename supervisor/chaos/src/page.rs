//! The page of results, from the table of signals: one file that refers to nothing else.

use std::{fmt::Write as _, fs, path::Path};

use common::topics::SUPERVISOR;
use evaluation::page::{END, escaped, styled_head};
use picture::{Axis, Chart, Lane, Mark, Series, Symbol, Timeline};
use supervisor::stages::TABLE;

use crate::{
    error::{ChaosError, system},
    kind::Kind,
    report::Report,
    signals::{FILE_NAME, Row},
};

/// The page's name in the directory of results.
pub const PAGE: &str = "report.html";

/// Characters of a consumer's command.
const LONGEST_NAME: usize = 200;

/// Nothing is wider than the page, and nothing is cut by the end of a sheet.
const STYLE: &str = "body{max-width:46rem;overflow-wrap:anywhere}figure{display:block;width:auto;margin:1.5em 0;break-inside:avoid}\
figure svg{display:block;max-width:100%;height:auto;margin:0 auto}th{overflow-wrap:normal}tr{break-inside:avoid}h2{break-after:avoid}@page{margin:16mm}";

/// Write the page of `report` and `rows` into `directory`.
pub(crate) fn write(directory: &Path, report: &Report, rows: &[Row]) -> Result<(), ChaosError> {
    let file = directory.join(PAGE);
    fs::write(&file, html(report, rows)).map_err(|error| {
        // Half a page is none.
        let _ = fs::remove_file(&file);
        system("write the page of results")(error)
    })
}

fn html(report: &Report, rows: &[Row]) -> String {
    let mut page = styled_head("Chaos: signals and recoveries", STYLE);
    page.push_str("<h1>Chaos: signals and recoveries</h1>\n");
    outcome(&mut page, report);
    page.push_str("<h2>Signals</h2>\n");
    counts(&mut page, rows);
    figure(&mut page, &over_time(rows));
    page.push_str("<h2>Recovery times</h2>\n<p>From the signal until the successor's first sign of work (ready) and its first sample of a tick was read. Not of a signal whose successor was hit too, or whose mission ended before.</p>\n");
    for stage in stages() {
        let chart = recovery(stage, rows);
        if chart.series.iter().any(|series| !series.points.is_empty()) {
            figure(&mut page, &chart.svg());
        }
    }
    let _ = writeln!(
        page,
        "<p>Each signal: <code>{FILE_NAME}</code> beside this page.</p>"
    );
    page.push_str(END);
    page
}

/// The stages, and the supervisor.
fn stages() -> impl Iterator<Item = &'static str> {
    TABLE.iter().map(|stage| stage.name).chain([SUPERVISOR])
}

fn figure(page: &mut String, svg: &str) {
    let svg = svg.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1);
    let _ = writeln!(page, "<figure>\n{svg}</figure>");
}

/// The outcome as a table, and what went wrong.
fn outcome(page: &mut String, report: &Report) {
    page.push_str("<h2>Outcome</h2>\n<table><tbody>\n");
    for (what, value) in report.outcome() {
        let _ = writeln!(page, "<tr><th>{what}</th><td>{}</td></tr>", escaped(&value));
    }
    page.push_str("</tbody></table>\n");
    for wrong in report.wrong() {
        let _ = writeln!(page, "<p>{}</p>", escaped(wrong));
    }
}

/// Signals by what they hit and how.
fn counts(page: &mut String, rows: &[Row]) {
    let mut names: Vec<&str> = rows.iter().map(|row| &*row.stage).collect();
    names.sort_unstable();
    names.dedup();
    let mut kinds: Vec<Kind> = rows.iter().map(|row| row.kind).collect();
    kinds.sort_unstable();
    kinds.dedup();
    page.push_str("<table><thead><tr><th>process</th>");
    for kind in &kinds {
        let _ = write!(page, "<th>{}</th>", kind.as_str());
    }
    page.push_str("</tr></thead><tbody>\n");
    for name in names {
        let short: String = name.chars().take(LONGEST_NAME).collect();
        let _ = write!(page, "<tr><td>{}</td>", escaped(&short));
        for kind in &kinds {
            let its = rows.iter();
            let count = its.filter(|row| row.stage == name && row.kind == *kind);
            let _ = write!(page, "<td>{}</td>", count.count());
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</tbody></table>\n");
}

/// All signals over mission time, the missions one over the other.
fn over_time(rows: &[Row]) -> String {
    let mut lanes: Vec<Lane> = Vec::new();
    for row in rows {
        let Some(time_s) = row.time_s else {
            continue;
        };
        let symbol = match row.kind {
            Kind::Freeze | Kind::FreezeAll => Symbol::Event,
            Kind::Kill | Kind::KillAtStart | Kind::Crash | Kind::Terminate => Symbol::Death,
        };
        let at = lanes.iter().position(|lane| lane.name == row.stage);
        let at = at.unwrap_or_else(|| {
            lanes.push(Lane {
                name: row.stage.clone(),
                ..Lane::default()
            });
            lanes.len() - 1
        });
        lanes[at].marks.push((time_s, symbol));
    }
    let place = |lane: &Lane| stages().position(|stage| stage == lane.name);
    lanes.sort_by_key(|lane| (place(lane).unwrap_or(usize::MAX), lane.name.clone()));
    let times = rows.iter().filter_map(|row| row.time_s);
    Timeline {
        title: "Signals over mission time, all missions".to_owned(),
        description: "When each process was hit: ended (crosses) or frozen (events).".to_owned(),
        // The last marks stand clear of the edge.
        duration_s: 1.03 * times.fold(1.0, f64::max),
        span: String::new(),
        lanes,
    }
    .svg()
}

/// How long the successors of `stage` took: the share of signals after which they worked within a time.
fn recovery(stage: &str, rows: &[Row]) -> Chart {
    let series = |name: &str, mark, ms: fn(&Row) -> Option<f64>| {
        let its = rows.iter().filter(|row| row.stage == stage);
        let seconds: Vec<f64> = its.filter_map(ms).map(|ms| ms / 1e3).collect();
        Series {
            name: format!("{name}, of {}", seconds.len()),
            mark,
            points: shares(seconds),
        }
    };
    Chart {
        title: format!("Recovery of {stage}"),
        description: format!(
            "Share of the signals to {stage} after which its successor worked within a time."
        ),
        x: Axis::logarithmic("time from the signal, s"),
        y: Axis::linear("share of signals"),
        series: vec![
            series("ready", Mark::Dashed, |row| row.ready_ms),
            series("first output", Mark::Solid, |row| row.first_output_ms),
        ],
    }
}

/// Each of `values` with the share of them that is not above it: a step at each.
fn shares(mut values: Vec<f64>) -> Vec<[f64; 2]> {
    values.sort_by(f64::total_cmp);
    let share = |count: usize| count as f64 / values.len() as f64;
    let steps = values.iter().enumerate();
    steps
        .flat_map(|(below, &value)| [[value, share(below)], [value, share(below + 1)]])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_counts_each_signal_escapes_what_it_is_given_and_refers_to_nothing_else() {
        let ready = Row {
            ready_ms: Some(9.0),
            first_output_ms: Some(31.0),
            ..Row::new(1, Some(2.0), "mapper", Kind::Kill, Some(1))
        };
        let rows = [
            ready,
            Row::new(1, Some(3.0), "mapper", Kind::Kill, Some(2)),
            Row::new(2, None, "<script>&", Kind::Freeze, None),
        ];
        let mut report = Report::new();
        report.consumer("<b>").killed = 2;
        let page = html(&report, &rows);
        for text in [
            "<td>mapper</td><td>2</td><td>0</td>",
            "<td>&lt;script&gt;&amp;</td><td>0</td><td>1</td>",
            "<tr><th>signals</th><td>2</td></tr>",
            "<td>&lt;b&gt;: 2 killed",
            "Recovery of mapper",
            "ready, of 1",
            ">time from the signal, s<",
            ">mission time, s<",
        ] {
            assert!(page.contains(text), "{text} in {page}");
        }
        assert!(!page.contains("Recovery of planner"), "no signal hit it");
        for foreign in ["http", "src=", "href=", "<script", "@import"] {
            assert!(!page.contains(foreign), "{foreign} in {page}");
        }
    }

    #[test]
    fn a_page_of_no_signal_is_a_page() {
        assert!(html(&Report::new(), &[]).ends_with(END));
    }

    #[test]
    fn shares_go_from_none_to_all_whatever_the_order() {
        let shares = shares(vec![3.0, 1.0]);
        assert_eq!(shares, [[1.0, 0.0], [1.0, 0.5], [3.0, 0.5], [3.0, 1.0]]);
    }
}
