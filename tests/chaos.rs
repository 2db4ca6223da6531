//! Tests of `firsthand bench chaos` through real processes: its table of signals, and its effect on
//! consumers.

use std::fs;

use common::domain::SUITE_VARIABLE;
use serde_json::Value;

use crate::support::{
    self, assert_nothing_left, firsthand, json_of, kill, output, start_quietly, words,
};

fn number(value: &Value) -> u64 {
    value.as_u64().unwrap_or_default()
}

fn sum(of: &Value) -> u64 {
    let objects = of.as_object().unwrap().values();
    let counts = objects.flat_map(|counts| counts.as_object().unwrap().values());
    counts.map(number).sum()
}

/// Returns the command lines of this suite's processes that contain `mark`.
fn processes(mark: &str) -> Vec<String> {
    let own = format!("{SUITE_VARIABLE}={}", support::suite());
    let is_own = |pid: &u32| {
        let environment = fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
        environment.split(|byte| *byte == 0).any(|variable| variable == own.as_bytes())
    };
    let found = support::processes(mark).into_iter().filter(|(pid, _)| is_own(pid));
    found.map(|(_, line)| line).collect()
}

#[test]
fn chaos_hits_stages_and_consumers_without_changing_the_outcome_and_each_signal_is_a_row() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("results");
    let given = format!("'{}' topic echo pose --robot chd-hit", env!("CARGO_BIN_EXE_firsthand"));
    // The mission completes on a loaded machine too.
    let fixed = "bench chaos open-room --json --robot chd-hit --kills 30 --include-consumers \
                 --include-startup --replay --set timeout_s=600 --set controller.speed_m_s=0.2";
    let more = ["--consumer", &given, "--out", out.to_str().unwrap()];
    let (code, reports) = json_of(&output(&[&words(fixed)[..], &more].concat()));
    assert_eq!(code, Some(0), "{reports:?}");
    assert_nothing_left("chd-hit");
    let report = &reports[0];
    assert_eq!(report["reached"], report["missions"], "{report}");
    assert_eq!(report["leftovers"].as_array().map(Vec::len), Some(0), "{report}");
    let consumers = &report["consumers"];
    for name in ["record", "logs -f", &given] {
        let counts = &consumers[name];
        // The consumer was restarted after each kill.
        assert!(number(&counts["started"]) > number(&counts["killed"]), "{name}: {report}");
    }
    let hit = |counts: &Value| number(&counts["killed"]) + number(&counts["frozen"]);
    let hits: u64 = consumers.as_object().unwrap().values().map(hit).sum();
    assert!(hits >= 5 && hits + sum(&report["kills"]) >= 30, "{report}");
    // The recorded part of such recordings was replayed, and the missing part is reported.
    let partial = &report["replays"]["partial"];
    assert!(number(&partial["equal"]) > 0 && partial["not_replayed"].is_u64(), "{report}");
    assert_eq!(processes("chd-hit"), Vec::<String>::new());

    let table = fs::read_to_string(out.join("signals.csv")).unwrap();
    let mut rows = table.lines().map(|row| row.split(',').collect::<Vec<_>>());
    let header = rows.next().unwrap();
    assert_eq!(header[..4], ["mission", "time_s", "stage", "kind"]);
    let rows: Vec<_> = rows.collect();
    for (stage, kinds) in report["kills"].as_object().unwrap() {
        for (kind, count) in kinds.as_object().unwrap() {
            let its = rows.iter().filter(|row| row[2] == stage && row[3] == kind);
            assert_eq!(its.count() as u64, number(count), "{stage} {kind}: {table}");
        }
    }
    for name in ["noticed_ms", "ready_ms", "first_output_ms"] {
        let column = header.iter().position(|it| *it == name).unwrap();
        let measured = rows.iter().filter(|row| row[column].parse::<f64>().is_ok()).count() as u64;
        assert!(measured >= sum(&report["kills"]) / 2, "{name}: {table}");
    }
}

#[test]
fn chaos_that_is_killed_keeps_its_rows_and_its_consumers_end_with_it() {
    let directory = tempfile::tempdir().unwrap();
    let given = format!("'{}' topic echo pose --robot chd-cut", env!("CARGO_BIN_EXE_firsthand"));
    let mut command =
        firsthand(&["bench", "chaos", "obstacle-course", "--robot", "chd-cut", "--out"]);
    let mut chaos = start_quietly(command.arg(directory.path()).args(["--consumer", &given]));
    let file = directory.path().join("signals.csv");
    let rows = || fs::read_to_string(&file).unwrap_or_default();
    support::wait_for_status("chd-cut", |_| rows().lines().count() >= 4);
    kill(&mut chaos);
    let table = rows();
    let columns = |row: &str| row.matches(',').count();
    assert!(table.ends_with('\n') && table.lines().all(|row| columns(row) == 8), "{table}");
    let left = std::env::temp_dir().join(format!("firsthand-chaos-{}-chd-cut", chaos.id()));
    let marks = ["chd-cut", left.to_str().unwrap()];
    support::wait_until("all have ended", || marks.iter().all(|mark| processes(mark).is_empty()));
    fs::remove_dir_all(left).unwrap();
}
