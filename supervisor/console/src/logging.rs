//! The log of this process.
//!
//! The journal takes lines from standard error and reads a priority from a leading `<N>` (sd-daemon(3)); that needs
//! no library, and a line is the same wherever it is read.
//!
//! A line that cannot be written, because the disk is full or the terminal is closed, is dropped silently: tracing
//! would report it on standard error and panic if that fails too.

use std::{
    fs::File,
    io::{self, Write},
    os::{fd::AsFd, unix::fs::MetadataExt},
    path::Path,
    sync::Mutex,
};

use common::file::append;

use tracing::{Level, Metadata};
use tracing_subscriber::{
    Layer, Registry,
    filter::Targets,
    fmt::{
        self, MakeWriter,
        format::Writer,
        time::{FormatTime as _, SystemTime},
    },
    layer::SubscriberExt,
    util::SubscriberInitExt,
};

type AnyLayer = Box<dyn Layer<Registry> + Send + Sync>;

/// `JOURNAL_STREAM` says which file the journal reads, and children inherit it even if their standard error is
/// redirected, so the file is compared.
pub fn to_journal() -> bool {
    let Some(journal) = std::env::var_os("JOURNAL_STREAM") else {
        return false;
    };
    let stderr = io::stderr().as_fd().try_clone_to_owned().map(File::from);
    let Ok(found) = stderr.and_then(|stderr| stderr.metadata()) else {
        return false;
    };
    journal.to_str() == Some(&format!("{}:{}", found.dev(), found.ino()))
}

/// FIRSTHAND_LOG says what is logged, or else everything from level `default` up.
pub fn to_stderr(default: &str) {
    start(vec![stderr_layer()], default);
}

/// Appends what is informational or more to `file`, and to the journal if there is one. Fails if the file cannot be opened.
pub fn to_file(file: &Path) -> io::Result<()> {
    let log = Mutex::new(append(file)?);
    let mut layers: Vec<AnyLayer> =
        vec![fmt::layer().with_writer(log).log_internal_errors(false).with_ansi(false).boxed()];
    if to_journal() {
        layers.push(stderr_layer());
    }
    start(layers, "info");
    Ok(())
}

/// The date as logs have it: UTC, year-month-day.
pub fn today() -> String {
    let mut now = String::new();
    // Writing to a String cannot fail.
    let _ = SystemTime.format_time(&mut Writer::new(&mut now));
    now.truncate("1970-01-01".len());
    now
}

fn stderr_layer() -> AnyLayer {
    let lines = fmt::layer().log_internal_errors(false).with_ansi(false);
    if to_journal() {
        lines.without_time().with_level(false).with_writer(Journal("<6>")).boxed()
    } else {
        lines.with_writer(io::stderr).boxed()
    }
}

fn start(layers: Vec<AnyLayer>, default: &str) {
    // The library of ROS 2 logs each of its sockets and each message that it sends to itself.
    let wanted = std::env::var("FIRSTHAND_LOG").ok().and_then(|wanted| wanted.parse().ok());
    let filter: Targets = wanted
        .or_else(|| format!("rustdds=error,{default}").parse().ok())
        .unwrap_or_else(|| Targets::new().with_default(Level::INFO));
    tracing_subscriber::registry().with(layers).with(filter).init();
}

/// Standard error with this priority before each line.
struct Journal(&'static str);

impl<'writer> MakeWriter<'writer> for Journal {
    type Writer = Self;

    fn make_writer(&'writer self) -> Self {
        Self(self.0)
    }

    fn make_writer_for(&'writer self, event: &Metadata<'_>) -> Self {
        Self(priority(*event.level()))
    }
}

/// syslog(3): 3 error, 4 warning, 6 informational, 7 debug.
fn priority(level: Level) -> &'static str {
    match level {
        Level::ERROR => "<3>",
        Level::WARN => "<4>",
        Level::INFO => "<6>",
        _ => "<7>",
    }
}

impl Write for Journal {
    /// Each line of an event is an entry of the journal and gets the priority. All are written at once, so that lines
    /// of two processes do not mix.
    fn write(&mut self, event: &[u8]) -> io::Result<usize> {
        let mut entry = Vec::with_capacity(event.len() + self.0.len());
        for line in event.split_inclusive(|&byte| byte == b'\n') {
            entry.extend_from_slice(self.0.as_bytes());
            entry.extend_from_slice(line);
        }
        io::stderr().write_all(&entry)?;
        Ok(event.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}
