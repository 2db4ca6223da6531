//! The page shows the code of this crate.

/// The block of the page that follows `caption`.
fn block(caption: &str) -> &'static str {
    let page = include_str!("../../add-a-stage.md");
    let after = page.split_once(caption).map(|(_, after)| after);
    let block = after.and_then(|text| text.split("```").nth(1)).unwrap();
    block.split_once('\n').unwrap().1
}

#[test]
fn the_page_shows_step_tests_replay_and_shell_as_they_are() {
    let shown = |file: &str| block(&format!("New file `services/odometer/src/{file}`:"));
    assert_eq!(shown("step.rs"), include_str!("step.rs"));
    assert_eq!(shown("step/tests.rs"), include_str!("step/tests.rs"));
    // The payload and the topic are in `common` there, and here beside the shell.
    let shell = include_str!("shell.rs")
        .replace(
            "    samples::PoseSample,",
            "    samples::{DistanceSample, PoseSample},",
        )
        .replace("    topics::POSE,", "    topics::{DISTANCE, POSE},")
        .replace("use crate::rows::{DISTANCE, DistanceSample};\n", "");
    assert_eq!(shown("shell.rs"), shell);
    let replay = include_str!("replay.rs")
        .replace(
            "    samples::PoseSample,",
            "    samples::{DistanceSample, PoseSample},",
        )
        .replace(
            "    step::Step as _,\n",
            "    step::Step as _,\n    topics::DISTANCE,\n",
        )
        .replace("use crate::rows::{DISTANCE, DistanceSample};\n", "");
    assert_eq!(shown("replay.rs"), replay);
}

#[test]
fn the_page_shows_the_payload_as_it_is() {
    let payload = block("At the end of `common/src/samples/navigation.rs`:");
    assert!(include_str!("rows.rs").contains(payload.trim()));
}
