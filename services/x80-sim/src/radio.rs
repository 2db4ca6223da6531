//! Radio between host and robot: outages, delays, losses, and reordered, joined or cut datagrams.
//!
//! One seeded stream decides all, so runs repeat. Losses go to the ground truth.

use std::collections::VecDeque;

use common::{ground_truth::GroundTruthRadio, mission};

use crate::noise::{Noise, Source};

/// Maximum datagrams in flight; further ones are lost.
const MOST_IN_FLIGHT: usize = 1024;
/// Maximum wait of a datagram to follow or join the next.
const LONGEST_HOLD_S: f64 = 0.5;

struct Flight<W> {
    due: f64,
    way: W,
    bytes: Vec<u8>,
    held: Option<Hold>,
}

enum Hold {
    Behind,
    Joined,
}

/// Simulated radio; `W` is a datagram's direction and peer.
///
/// Good and outage periods are of exponentially distributed duration.
pub struct Radio<W> {
    settings: mission::Radio,
    noise: Noise,
    mean_good: f64,
    out: bool,
    since: f64,
    until: f64,
    longest_outage_s: f64,
    in_flight: VecDeque<Flight<W>>,
    sent: u64,
    lost: u64,
    missed_ticks: u64,
}

impl<W: Copy + PartialEq> Radio<W> {
    pub fn new(settings: mission::Radio, seed: u64) -> Self {
        let mut noise = Noise::new(seed, Source::Radio);
        let mission::Radio { outage_share: share, outage_mean_s: mean, outage_max_s, .. } =
            settings;
        // Truncating the longest outages shortens their mean, but the share must stay.
        let cut_mean = mean * (1.0 - (-outage_max_s / mean).exp());
        let mean_good = if share > 0.0 { cut_mean * (1.0 - share) / share } else { f64::INFINITY };
        let until =
            if mean_good.is_finite() { noise.exponential(mean_good) } else { f64::INFINITY };
        Self {
            settings,
            noise,
            mean_good,
            out: false,
            since: 0.0,
            until,
            longest_outage_s: 0.0,
            in_flight: VecDeque::new(),
            sent: 0,
            lost: 0,
            missed_ticks: 0,
        }
    }

    pub fn is_perfect(&self) -> bool {
        let radio = &self.settings;
        [
            radio.outage_share,
            radio.loss_share,
            radio.delay_s,
            radio.jitter_s,
            radio.duplicate_share,
            radio.reorder_share,
            radio.split_share,
            radio.merge_share,
        ]
        .iter()
        .all(|share| *share == 0.0)
    }

    /// Requires mission time `now` never to decrease.
    fn is_out(&mut self, now: f64) -> bool {
        while now >= self.until {
            self.out = !self.out;
            self.since = self.until;
            self.until += if self.out {
                // A minimum lets time pass even for a mean of 0.
                let outage_s = self.noise.exponential(self.settings.outage_mean_s);
                outage_s.clamp(1e-3, self.settings.outage_max_s)
            } else {
                self.noise.exponential(self.mean_good).max(1e-3)
            };
            assert!(self.until > self.since);
            if self.out && self.until <= now {
                self.longest_outage_s = self.longest_outage_s.max(self.until - self.since);
            }
        }
        if self.out {
            self.longest_outage_s = self.longest_outage_s.max(now - self.since);
        }
        self.out
    }

    pub fn loses(&mut self, now: f64) -> bool {
        self.sent += 1;
        let out = self.is_out(now);
        let lost = self.noise.chance(self.settings.loss_share) || out;
        self.lost += u64::from(lost);
        lost
    }

    pub fn loses_tick(&mut self, now: f64) -> bool {
        let lost = self.loses(now);
        self.missed_ticks += u64::from(lost);
        assert!(self.missed_ticks <= self.lost);
        lost
    }

    pub fn delay(&mut self) -> f64 {
        self.settings.delay_s + self.noise.exponential(self.settings.jitter_s)
    }

    pub fn split(&mut self, bytes: Vec<u8>) -> (Vec<u8>, Vec<u8>) {
        let mut first = bytes;
        if first.len() < 2 || !self.noise.chance(self.settings.split_share) {
            return (first, Vec::new());
        }
        let inner = (first.len() - 1) as f64;
        let second = first.split_off(1 + (self.noise.uniform() * inner) as usize);
        assert!(!second.is_empty());
        (first, second)
    }

    pub fn send(&mut self, now: f64, way: W, bytes: &[u8]) {
        if self.loses(now) {
            return;
        }
        let copies = 1 + usize::from(self.noise.chance(self.settings.duplicate_share));
        for _ in 0..copies {
            self.dispatch(now, way, bytes.to_vec());
        }
    }

    fn dispatch(&mut self, now: f64, way: W, bytes: Vec<u8>) {
        // Datagrams stay in order unless the radio reorders them.
        let same_way = self.in_flight.iter().filter(|flight| flight.way == way);
        let before = same_way
            .filter(|flight| flight.held.is_none())
            .map(|flight| flight.due)
            .fold(now, f64::max);
        let due = (now + self.delay()).max(before);
        let held = if self.noise.chance(self.settings.reorder_share) {
            Some(Hold::Behind)
        } else if self.noise.chance(self.settings.merge_share) {
            Some(Hold::Joined)
        } else {
            None
        };
        let waiting = self
            .in_flight
            .iter()
            .position(|flight| flight.way == way && flight.held.is_some())
            .and_then(|at| self.in_flight.remove(at));
        let (bytes, behind) = match waiting {
            Some(Flight { held: Some(Hold::Joined), bytes: mut first, .. }) => {
                first.extend(bytes);
                (first, None)
            }
            Some(flight) => (bytes, Some(flight.bytes)),
            None => (bytes, None),
        };
        let (first, second) = self.split(bytes);
        let hold = if held.is_some() { LONGEST_HOLD_S } else { 0.0 };
        self.put(due + hold, way, first, held);
        self.put(due + hold, way, second, None);
        self.put(due + hold, way, behind.unwrap_or_default(), None);
    }

    fn put(&mut self, due: f64, way: W, bytes: Vec<u8>, held: Option<Hold>) {
        if bytes.is_empty() {
            return;
        }
        if self.in_flight.len() >= MOST_IN_FLIGHT {
            self.lost += 1;
            return;
        }
        let at = self.in_flight.partition_point(|flight| flight.due <= due);
        let flight = Flight { due, way, bytes, held };
        self.in_flight.insert(at, flight);
    }

    pub fn next_due(&self) -> Option<f64> {
        self.in_flight.front().map(|flight| flight.due)
    }

    pub fn arrived(&mut self, now: f64) -> Option<(W, Vec<u8>)> {
        let flight = self.in_flight.pop_front_if(|flight| flight.due <= now)?;
        Some((flight.way, flight.bytes))
    }

    pub fn ground_truth(&mut self, now: f64) -> GroundTruthRadio {
        GroundTruthRadio {
            out: self.is_out(now),
            sent: self.sent,
            lost: self.lost,
            longest_outage_s: self.longest_outage_s,
            missed_ticks: self.missed_ticks,
        }
    }
}

#[cfg(test)]
mod tests;
