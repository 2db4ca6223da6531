//! How often topics are published, how long the gaps are, and whether that is what the table says.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use common::{
    bus::{Author, Stamp},
    topics::{Rate, Spec},
};
use serde::Serialize;

use super::words::age;

/// A topic that is published again after a while may be so many times as late: its writer looks at the clock once in each
/// turn of its work loop.
const LATE: u32 = 2;

/// What came on one topic.
#[derive(Debug)]
pub(crate) struct TopicRates {
    spec: &'static Spec,
    /// By process: a topic may have many writers.
    writers: BTreeMap<u32, Newest>,
    /// When the last sample came.
    at: Option<Instant>,
    /// Since when is counted.
    since: Instant,
    counts: Counts,
}

/// The newest sample of a process.
#[derive(Debug)]
struct Newest {
    at: Instant,
    stamp: Stamp,
}

/// What came since the last report.
#[derive(Debug, Default)]
struct Counts {
    samples: u64,
    lost: u64,
    ticks: u64,
    missing_ticks: u64,
    longest_gap: Duration,
    late: bool,
}

/// What came on a topic in a while.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Report {
    /// The topic.
    pub(crate) topic: &'static str,
    /// Samples a second of the machine's clock.
    pub(crate) rate_hz: f64,
    /// The longest time between two samples of one process, the time since the last one among them; none before two samples.
    pub(crate) longest_gap_s: Option<f64>,
    /// Time since the last sample; none before the first.
    pub(crate) age_s: Option<f64>,
    /// Samples that came too fast for this reader.
    pub(crate) lost: u64,
    /// Ticks that passed by the samples.
    pub(crate) ticks: u64,
    /// Those of them without a sample; none where the table does not say that each has one.
    pub(crate) missing_ticks: Option<u64>,
    /// Whether a gap was more than twice as long as the table says; none where it does not say.
    pub(crate) late: Option<bool>,
    /// What the table says.
    #[serde(skip)]
    rate: Rate,
}

impl TopicRates {
    /// Nothing came yet at `now` on the topic of `spec`.
    pub(crate) fn new(spec: &'static Spec, now: Instant) -> Self {
        Self {
            spec,
            writers: BTreeMap::new(),
            at: None,
            since: now,
            counts: Counts::default(),
        }
    }

    /// A sample of `author` came at `now`. The first of each process is what the topic keeps for new readers: it has no age.
    pub(crate) fn add(&mut self, author: Author, stamp: Stamp, now: Instant) {
        self.at = Some(now);
        let newest = Newest { at: now, stamp };
        let Some(last) = self.writers.insert(author.process, newest) else {
            return;
        };
        let counts = &mut self.counts;
        counts.samples += 1;
        if last.stamp.generation == stamp.generation {
            let next = last.stamp.sequence.wrapping_add(1);
            counts.lost += u64::from(stamp.sequence.wrapping_sub(next).min(i32::MAX as u32));
        }
        let ticks = stamp.tick.saturating_sub(last.stamp.tick);
        counts.ticks += ticks;
        counts.missing_ticks += ticks.saturating_sub(1);
        let gap = now.saturating_duration_since(last.at);
        // The rate may be meant in mission time, which may pass faster or slower.
        let mission = stamp.stamp_ns.saturating_sub(last.stamp.stamp_ns);
        counts.late |= is_late(self.spec.rate, gap.min(Duration::from_nanos(mission)));
        counts.longest_gap = counts.longest_gap.max(gap);
    }

    /// What came since the last report, at `now`.
    pub(crate) fn report(&mut self, now: Instant) -> Report {
        let counts = std::mem::take(&mut self.counts);
        let over = now.saturating_duration_since(self.since).as_secs_f64();
        self.since = now;
        let age = self.at.map(|at| now.saturating_duration_since(at));
        let gap = (!counts.longest_gap.is_zero()).then_some(counts.longest_gap);
        // A topic that has gone silent has no gap that ends.
        let gap = gap.max(age);
        let rate = self.spec.rate;
        Report {
            topic: self.spec.name,
            rate_hz: if over > 0.0 {
                counts.samples as f64 / over
            } else {
                0.0
            },
            longest_gap_s: gap.map(|gap| gap.as_secs_f64()),
            age_s: age.map(|age| age.as_secs_f64()),
            lost: counts.lost,
            ticks: counts.ticks,
            missing_ticks: (rate == Rate::EachTick).then_some(counts.missing_ticks),
            late: matches!(rate, Rate::OnChange { .. })
                .then(|| counts.late || age.is_some_and(|age| is_late(rate, age))),
            rate,
        }
    }
}

