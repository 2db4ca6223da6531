//! Data for browsers, shared by the bus thread and the sessions.

use std::{
    collections::VecDeque,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
};

use axum::body::Bytes;
use serde_json::Value;
use tokio::sync::watch;

/// Most items of a series: rows of ten minutes at 10 Hz.
const MOST: usize = 6000;
const AT_ONCE: usize = 500;

/// Value with a number that grows with each new one.
#[derive(Clone, Debug, Default)]
pub struct Newest<T> {
    number: u64,
    value: Option<T>,
}

impl<T: Clone> Newest<T> {
    pub fn update(&mut self, newer: Option<T>) {
        if newer.is_some() {
            (self.number, self.value) = (self.number + 1, newer);
        }
    }

    fn after(&self, cursor: &mut u64) -> Option<T> {
        let is_new = std::mem::replace(cursor, self.number) != self.number;
        self.value.clone().filter(|_| is_new)
    }
}

#[derive(Debug, Default)]
pub struct Ring {
    first: u64,
    items: VecDeque<Arc<str>>,
}

impl Ring {
    pub fn push(&mut self, item: &Value) {
        if self.items.len() == MOST {
            self.items.pop_front();
            self.first += 1;
        }
        self.items.push_back(item.to_string().into());
        assert!(self.items.len() <= MOST);
    }

    /// Returns at most [`AT_ONCE`] items that are new for a browser at `cursor`.
    fn after(&self, cursor: &mut u64) -> Vec<Arc<str>> {
        let from = cursor.saturating_sub(self.first) as usize;
        let found: Vec<_> = self.items.iter().skip(from).take(AT_ONCE).cloned().collect();
        *cursor = self.first + from.min(self.items.len()) as u64 + found.len() as u64;
        assert!(*cursor <= self.first + self.items.len() as u64);
        found
    }
}

#[derive(Debug, Default)]
pub struct Shown {
    run: u64,
    about: Option<Arc<str>>,
    pub connected: bool,
    pub simulated: bool,
    pub rows: Ring,
    pub events: Ring,
    pub results: Ring,
    pub state: Newest<Arc<str>>,
    pub map: Newest<Bytes>,
    pub field: Newest<Bytes>,
    pub preview: Newest<Bytes>,
    pub wanted: Option<[f64; 2]>,
    /// Empty if the robot can be shown.
    pub problem: String,
}

impl Shown {
    /// Drops the data of the last one.
    pub fn begin(&mut self, about: &Value, simulated: bool) {
        *self = Self {
            run: self.run + 1,
            about: Some(about.to_string().into()),
            connected: true,
            simulated,
            ..Self::default()
        };
    }
}

#[derive(Debug, Default)]
pub struct Shared {
    shown: Mutex<Shown>,
    /// Whether an operator stopped the robot, and the link's action in words.
    pub link: watch::Sender<(bool, String)>,
    watching: AtomicUsize,
}

impl Shared {
    pub fn lock(&self) -> MutexGuard<'_, Shown> {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn is_watched(&self) -> bool {
        self.watching.load(Ordering::Relaxed) > 0
    }
}

#[derive(Debug, Default)]
struct Sent {
    run: Option<u64>,
    connected: bool,
    problem: String,
    rows: u64,
    events: u64,
    results: u64,
    state: u64,
    map: u64,
    field: u64,
    preview: u64,
}

pub struct Cursor {
    shared: Arc<Shared>,
    sent: Sent,
}

#[derive(Debug, Default)]
pub struct News {
    /// JSON, or empty without news.
    pub text: String,
    pub blobs: Vec<Bytes>,
}

impl Cursor {
    pub fn new(shared: &Arc<Shared>) -> Self {
        shared.watching.fetch_add(1, Ordering::Relaxed);
        Self { shared: shared.clone(), sent: Sent::default() }
    }

    pub fn news(&mut self) -> News {
        let sent = &mut self.sent;
        let shown = self.shared.lock();
        let mut parts = Vec::new();
        if sent.run != Some(shown.run) {
            *sent = Sent { run: Some(shown.run), connected: !shown.connected, ..Sent::default() };
            parts.push(format!("\"about\":{}", shown.about.as_deref().unwrap_or("null")));
        }
        if sent.connected != shown.connected || sent.problem != shown.problem {
            sent.connected = shown.connected;
            sent.problem.clone_from(&shown.problem);
            parts.push(format!("\"running\":{}", shown.connected));
            parts.push(format!("\"problem\":{}", Value::from(shown.problem.as_str())));
        }
        for (name, ring, cursor) in [
            ("rows", &shown.rows, &mut sent.rows),
            ("events", &shown.events, &mut sent.events),
            ("results", &shown.results, &mut sent.results),
        ] {
            let items = ring.after(cursor);
            if !items.is_empty() {
                parts.push(format!("\"{name}\":[{}]", items.join(",")));
            }
        }
        if let Some(state) = shown.state.after(&mut sent.state) {
            parts.push(format!("\"state\":{state}"));
        }
        let blobs = [
            shown.map.after(&mut sent.map),
            shown.field.after(&mut sent.field),
            shown.preview.after(&mut sent.preview),
        ];
        let text =
            if parts.is_empty() { String::new() } else { format!("{{{}}}", parts.join(",")) };
        News { text, blobs: blobs.into_iter().flatten().collect() }
    }
}

impl Drop for Cursor {
    fn drop(&mut self) {
        self.shared.watching.fetch_sub(1, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_slow_browser_gets_the_newest_map_and_no_more_rows_than_are_held() {
        let shared = Arc::new(Shared::default());
        shared.lock().begin(&json!({"robot": "x80"}), true);
        let mut cursor = Cursor::new(&shared);
        assert!(cursor.news().text.contains("\"robot\":\"x80\""));
        for row in 0..MOST + 100 {
            shared.lock().rows.push(&json!([row]));
            shared.lock().map.update(Some(Bytes::from(row.to_string())));
        }
        let (mut rows, mut blobs) = (0, Vec::new());
        loop {
            let news = cursor.news();
            blobs.extend(news.blobs);
            if news.text.is_empty() {
                break;
            }
            let text: Value = serde_json::from_str(&news.text).unwrap();
            let some = text["rows"].as_array().unwrap();
            assert!(some.len() <= AT_ONCE);
            assert!(rows > 0 || some[0][0] == 100, "the oldest are dropped");
            rows += some.len();
        }
        assert_eq!((rows, blobs), (MOST, vec![Bytes::from((MOST + 99).to_string())]));
    }

    #[test]
    fn a_new_run_begins_the_page_anew_and_a_run_that_has_ended_is_told() {
        let shared = Arc::new(Shared::default());
        shared.lock().begin(&json!(1), true);
        shared.lock().rows.push(&json!([1.0]));
        let mut cursor = Cursor::new(&shared);
        assert!(cursor.news().text.contains("rows"));
        shared.lock().connected = false;
        assert_eq!(cursor.news().text, r#"{"running":false,"problem":""}"#);
        shared.lock().begin(&json!(2), true);
        shared.lock().rows.push(&json!([2.0]));
        let text = cursor.news().text;
        assert_eq!(text, r#"{"about":2,"running":true,"problem":"","rows":[[2.0]]}"#);
        assert!(shared.is_watched());
        drop(cursor);
        assert!(!shared.is_watched());
    }
}
