//! Log of this process.
//!
//! The journal reads standard error, with priorities in a leading `<N>` (sd-daemon(3)).
//!
//! Unwritable lines, due to a full disk or a closed terminal, are dropped. Otherwise tracing would
//! report them on standard error, and panic if that fails too.

use std::{
    io::{self, Write},
    path::Path,
    sync::Mutex,
};

use common::file::append;
use rustix::fs::fstat;
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

/// Returns whether the journal reads standard error. Redirected children inherit `JOURNAL_STREAM`,
/// so the file is compared.
pub fn to_journal() -> bool {
    let journal = std::env::var("JOURNAL_STREAM");
    fstat(io::stderr()).is_ok_and(|it| journal == Ok(format!("{}:{}", it.st_dev, it.st_ino)))
}

/// Logs by the filter in FIRSTHAND_LOG, or from level `default` up.
pub fn to_stderr(default: &str) {
    start(vec![stderr_layer()], default);
}

/// Logs from level info up to `file`, and to the journal if present.
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

/// Returns the UTC date as in logs: year-month-day.
pub fn today() -> String {
    let mut now = String::new();
    // Infallible for a String.
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
    // The ROS 2 library is too verbose.
    let filter: Targets = std::env::var("FIRSTHAND_LOG")
        .ok()
        .and_then(|wanted| wanted.parse().ok())
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

    /// Takes the priority by syslog(3).
    fn make_writer_for(&'writer self, event: &Metadata<'_>) -> Self {
        Self(match *event.level() {
            Level::ERROR => "<3>",
            Level::WARN => "<4>",
            Level::INFO => "<6>",
            _ => "<7>",
        })
    }
}

impl Write for Journal {
    /// Prefixes each line, a journal entry, with the priority, in a single write.
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
