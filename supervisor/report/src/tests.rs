//! The promises of a report, on recordings made by the tests.

use std::path::Path;

use common::{
    latency::Histogram,
    samples::{
        CommandSample, DeathSample, LinkSample, PoseSample, RangeReading, Stamp, name, words,
    },
};
use recording::Recording;

use crate::{content::Content, figures, page, source::Source};

fn golden() -> Content {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/golden/open-room.mcap");
    Content::read(&Source::find(Path::new(file)).unwrap()).unwrap()
}

#[test]
fn every_figure_has_its_axes_with_units_and_a_legend() {
    let figures = figures::all(&golden());
    let expected = [
        ("trajectory", ["x, metres", "guidance E", "target, tolerance"]),
        ("map-and-field", ["2 s", "4 s", "6 s"]),
        ("timeline", ["mission time, s", "planner", "event"]),
        ("sonar", ["mission time, s", "range, m", "no distance"]),
        ("speed", ["mission time, s", "v, m/s", "commanded"]),
        ("turning", ["mission time, s", "ω, rad/s", "by dead reckoning"]),
        ("wheel-left", ["mission time, s", "ωL, rad/s", "by the encoder"]),
        ("wheel-right", ["mission time, s", "ωR, rad/s", "commanded"]),
        ("tick-latency", ["tick latency, ms", "ticks, count", "ticks"]),
    ];
    assert_eq!(figures.len(), expected.len());
    for (figure, (name, texts)) in figures.iter().zip(expected) {
        assert_eq!(figure.name, name);
        for text in texts {
            let found = figure.svg.contains(&format!(">{text}<"));
            assert!(found, "{name} does not say {text:?}");
        }
        picture::png(&figure.svg).unwrap();
    }
}

#[test]
fn text_of_a_recording_is_never_markup() {
    let mut content = golden();
    let hostile = "<script>alert(\"&\")</script>\u{0}";
    content.mission.name = hostile.to_owned();
    content.remarks.push(hostile.to_owned());
    content.about.push(("robot", hostile.to_owned()));
    content.summary.insert("outcome".to_owned(), hostile.into());
    content.summary.insert("reason".to_owned(), hostile.into());
    content.events.death(&DeathSample {
        stage: name("<b>planner"),
        log_tail: words(hostile),
        ..DeathSample::default()
    });
    let figures = figures::all(&content);
    let page = page::html(&content, &figures);
    assert!(page.contains("&lt;script&gt;"));
    for text in figures.iter().map(|figure| &figure.svg).chain([&page]) {
        assert!(!text.contains("<script") && !text.contains("<b>"));
        assert!(!text.contains('\u{0}'));
    }
    for figure in &figures {
        picture::png(&figure.svg).unwrap();
    }
}

#[test]
fn a_recording_that_is_cut_off_gives_a_report_that_says_so() {
    let whole = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/golden/open-room.mcap");
    let bytes = std::fs::read(whole).unwrap();
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("cut.mcap");
    std::fs::write(&file, &bytes[..bytes.len() * 2 / 3]).unwrap();
    assert!(Recording::open(&file).is_ok());
    let page = crate::write(&file, None).unwrap();
    assert_eq!(page, directory.path().join("cut-report/report.html"));
    let page = std::fs::read_to_string(page).unwrap();
    assert!(page.contains("cut.mcap is cut off after "));
    assert!(!page.contains("http"));
}

#[test]
fn metrics_count_every_generation_and_every_sample() {
    let mut content = golden();
    content.measured = crate::measured::Measured::default();
    let stamp = |tick: u64, generation| Stamp {
        tick,
        stamp_ns: tick * 1_000_000_000,
        generation,
        ..Stamp::default()
    };
    let mut histogram = Histogram::default();
    histogram.record(1_000_000);
    for (tick, generation) in [(0, 1), (1, 1), (2, 2)] {
        content.measured.link(&LinkSample {
            stamp: stamp(tick, generation),
            latency_histogram: *histogram.counts(),
            latency_max_ns: histogram.max_ns(),
            ..LinkSample::default()
        });
        let pose =
            PoseSample { stamp: stamp(tick, 1), v_m_s: tick as f64 * 0.5, ..PoseSample::default() };
        content.measured.pose(&pose, &content.mission);
        let range =
            RangeReading { range_m: 0.2, status: u8::from(tick == 0), ..RangeReading::default() };
        content.measured.range(&range, &content.mission);
        content.measured.command(&CommandSample {
            left_rad_s: -1.0,
            right_rad_s: tick as f64,
            ..CommandSample::default()
        });
    }
    // This pose came a microsecond after the last one.
    let mut late = PoseSample { stamp: stamp(2, 1), v_m_s: 900.0, ..PoseSample::default() };
    late.stamp.stamp_ns += 1000;
    assert!(!content.measured.pose(&late, &content.mission));
    let counts: u32 = content.measured.latency().counts().iter().sum();
    assert_eq!(counts, 2);
    assert_eq!(content.measured.speed_change(), Some(0.5));
    assert_eq!(content.measured.near(), Some(1.0 / 3.0));
    assert_eq!(content.measured.unavailable(), Some(2.0 / 3.0));
    assert_eq!(content.measured.wheel_range(), Some(3.0));
}
