//! What outlives a process, and may meet a program of another version.

use common::checkpoint;
use console::item::item;

enum Version {
    Firsthand,
    /// Raised when the encoding changes.
    OfStates,
    Mcap,
    /// It is read by the names in it.
    None,
}

impl Version {
    fn text(&self) -> String {
        match self {
            Self::Firsthand => "that of firsthand".to_owned(),
            Self::OfStates => format!("that of states, {}", checkpoint::VERSION.escape_ascii()),
            Self::Mcap => "that of firsthand, MCAP 0".to_owned(),
            Self::None => "none".to_owned(),
        }
    }
}

struct Row {
    what: &'static str,
    version: Version,
    /// What a program does with it that is of another version, older or newer.
    another: &'static str,
    tests: &'static [&'static str],
}

static TABLE: [Row; 8] = [
    Row {
        what: "a robot's bus, with requests and their answers",
        version: Version::Firsthand,
        another: "it is joined if only the last number differs, from 1.0 on the last two; else refused [other-version]: the error names \
                  the robot's version, whose commands are to be used. A topic whose fields differ is refused [other-payload]",
        tests: &[
            "a_bus_of_another_version_is_not_joined_and_its_version_is_named",
            "a_topic_is_not_opened_by_a_program_for_which_the_same_bytes_are_other_fields",
            "a_robot_of_another_version_is_named_and_can_be_stopped",
        ],
    },
    Row {
        what: "the socket of `firsthand stop`",
        version: Version::None,
        another: "a stop of any version is obeyed, and is answered; other bytes are ignored",
        tests: &["a_robot_of_another_version_is_named_and_can_be_stopped"],
    },
    Row {
        what: "`run.toml`",
        version: Version::Firsthand,
        another: "it is read if all its keys are known, else refused [other-version]: go on with the version that it names, or start a \
                  new run",
        tests: &["a_run_file_of_another_version_is_read_or_refused_by_its_version"],
    },
    Row {
        what: "states in `*.checkpoint` and `mapper.journal`",
        version: Version::OfStates,
        another: "refused [other-version]: go on with the version that `run.toml` names, or start a new run, as `--resume-last` and \
                  with it the service do by themselves",
        tests: &[
            "a_checkpoint_of_another_version_is_refused_by_name_and_not_taken_for_none",
            "a_whole_entry_of_another_version_or_type_is_refused_and_not_cut_off",
            "a_service_begins_anew_after_a_run_of_another_version_and_says_so",
        ],
    },
    Row {
        what: "recordings",
        version: Version::Mcap,
        another: "read if all its topics that are known have the same fields, else refused [other-version]: use the version that \
                  the record `run` names. `replay` names the generations whose inputs it cannot take",
        tests: &["a_recording_of_another_version_is_refused_by_what_it_cannot_be_read_for"],
    },
    Row {
        what: "mission files, also `/etc/firsthand/mission.toml`, which an upgrade leaves",
        version: Version::None,
        another: "a key that is not known is refused with its line and the remedy [mission], exit code 78",
        tests: &[
            "every_refusal_names_line_and_key",
            "an_invalid_mission_is_refused_with_line_key_and_remedy_by_check_and_run_alike",
        ],
    },
    Row {
        what: "`summary.json`, `targets.jsonl`, `run --json`",
        version: Version::None,
        another: "read by the keys that are known: a summary without them is listed as `unreadable`, a target is left out",
        tests: &[
            "what_ended_says_how_and_what_was_cut_off_is_told_from_it",
            "a_target_of_another_version_is_read_by_the_keys_that_it_has",
        ],
    },
    Row {
        what: "the module of `firsthand topic list --python`",
        version: Version::Firsthand,
        another: "refuses a robot that a program of its version would refuse: print it again",
        tests: &["the_module_has_the_version_that_it_joins_robots_of"],
    },
];

pub fn versions() -> String {
    let row = |row: &Row| {
        let tests: Vec<_> = row.tests.iter().map(|test| format!("`{test}`")).collect();
        let (version, tests) = (row.version.text(), tests.join(" "));
        item(&format!("{} ({version}): {}: {tests}", row.what, row.another))
    };
    TABLE.iter().map(row).collect()
}

/// The names of all tests that hold the rows.
#[cfg(test)]
pub fn tests() -> impl Iterator<Item = &'static str> {
    TABLE.iter().flat_map(|row| row.tests.iter().copied())
}
