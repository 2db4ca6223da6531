//! Evaluations: many missions, judged by the ground truth.

use serde_json::Value;

use crate::support::output;

/// The object that the evaluation of two rooms in `out` ends with.
fn evaluate(out: &str, more: &[&str]) -> Result<Value, String> {
    let common = [
        "evaluate", "--worlds", "rooms", "--count", "2", "--out", out, "--json",
    ];
    let output = output(&[&common[..], more].concat());
    if output.status.success() {
        Ok(serde_json::from_slice(&output.stdout).unwrap())
    } else {
        Err(String::from_utf8(output.stderr).unwrap())
    }
}

#[test]
fn an_evaluation_that_was_cut_off_goes_on_and_another_is_not_mixed_with_it() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("rooms");
    let name = out.to_str().unwrap();
    let whole = evaluate(name, &["--seed", "5"]).unwrap();
    assert_eq!(whole["count"], 2, "{whole}");
    let shares = [
        "success",
        "collision",
        "timeout",
        "wrong_place",
        "unreachable",
        "aborted",
    ];
    let sum: f64 = shares
        .iter()
        .map(|share| whole[share].as_f64().unwrap())
        .sum();
    assert!(
        (sum - 1.0).abs() < 1e-9 && whole["aborted"] == 0.0,
        "{whole}"
    );
    assert!(out.join("index.html").exists());

    let rows = std::fs::read_to_string(out.join("rows.csv")).unwrap();
    let (first, _) = rows.trim_end().rsplit_once('\n').unwrap();
    // Killed while it wrote the last row.
    std::fs::write(
        out.join("rows.csv"),
        format!("{first}\nrooms-5-0001,6,evid"),
    )
    .unwrap();
    let resumed = evaluate(name, &["--seed", "5", "--resume"]).unwrap();
    assert_eq!(resumed["count"], 2, "{resumed}");
    assert_eq!(resumed["success"], whole["success"]);

    let refused = evaluate(name, &["--seed", "5"]).unwrap_err();
    assert!(refused.contains("--resume"), "{refused}");
    let refused = evaluate(name, &["--seed", "6", "--resume"]).unwrap_err();
    assert!(refused.contains("was another"), "{refused}");
}
