//! The on-demand safety map: range samples to hazard cells, equations (8)-(10), (18), (19).
//!
//! [`step`] is the whole of it, pure; [`shell`] wires it to the topics `pose`, `range` and `grid`.

mod careful;
mod dilation;
mod evidence;
mod fault;
pub mod shell;
pub mod step;
