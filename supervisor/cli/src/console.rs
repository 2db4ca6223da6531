//! Code that several subcommands use.
//!
//! | module | holds |
//! |---|---|
//! | [`output`] | text and JSON on standard output, messages on standard error |
//! | [`failure`] | why a subcommand failed, and its exit code |
//! | [`stream`] | standard output of a command that goes on |
//! | [`table`] | tables of text |
//! | [`progress_line`] | progress on standard error |
//! | [`waiting`] | sentences about a robot that is waited for |
//! | [`words`] | states, ages and sizes in words |
//! | [`missions`] | missions that ship and mission files, with assignments |
//! | [`robots`] | the robots of this machine |
//! | [`runs`] | the directories of runs |
//! | [`operator`] | requests and signals to the processes of a robot |
//! | [`rates`] | how often topics are published, against the table |

pub(crate) mod failure;
pub(crate) mod missions;
pub(crate) mod operator;
pub(crate) mod output;
pub(crate) mod progress_line;
pub(crate) mod rates;
pub(crate) mod robots;
pub(crate) mod runs;
pub(crate) mod stream;
pub(crate) mod table;
pub(crate) mod waiting;
pub(crate) mod words;
