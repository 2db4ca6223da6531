//! Thread that reads the bus.

use std::{
    path::PathBuf,
    thread,
    time::{Duration, Instant, SystemTime},
};

use axum::body::Bytes;
use common::{
    bus::Bus,
    clock::{MissionClock, monotonic_ns},
    domain::Domain,
    follower::{Event, Follower},
    ground_truth::GROUND_TRUTH,
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
/// Mission time within which the page sees how a run begins, seconds.
const BEGINS_S: f64 = 2.0;

struct Reading {
    collector: Collector,
    processes: Processes,
    logs: LogFiles,
    logs_read: Instant,
    clock: MissionClock,
    /// Whether the samples that the bus kept are read.
    has_joined: bool,
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
            clock: run.clock,
            has_joined: false,
            truth: (directory.join(GROUND_TRUTH), Tail::default()),
            results: Results::of(&directory, LARGEST_RESULTS),
            packed: None,
        })
    }

    fn publish(&mut self, shared: &Shared) {
        let Self { collector, processes, logs, logs_read, clock, results, packed, .. } = self;
        let mut ended = Vec::new();
        if logs_read.elapsed() >= LOGS_EVERY {
            *logs_read = Instant::now();
            let mut at = None;
            let mut lines: Vec<_> = logs
                .take()
                .into_iter()
                .map(|(process, line)| {
                    // A line without a time continues the one before.
                    at = written(&line).or(at);
                    (at, process, line)
                })
                .collect();
            lines.sort_by_key(|(at, ..)| *at);
            for (at, process, line) in lines {
                collector.state.log(&process, &line, at.and_then(|at| mission_s(*clock, at)));
            }
            ended = results.take();
        }
        collector.usage = processes.look(&collector.state.processes(), Instant::now());
        let (rows, mut events) = (collector.take_rows(), collector.state.take_events());
        if !std::mem::replace(&mut self.has_joined, true) && collector.state.now_s() > BEGINS_S {
            // What holds when the page joins began at an unknown time.
            events.clear();
        }
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
        shown.state.update(state.map(|state| state.to_string().into()));
        shown.map.update(map.map(Bytes::from));
        shown.field.update(field.map(Bytes::from));
        shown.preview.update(preview.map(Bytes::from));
    }
}

/// Returns the time at the beginning of a line of a log.
fn written(line: &str) -> Option<SystemTime> {
    humantime::parse_rfc3339(line.split_whitespace().next()?).ok()
}

/// Returns the mission time at `at`, seconds; `None` if ticks count it.
fn mission_s(clock: MissionClock, at: SystemTime) -> Option<f64> {
    let ago = SystemTime::now().duration_since(at).unwrap_or_default();
    let at_ns = monotonic_ns().saturating_sub(ago.as_nanos() as u64);
    matches!(clock, MissionClock::Wall { .. }).then(|| clock.at(0, at_ns).seconds())
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
                        for line in tail.lines(file).lines() {
                            collector.truth(line);
                        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_a_log_has_the_mission_time_at_which_it_was_written() {
        let epoch_ns = monotonic_ns().saturating_sub(100_000_000_000);
        let clock = MissionClock::Wall { epoch_ns, rate: 2.0 };
        let at = humantime::format_rfc3339_micros(SystemTime::now() - Duration::from_secs(60));
        let line = format!("{at}  INFO mapper: ready");
        let found = mission_s(clock, written(&line).unwrap()).unwrap();
        // 40 s after the epoch, at double pace.
        assert!((78.0..90.0).contains(&found), "{found}");
        assert_eq!(written("   at mapper/src/step.rs:1"), None);
    }
}
