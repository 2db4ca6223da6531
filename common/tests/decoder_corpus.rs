//! The decoder on the corpus that fuzzing kept, and on bounded random changes of it.
//!
//! The long run is `common/fuzz`: its target says how.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test")]

#[path = "../fuzz/oracle.rs"]
mod oracle;

use std::path::Path;

use proptest::{
    prelude::*,
    test_runner::{Config, TestRunner},
};

fn corpus() -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/decoder");
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .expect("the corpus is kept")
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    files
        .iter()
        .map(|file| std::fs::read(file).unwrap())
        .collect()
}

#[test]
fn the_kept_corpus_breaks_no_promise() {
    let corpus = corpus();
    assert!(corpus.len() > 20, "only {} inputs are kept", corpus.len());
    for input in &corpus {
        oracle::check(input);
    }
}

#[test]
fn random_changes_of_the_corpus_break_no_promise() {
    let change = (any::<prop::sample::Index>(), any::<u8>());
    let changed = (
        prop::sample::select(corpus()),
        prop::sample::select(corpus()),
        prop::collection::vec(change, 0..8),
    )
        .prop_map(|(mut input, other, changes)| {
            input.extend(other);
            for (at, byte) in changes {
                if !input.is_empty() {
                    let at = at.index(input.len());
                    input[at] = byte;
                }
            }
            input
        });
    let mut runner = TestRunner::new(Config::with_cases(20_000));
    runner
        .run(&changed, |input| {
            oracle::check(&input);
            Ok(())
        })
        .unwrap();
}