/// Whether a topic of `rate` is published later than it says.
fn is_late(rate: Rate, gap: Duration) -> bool {
    matches!(rate, Rate::OnChange { again_after, .. } if gap > LATE * again_after)
}

/// The first line of a table of reports.
pub(crate) fn heading() -> String {
    format!(
        "{:<13}{:>11}{:>13}{:>10}{:>6}  by the table",
        "topic", "samples/s", "longest gap", "age", "lost"
    )
}

impl Report {
    /// A line of the table.
    pub(crate) fn line(&self) -> String {
        let rate = format!("{:.1}", self.rate_hz);
        let gap = self
            .longest_gap_s
            .map_or("-".to_owned(), |gap| age(Some(gap)));
        format!(
            "{:<13}{rate:>11}{gap:>13}{:>10}{:>6}  {}",
            self.topic,
            age(self.age_s),
            self.lost,
            self.by_the_table()
        )
    }

    fn by_the_table(&self) -> String {
        match self.rate {
            Rate::EachTick => match self.missing_ticks.unwrap_or_default() {
                0 => "each tick: kept".to_owned(),
                missing => format!("each tick: MISSING {missing} of {}", self.ticks),
            },
            Rate::EachFrame => "each frame of the robot".to_owned(),
            Rate::WhenItHappens => "when it happens".to_owned(),
            Rate::OnChange { again_after, .. } => {
                let kept = match (self.age_s, self.late) {
                    (None, _) => "never came",
                    (_, Some(true)) => "LATE",
                    _ => "kept",
                };
                format!("again after {} ms: {kept}", again_after.as_millis())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use common::topics::{self, AnyTopic as _};

    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn stamp(number: u32, tick: u64) -> Stamp {
        Stamp {
            tick,
            stamp_ns: u64::from(number) * 100_000_000,
            generation: 1,
            sequence: number,
        }
    }

    fn of(process: u32) -> Author {
        Author {
            process,
            generation: 1,
        }
    }

    #[test]
    fn a_tick_without_a_sample_is_missing_and_one_that_was_overwritten_is_lost() {
        let began = Instant::now();
        let mut pose = TopicRates::new(topics::POSE.spec(), began);
        for (at, number, tick) in [(0, 0, 10), (100, 1, 11), (200, 3, 13), (500, 4, 13)] {
            pose.add(of(1), stamp(number, tick), began + at * MS);
        }
        let report = pose.report(began + 1000 * MS);
        assert_eq!((report.rate_hz, report.lost), (3.0, 1));
        assert_eq!((report.ticks, report.missing_ticks), (3, Some(1)));
        assert_eq!(report.age_s, Some(0.5));
        assert_eq!(report.longest_gap_s, Some(0.5), "the silence since");
        assert!(
            report.line().ends_with("each tick: MISSING 1 of 3"),
            "{}",
            report.line()
        );
        let next = pose.report(began + 2000 * MS);
        assert_eq!((next.rate_hz, next.missing_ticks), (0.0, Some(0)));
    }

    #[test]
    fn a_topic_that_is_not_published_again_in_time_is_late_and_writers_are_told_apart() {
        let began = Instant::now();
        let mut health = TopicRates::new(topics::HEALTH.spec(), began);
        for number in 0..50 {
            for process in [1, 2] {
                health.add(of(process), stamp(number, 0), began + 20 * number * MS);
            }
        }
        let report = health.report(began + 1000 * MS);
        assert_eq!((report.rate_hz, report.late), (98.0, Some(false)));
        assert_eq!(report.longest_gap_s, Some(0.02));
        // One of the two has stopped.
        for number in 50..100 {
            health.add(of(1), stamp(number, 0), began + 20 * number * MS);
        }
        health.add(of(2), stamp(60, 0), began + 2000 * MS);
        let report = health.report(began + 2000 * MS);
        assert_eq!(
            (report.late, report.longest_gap_s),
            (Some(true), Some(1.02))
        );
    }

    #[test]
    fn a_rate_in_mission_time_that_passes_fast_or_slowly_is_kept() {
        for pace in [1, 10] {
            let began = Instant::now();
            let mut field = TopicRates::new(topics::FIELD.spec(), began);
            for number in 0..3 {
                let stamp = Stamp {
                    stamp_ns: u64::from(number) * 1_000_000_000,
                    ..stamp(number, 0)
                };
                field.add(of(1), stamp, began + 1000 * number * MS * pace);
            }
            let report = field.report(began + 2000 * MS * pace);
            assert_eq!(report.late, Some(false), "at a pace of 1/{pace}");
        }
    }
}
