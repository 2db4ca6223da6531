//! Test of the latency of ticks, which needs processes.

use std::{fs, os::unix::fs::MetadataExt as _};

use crate::support::{self, ENDLESS, Run, assert_nothing_left, json_lines, printed, words};

#[test]
fn latency_is_measured_beside_hops_at_each_rate_and_leaves_nothing_but_what_was_there() {
    // Another robot of this user, with its directory below the removed one.
    let run = Run::under_way("hops-beside", "open-room", ENDLESS, 0.3);
    let measured = |robot: &str, more: &str| {
        let short = "bench tick --rounds 1 --set timeout_s=6 --json";
        json_lines(&printed(&words(&format!("{short} --robot {robot} {more}"))))
    };
    let reports = measured("hops", "--busy 1 --set robot.rate_hz=20");
    assert_nothing_left("hops");
    let regimes: Vec<_> = reports.iter().map(|report| &report["regime"]).collect();
    assert_eq!(regimes, ["back to back", "at 20 Hz"]);
    for report in &reports {
        let times = report["times"].as_array().unwrap();
        assert_eq!(times.len(), 2, "{report}");
        for (row, key) in times.iter().flat_map(|row| ["p50_us", "p99_us"].map(|key| (row, key))) {
            assert!(row[key].as_f64() > Some(0.0), "{key}: {report}");
        }
        assert!(report["ratio"].as_f64() > Some(0.0), "{report}");
    }
    let at_30_hz = "--rate 30 --set timeout_s=20 --no-record --consumers 0";
    let reports = measured(support::suite(), at_30_hz);
    assert_eq!(reports.len(), 1, "{reports:?}");
    assert_eq!(reports[0]["regime"], "at 30 Hz");
    let root = fs::metadata(support::domain("hops-beside").directory()).unwrap();
    assert!(root.is_dir() && root.uid() == rustix::process::geteuid().as_raw());
    assert!(run.status().is_some());
    run.stop();
}
