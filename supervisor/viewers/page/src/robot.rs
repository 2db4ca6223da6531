//! Thread that reads the bus.

use std::{
    path::PathBuf,
    thread,
    time::{Duration, Instant},
};

use axum::body::Bytes;
use common::ground_truth::GROUND_TRUTH;
use common::{
    bus::Bus,
    domain::Domain,
    follower::{Event, Follower},
    process_usage::Processes,
    samples::Cause,
    topics,
};
use console::runs::Results;
use glam::DVec2;
use planner::step::Planner;
use recording::log_files::{LogFiles, Tail};

use page::{Collector, about, blob};
use robot_state::{Feed, TOPICS, failsafe_in_words, newest_run};

use crate::shared::Shared;

const LOOK_EVERY: Duration = Duration::from_millis(50);
const PACK_EVERY: Duration = Duration::from_millis(500);
const LOGS_EVERY: Duration = Duration::from_millis(500);
const AGAIN_AFTER: Duration = Duration::from_secs(1);
/// Further bytes are skipped.
const TRUTH_AT_ONCE: u64 = 1 << 16;
/// Most bytes of results loaded for a run in progress.
const LARGEST_RESULTS: u64 = 1 << 20;
const PREVIEW_MOST_CELLS: usize = 512 * 512;

struct Reading {
    collector: Collector,
    processes: Processes,
    logs: LogFiles,
    logs_read: Instant,
    truth: (PathBuf, Tail),
    results: Results,
    packed: Option<Instant>,
}

impl Reading {
    fn begin(domain: &Domain, shared: &Shared) -> Option<Self> {
        let (directory, run) = newest_run(domain)?;
        shared.lock().begin(&about(&run), run.mission.robot.address.is_none());
        Some(Self {
            collector: Collector::new(&run.mission),
            processes: Processes::default(),
            logs: LogFiles::follow(&directory, true),
            logs_read: Instant::now(),
            truth: (directory.join(GROUND_TRUTH), Tail::default()),
            results: Results::of(&directory, LARGEST_RESULTS),
            packed: None,
        })
    }

    fn publish(&mut self, shared: &Shared) {
        let Self { collector, processes, logs, logs_read, results, packed, .. } = self;
        let mut ended = Vec::new();
        if logs_read.elapsed() >= LOGS_EVERY {
            *logs_read = Instant::now();
            for (process, line) in logs.take() {
                collector.state.log(&process, &line);
            }
            ended = results.take();
        }
        collector.usage = processes.look(&collector.state.processes(), Instant::now());
        let (rows, events) = (collector.take_rows(), collector.state.take_events());
        let state = collector.take_state();
        let is_due = packed.is_none_or(|packed| packed.elapsed() >= PACK_EVERY);
        let (mut map, mut field) = (None, None);
        if is_due && shared.is_watched() {
            (map, field) = (collector.take_map(), collector.take_field());
            if map.is_some() || field.is_some() {
                *packed = Some(Instant::now());
            }
        }
        let wanted = shared.lock().wanted.take();
        let preview = wanted.and_then(|target| preview(collector, DVec2::from(target)));
        let mut shown = shared.lock();
        if let Some(link) = &collector.state.link {
            let says = format!("the link says: {}", failsafe_in_words(link));
            shared.link.send_replace((link.cause() == Cause::OperatorStop, says));
        }
        rows.iter().for_each(|row| shown.rows.push(row));
        for event in events {
            shown.events.push(&serde_json::json!(event));
        }
        for target in ended {
            shown.results.push(&page::result(&serde_json::json!(target)));
        }
        if let Some(state) = state {
            shown.state.set(state.to_string().into());
        }
        if let Some(map) = map {
            shown.map.set(Bytes::from(map));
        }
        if let Some(field) = field {
            shown.field.set(Bytes::from(field));
        }
        if let Some(preview) = preview {
            shown.preview.set(Bytes::from(preview));
        }
    }
}

fn preview(collector: &Collector, target: DVec2) -> Option<Vec<u8>> {
    let (header, cells) = collector.belief()?;
    let frame = header.part.frame();
    if cells.len() > PREVIEW_MOST_CELLS || frame.cell_at(target).is_none_or(|at| frame.is_rim(at)) {
        return None;
    }
    let cells = Planner::field_to(target, &collector.mission, &header, cells)?;
    Some(blob::field(blob::Shown::Preview, frame, &cells, target, collector.state.now_s()))
}

pub fn follow(domain: &Domain, shared: &Shared, ended: &mut dyn FnMut() -> bool) {
    let open = |bus: &Bus| Feed::open(bus, TOPICS);
    let mut follower = Follower::new(domain.clone(), "page", &topics::LINK, open)
        .also_on([&topics::ROSTER as _, &topics::DEATHS as _]);
    let mut reading = None;
    while !ended() {
        let taken = follower.wait(LOOK_EVERY).and_then(|event| {
            match event {
                Event::Connected => reading = None,
                Event::Disconnected => shared.lock().connected = false,
                Event::Nothing => {}
                Event::Samples(feed) => {
                    reading = reading.take().or_else(|| Reading::begin(domain, shared));
                    if let Some(Reading { collector, truth, .. }) = &mut reading {
                        let (file, tail) = truth;
                        tail.skip(file, TRUTH_AT_ONCE);
                        tail.lines(file).lines().for_each(|line| {
                            collector.truth(line);
                        });
                        feed.read(&mut |sample| collector.apply(&sample))?;
                    }
                }
            }
            Ok(())
        });
        let problem = taken.err().map(|error| error.to_string()).unwrap_or_default();
        if problem != shared.lock().problem {
            if !problem.is_empty() {
                tracing::error!(problem, "the robot cannot be shown; the viewer tries again");
            }
            shared.lock().problem.clone_from(&problem);
        }
        if !problem.is_empty() {
            thread::park_timeout(AGAIN_AFTER);
        }
        if let Some(reading) = &mut reading {
            reading.publish(shared);
        }
    }
}
