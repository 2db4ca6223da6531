//! The names that subcommands had before they were grouped by nouns. They stay for one release and no help lists them.

use std::ffi::{OsStr, OsString};

/// Old names, each with the words that replace it.
pub(crate) static RENAMED: [(&str, &[&str]); 16] = [
    ("chaos", &["bench", "chaos"]),
    ("consumer", &["bench", "consumer"]),
    ("diff", &["runs", "diff"]),
    ("echo", &["topic", "echo"]),
    ("failsafe", &["table", "failsafe"]),
    ("fault", &["stage", "fault"]),
    ("faults", &["table", "faults"]),
    ("freeze", &["stage", "freeze"]),
    ("hz", &["topic", "hz"]),
    ("kill", &["stage", "kill"]),
    ("latency", &["bench", "tick"]),
    ("list", &["status", "--all"]),
    ("restart", &["stage", "restart"]),
    ("stages", &["stage", "list"]),
    ("thaw", &["stage", "thaw"]),
    ("topics", &["topic", "list"]),
];

/// The words after the executable, with an old name replaced.
pub(crate) fn words<T: AsRef<OsStr>>(given: &[T]) -> Vec<OsString> {
    let given: Vec<_> = given.iter().map(|word| word.as_ref().to_owned()).collect();
    let new = given.first().and_then(|name| RENAMED.iter().find(|(old, _)| name == old));
    match new {
        Some((_, new)) => {
            new.iter().map(OsString::from).chain(given[1..].iter().cloned()).collect()
        }
        None => given,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_old_name_is_replaced_where_a_subcommand_stands_and_nowhere_else() {
        let renamed = |line: &[&str]| words(line).join(" ".as_ref());
        assert_eq!(renamed(&["kill", "mapper"]), "stage kill mapper");
        assert_eq!(renamed(&["topic", "list"]), "topic list");
        assert_eq!(renamed(&[]), "");
    }
}
