//! Rates and gaps of topics, compared with the table.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use common::{
    bus::{Author, Stamp},
    topics::{Rate, Spec},
};
use serde::Serialize;

use super::{table::Table, words::age};

/// Intervals after which a topic is late; writers check the clock once per loop iteration.
const LATE: u32 = 2;

#[derive(Debug)]
pub struct TopicRates {
    spec: &'static Spec,
    /// Newest sample and arrival per process; topics may have many writers.
    writers: BTreeMap<u32, (Instant, Stamp)>,
    at: Option<Instant>,
    since: Instant,
    counts: Counts,
}

#[derive(Debug, Default)]
struct Counts {
    samples: u64,
    lost: u64,
    ticks: u64,
    missing_ticks: u64,
    longest_gap: Duration,
    late: bool,
}

#[derive(Debug, Serialize)]
pub struct Report {
    pub topic: &'static str,
    pub rate_hz: f64,
    /// Longest gap within a process, or since the last sample.
    pub longest_gap_s: Option<f64>,
    pub age_s: Option<f64>,
    /// Samples overwritten before this reader took them.
    pub lost: u64,
    pub ticks: u64,
    /// Ticks without a sample, if the table promises one per tick.
    pub missing_ticks: Option<u64>,
    /// Whether a gap exceeded twice the promised interval.
    pub late: Option<bool>,
    #[serde(skip)]
    rate: Rate,
}

impl TopicRates {
    pub fn new(spec: &'static Spec, now: Instant) -> Self {
        Self { spec, writers: BTreeMap::new(), at: None, since: now, counts: Counts::default() }
    }

    /// Ignores each process's first sample, possibly an old stored one.
    pub fn add(&mut self, author: Author, stamp: Stamp, now: Instant) {
        self.at = Some(now);
        let Some((at, last)) = self.writers.insert(author.process, (now, stamp)) else { return };
        let counts = &mut self.counts;
        counts.samples += 1;
        if last.generation == stamp.generation {
            let next = last.sequence.wrapping_add(1);
            // A mirror repeats its newest sample.
            let ahead = stamp.sequence.wrapping_sub(next).cast_signed();
            counts.lost += u64::from(ahead.max(0).unsigned_abs());
        }
        let ticks = stamp.tick.saturating_sub(last.tick);
        counts.ticks += ticks;
        counts.missing_ticks += ticks.saturating_sub(1);
        let gap = now.saturating_duration_since(at);
        // Rates may be in mission time.
        let mission = stamp.stamp_ns.saturating_sub(last.stamp_ns);
        counts.late |= is_late(self.spec.rate, gap.min(Duration::from_nanos(mission)));
        counts.longest_gap = counts.longest_gap.max(gap);
    }

    pub fn report(&mut self, now: Instant) -> Report {
        let counts = std::mem::take(&mut self.counts);
        let over = now.saturating_duration_since(self.since).as_secs_f64();
        self.since = now;
        let age = self.at.map(|at| now.saturating_duration_since(at));
        let gap = (!counts.longest_gap.is_zero()).then_some(counts.longest_gap);
        // A silent topic lacks the second sample of its gap.
        let gap = gap.max(age);
        let rate = self.spec.rate;
        Report {
            topic: self.spec.name,
            rate_hz: if over > 0.0 { counts.samples as f64 / over } else { 0.0 },
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

fn is_late(rate: Rate, gap: Duration) -> bool {
    matches!(rate, Rate::OnChange { again_after, .. } if gap > LATE * again_after)
}

pub fn table(reports: &[Report]) -> String {
    let mut table =
        Table::new(["topic", ">samples/s", ">longest gap", ">age", ">lost", "by the table"]);
    for report in reports {
        let gap = report.longest_gap_s;
        table.row([
            &report.topic,
            &format!("{:.1}", report.rate_hz),
            &gap.map_or("-".to_owned(), |gap| age(Some(gap))),
            &age(report.age_s),
            &report.lost,
            &report.by_the_table(),
        ]);
    }
    table.to_string()
}

impl Report {
    fn by_the_table(&self) -> String {
        match self.rate {
            Rate::EachTick => match self.missing_ticks.unwrap_or_default() {
                0 => "each tick: ok".to_owned(),
                missing => format!("each tick: MISSING {missing} of {}", self.ticks),
            },
            Rate::EachFrame => "each frame of the robot".to_owned(),
            Rate::WhenItHappens => "when it happens".to_owned(),
            Rate::OnChange { again_after, .. } => {
                let seen = match (self.age_s, self.late) {
                    (None, _) => "never came",
                    (_, Some(true)) => "LATE",
                    _ => "ok",
                };
                format!("again after {} ms: {seen}", again_after.as_millis())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use common::topics;

    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn stamp(number: u32, tick: u64) -> Stamp {
        Stamp { tick, stamp_ns: u64::from(number) * 100_000_000, generation: 1, sequence: number }
    }

    fn of(process: u32) -> Author {
        Author { process, generation: 1 }
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
        // One of the two writers has stopped.
        for number in 50..100 {
            health.add(of(1), stamp(number, 0), began + 20 * number * MS);
        }
        health.add(of(2), stamp(60, 0), began + 2000 * MS);
        let report = health.report(began + 2000 * MS);
        assert_eq!((report.late, report.longest_gap_s), (Some(true), Some(1.02)));
    }

    #[test]
    fn a_rate_in_mission_time_that_passes_fast_or_slowly_is_kept() {
        for pace in [1, 10] {
            let began = Instant::now();
            let mut field = TopicRates::new(topics::FIELD.spec(), began);
            for number in 0..3 {
                let stamp =
                    Stamp { stamp_ns: u64::from(number) * 1_000_000_000, ..stamp(number, 0) };
                field.add(of(1), stamp, began + 1000 * number * MS * pace);
            }
            let report = field.report(began + 2000 * MS * pace);
            assert_eq!(report.late, Some(false), "at a pace of 1/{pace}");
        }
    }
}
