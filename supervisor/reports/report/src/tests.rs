use std::path::{Path, PathBuf};

use common::{latency::Histogram, samples::*};
use mission_control::Heard;
use recording::Recording;

use crate::content::Content;

#[allow(unreachable_pub, reason = "the system tests share it")]
#[path = "../../../../tests/support/recorded_page.rs"]
mod recorded_page;
use recorded_page::messages;

fn golden() -> Content {
    golden_of("open-room")
}

fn file_of(name: &str) -> PathBuf {
    let golden = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../tests/golden");
    Path::new(golden).join(name).with_extension("mcap")
}

fn golden_of(name: &str) -> Content {
    Content::read(&recording::files(&file_of(name)).unwrap()).unwrap()
}

#[test]
fn a_page_has_every_tick_the_maps_a_field_and_the_metrics() {
    let content = golden();
    let ticks = content.measured.ticks as usize;
    let (messages, blobs) = messages(&content.html());
    let about = &messages[0]["about"];
    assert_eq!(about["robot"], "x80");
    let rows = messages.iter().filter_map(|message| message["rows"].as_array()).flatten();
    let rows: Vec<_> = rows.collect();
    assert_eq!(rows.len(), ticks);
    let width = ["columns", "sensors"].map(|list| about[list].as_array().unwrap().len());
    assert!(rows.iter().all(|row| row.as_array().unwrap().len() == width[0] + width[1]));
    let columns = about["columns"].as_array().unwrap();
    let left = columns.iter().position(|column| column == "left").unwrap();
    for (at, name) in ["left", "right", "left_sent", "right_sent"].into_iter().enumerate() {
        assert_eq!(columns[left + at], name);
        assert!(rows.iter().any(|row| row[left + at].as_f64() > Some(1.0)), "{name}");
    }
    let states = messages.iter().filter_map(|message| message["state"].as_object());
    let states: Vec<_> =
        states.map(|state| (state["does"].as_str().unwrap(), &state["kind"])).collect();
    let (does, kind) = states.last().unwrap();
    assert!(does.contains("mission over") && *kind == "good", "{does} {kind}");
    assert!(states.contains(&("the robot starts", &"warn".into())), "{states:?}");
    assert!(blobs > 3, "{blobs} maps and fields");
    let metrics = messages.last().unwrap()["metrics"].as_array().unwrap();
    assert!(metrics.iter().any(|metric| metric[2] == "mission_time_s"), "{metrics:?}");
}

#[test]
fn a_report_tells_of_a_stage_that_was_killed() {
    let (messages, _) = messages(&golden_of("stall-and-kill").html());
    let told = messages.iter().filter_map(|message| message["events"].as_array()).flatten();
    let told: Vec<_> = told.map(|event| format!("{} {}", event["of"], event["text"])).collect();
    for event in ["\"mapper\" \"generation 1 died (signal 9)", "\"mapper\" \"generation 2 runs\""] {
        assert!(told.iter().any(|it| it.starts_with(event)), "{told:?}");
    }
}

#[test]
fn a_recording_that_is_cut_off_gives_a_report_that_says_so() {
    let bytes = std::fs::read(file_of("open-room")).unwrap();
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("cut.mcap");
    std::fs::write(&file, &bytes[..bytes.len() * 2 / 3]).unwrap();
    assert!(Recording::open(&file).is_ok());
    let page = crate::write(&file, None).unwrap();
    assert_eq!(page, directory.path().join("cut-report/report.html"));
    let (messages, _) = messages(&std::fs::read_to_string(page).unwrap());
    let remarks = messages.last().unwrap()["remarks"].to_string();
    assert!(remarks.contains("cut.mcap is cut off after "), "{remarks}");
}

#[test]
fn metrics_count_every_generation_and_every_sample() {
    let mission = golden().mission;
    let mut measured = crate::measured::Measured::default();
    let mut heard = summary::Hearer::default();
    let stamp = |tick: u64, generation| Stamp {
        tick,
        stamp_ns: tick * 1_000_000_000,
        generation,
        ..Stamp::default()
    };
    let mut histogram = Histogram::default();
    histogram.record(1_000_000);
    for (tick, generation) in [(0, 1), (1, 1), (2, 2)] {
        heard.hear(&Heard::Link(&LinkSample {
            stamp: stamp(tick, generation),
            latency_histogram: histogram.counts,
            latency_max_ns: histogram.max_ns,
            ..LinkSample::default()
        }));
        let pose =
            PoseSample { stamp: stamp(tick, 1), v_m_s: tick as f64 * 0.5, ..PoseSample::default() };
        measured.pose(&pose, &mission);
        let range =
            RangeReading { range_m: 0.2, status: u8::from(tick == 0), ..RangeReading::default() };
        measured.range(&range, &mission);
        heard.hear(&Heard::Command(&CommandSample {
            stamp: stamp(tick, 1),
            left_rad_s: -1.0,
            right_rad_s: tick as f64,
            state: CommandState::Driving.into(),
            ..CommandSample::default()
        }));
    }
    let mut late = PoseSample { stamp: stamp(2, 1), v_m_s: 900.0, ..PoseSample::default() };
    late.stamp.stamp_ns += 1000;
    measured.pose(&late, &mission);
    let counts: u32 = heard.latency().counts.iter().sum();
    assert_eq!(counts, 2);
    let metrics = [
        measured.speed_change(),
        measured.near(),
        measured.unavailable(),
        heard.wheel_range_rad_s(u64::MAX),
    ];
    assert_eq!(metrics, [0.5, 1.0 / 3.0, 2.0 / 3.0, 3.0].map(Some));
}
