//! The robot's page in a browser: live over a websocket, or a recorded run in one file that refers to nothing else. Both show the same
//! messages with the same modules.
//!
//! | module | holds |
//! |---|---|
//! | `about` | the first message of a page |
//! | `collector` | samples as rows, states, events |
//! | `events` | deaths, recoveries, orders and log lines as one list |
//! | `blob` | maps and fields as binary messages |
//! | `assets` | HTML, CSS and the modules of JavaScript, which lie in `web/` |
//! | `recorded` | a recorded run as one file |
//! | [`live`] | the live page (feature `live`) |

mod about;
mod assets;
mod blob;
mod collector;
mod events;
#[cfg(feature = "live")]
pub mod live;
mod recorded;

use common::{grid::GridFrame, samples::FieldCell};
use glam::DVec2;

pub use about::about;
pub use collector::Collector;
pub use events::{Event, Kind};
pub use recorded::Recorded;

/// The field of `cells` to `target` at mission time `time_s`, as a message.
pub fn field(frame: GridFrame, cells: &[FieldCell], target: DVec2, time_s: f64) -> Vec<u8> {
    blob::field(blob::Shown::Field, frame, cells, target, time_s)
}
