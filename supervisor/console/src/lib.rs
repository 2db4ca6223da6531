//! The common part of all executables' command lines.
//!
//! | module | holds |
//! |---|---|
//! | [`output`], [`stream`] | standard output, once or going on |
//! | [`executable`] | the main function beside `firsthand`'s |
//! | [`completion`] | completions of shells |
//! | [`consent`] | questions to a person |
//! | [`failure`] | why a subcommand failed, and its exit code |
//! | [`table`], [`item`] | text tables; Markdown items |
//! | [`progress_line`], [`waiting`] | progress, and a robot that is waited for |
//! | [`words`] | states, ages and sizes in words |
//! | [`missions`] | shipped missions and files, with assignments |
//! | [`robots`], [`runs`] | this machine's robots and runs |
//! | [`operator`] | requests and signals to a robot's processes |
//! | [`rates`] | how often topics are published, against the table |
//! | [`logging`] | logs to standard error, a file, the journal |

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
