//! What the command lines of all executables share.
//!
//! | module | holds |
//! |---|---|
//! | [`output`] | text and JSON on standard output, messages on standard error |
//! | [`executable`] | the main function of an executable beside `firsthand` |
//! | [`completion`] | completions of shells |
//! | [`failure`] | why a subcommand failed, and its exit code |
//! | [`stream`] | standard output of a command that goes on |
//! | [`table`], [`item`] | tables of text; items of Markdown lists |
//! | [`progress_line`] | progress on standard error |
//! | [`waiting`] | sentences about a robot that is waited for |
//! | [`words`] | states, ages and sizes in words |
//! | [`missions`] | missions that ship and mission files, with assignments |
//! | [`robots`] | the robots of this machine |
//! | [`runs`] | the directories of runs |
//! | [`operator`] | requests and signals to the processes of a robot |
//! | [`rates`] | how often topics are published, against the table |
//! | [`logging`] | logs to standard error, to a file, to the journal |

pub mod completion;
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
