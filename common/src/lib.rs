//! What two processes must agree on: topics, samples, wire protocol, mission file, process shell.
