//! Command line code that all executables share.
//!
//! | module | holds |
//! |---|---|
//! | [`output`], [`stream`] | standard output, once or continuous |
//! | [`executable`] | main function of the other executables |
//! | [`completion`] | shell completions |
//! | [`consent`] | questions to a person |
//! | [`failure`] | errors of subcommands, and exit codes |
//! | [`table`], [`item`] | text tables; Markdown items |
//! | [`progress_line`], [`waiting`] | progress, and waiting for a robot |
//! | [`words`] | states, ages and sizes in words |
//! | [`missions`] | shipped missions and files, with assignments |
//! | [`robots`], [`runs`] | this machine's robots and runs |
//! | [`operator`] | requests and signals to a robot's processes |
//! | [`rates`] | topic rates, compared with the table |
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
