//! States and causes in words.

use std::fmt::Debug;

use common::samples::{Action, Cause, DeathSample, GuidanceStatus, LinkSample};

/// Returns the name of a variant in words: `CommandStale` as `command stale`.
pub fn words(variant: impl Debug) -> String {
    let mut words = String::new();
    for letter in format!("{variant:?}").chars() {
        if letter.is_uppercase() && !words.is_empty() {
            words.push(' ');
        }
        words.extend(letter.to_lowercase());
    }
    words
}

pub const fn guidance_in_words(status: u8) -> &'static str {
    match GuidanceStatus::from_byte(status) {
        GuidanceStatus::Waiting => "waits for a path",
        GuidanceStatus::Along => "on its way",
        GuidanceStatus::AtTarget => "beside the target",
        GuidanceStatus::WayOut => "drives out of a hazard",
        GuidanceStatus::Unreachable => "no path to the target",
        GuidanceStatus::Look => "turns and looks",
    }
}

pub fn death_in_words(death: &DeathSample) -> String {
    death.cause().in_words(death.code)
}

pub fn failsafe_in_words(link: &LinkSample) -> String {
    match (link.action(), link.cause()) {
        (action, Cause::None) => format!("the robot {}", action.effect()),
        (Action::Go, cause) => cause.name().to_owned(),
        (action, cause) => format!("the robot {}: {}", action.effect(), cause.name()),
    }
}
