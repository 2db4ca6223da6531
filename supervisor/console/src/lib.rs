//! Command line code that all executables share.

pub mod addresses;
pub mod completion;
pub mod consent;
pub mod executable;
pub mod failure;
pub mod item;
pub mod logging;
pub mod missions;
pub mod operator;
pub mod output;
pub mod progress_line;
pub mod rates;
pub mod robots;
pub mod runs;
pub mod stream;
pub mod table;
pub mod waiting;
pub mod words;
