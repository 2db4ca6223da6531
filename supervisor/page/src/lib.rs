//! The robot's page in a browser, and a recorded run as one self-contained file. `firsthand-page`
//! serves the same messages live.
//!
//! | module | holds |
//! |---|---|
//! | `about` | first message of a page |
//! | `collector` | samples as rows, states, maps and fields |
//! | [`blob`] | maps and fields as binary messages |
//! | [`assets`] | HTML, CSS and JavaScript modules from `web/` |
//! | `recorded` | a recorded run as one file |

mod about;
pub mod assets;
pub mod blob;
mod collector;
mod recorded;

pub use about::{about, result};
pub use collector::Collector;
pub use recorded::Recorded;
