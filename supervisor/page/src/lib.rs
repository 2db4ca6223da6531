//! The robot's page: what a browser is sent, and a recorded run in one file that refers to nothing else. The live page, which
//! `firsthand-page` serves, sends the same messages to the same modules.
//!
//! | module | holds |
//! |---|---|
//! | `about` | the first message of a page |
//! | `collector` | samples as rows, states, maps and fields |
//! | [`blob`] | maps and fields as binary messages |
//! | [`assets`] | HTML, CSS and the modules of JavaScript, which lie in `web/` |
//! | `recorded` | a recorded run as one file |

mod about;
pub mod assets;
pub mod blob;
mod collector;
mod recorded;

pub use about::{about, result};
pub use collector::Collector;
pub use recorded::Recorded;
