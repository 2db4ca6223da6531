//! Generated maps of every kind, a slow reference solver, and angles between fields.
#![allow(dead_code, unused_imports, reason = "tests and benchmark each use a part")]

mod angles;
mod maps;
mod random;
mod reference;

pub(crate) use angles::Angles;
pub(crate) use maps::{Kind, Map};
pub(crate) use random::Random;
pub(crate) use reference::{Reference, angle, follow};
