//! The page shows the code of this crate.

fn block(caption: &str) -> &'static str {
    let page = include_str!("../../add-a-stage.md");
    let after = page.split_once(caption).map(|(_, after)| after);
    let block = after.and_then(|text| text.split("```").nth(1)).unwrap();
    block.split_once('\n').unwrap().1
}

#[test]
fn the_page_shows_the_stage_as_it_is() {
    // The payload and the topic are in `common` there, and here beside the stage.
    let stage = include_str!("odometer.rs")
        .replace("    samples::PoseSample,", "    samples::{DistanceSample, PoseSample},")
        .replace("    topics::POSE,", "    topics::{DISTANCE, POSE},")
        .replace("\nuse crate::rows::{DISTANCE, DistanceSample};\n", "");
    assert_eq!(block("New file `services/odometer/src/lib.rs`:"), stage);
}

#[test]
fn the_page_shows_the_payload_as_it_is() {
    let payload = block("At the end of `common/src/samples/navigation.rs`:");
    assert!(include_str!("rows.rs").contains(payload.trim()));
}
