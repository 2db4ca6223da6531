//! The paper's experiments: their rows, and going on with those that were cut off.

use std::{fs, path::Path};

use serde_json::Value;

use crate::support::output;

/// The objects that two experiments with one seed in `out` end with.
fn experiments(out: &Path, more: &[&str]) -> Result<Vec<Value>, String> {
    let out = out.to_str().unwrap();
    let common = [
        "experiments",
        "--seeds",
        "1",
        "--only",
        "1a,3,5-constant",
        "--realism",
        "laboratory",
        "--out",
        out,
        "--json",
    ];
    let output = output(&[&common[..], more].concat());
    if output.status.success() {
        let lines = String::from_utf8(output.stdout).unwrap();
        let objects = lines.lines().map(serde_json::from_str);
        Ok(objects.collect::<Result<_, _>>().unwrap())
    } else {
        Err(String::from_utf8(output.stderr).unwrap())
    }
}

#[test]
fn experiments_give_a_row_each_and_the_same_ones_again_when_they_were_cut_off() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("experiments");
    let whole = experiments(&out, &[]).unwrap();
    let names: Vec<_> = whole
        .iter()
        .map(|it| it["experiment"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["1a", "3", "5-constant"]);
    for object in &whole {
        let paper = &object["paper"];
        assert_eq!(
            (&paper["count"], &paper["arrived"]),
            (&1.into(), &1.into()),
            "{object}"
        );
        for figure in ["time_s", "k", "sonar_unavailable", "wheel_range_rad_s"] {
            assert!(
                paper[figure]["median"].as_f64().unwrap() > 0.0,
                "{figure}: {object}"
            );
        }
    }
    assert_eq!(
        whole[1]["paper"]["safety_events"]["median"], 0.0,
        "nothing is sensed"
    );
    assert!(
        whole[2].get("evidential").is_none(),
        "it has no constant speed"
    );
    assert!(out.join("index.html").exists());
    assert!(out.join("pictures/3-1-paper.svg").exists());

    let rows = fs::read_to_string(out.join("rows.csv")).unwrap();
    assert_eq!(rows.lines().count(), 6, "{rows}");
    let (first, last) = rows.trim_end().rsplit_once('\n').unwrap();
    // Killed while it wrote the last row.
    fs::write(out.join("rows.csv"), format!("{first}\n{}", &last[..9])).unwrap();
    let resumed = experiments(&out, &["--resume"]).unwrap();
    assert_eq!(resumed, whole);
    assert_eq!(fs::read_to_string(out.join("rows.csv")).unwrap(), rows);

    let refused = experiments(&out, &[]).unwrap_err();
    assert!(refused.contains("--resume"), "{refused}");
    let refused = experiments(&out, &["--resume", "--seeds", "2"]).unwrap_err();
    assert!(!refused.is_empty());
}

#[test]
fn an_unknown_experiment_is_answered_with_those_there_are() {
    let output = output(&["experiments", "--only", "6"]);
    assert!(!output.status.success());
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("5-modulated"), "{said}");
}
