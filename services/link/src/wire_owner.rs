//! Ownership of a robot's wire: who orders the stop of a robot that may move. Pure.
//!
//! A stop is owed from the first motion command until the encoders show rest, or a person signs it
//! off. The link orders it, and its stop guard afterwards. Silence is not rest.

/// Returns whether a stop is owed, if the newest command `moves` and the encoders show since that
/// it `rests`.
pub const fn is_owed(before: bool, moves: bool, rests: bool) -> bool {
    moves || before && !rests
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    Waits,
    Orders,
    Leaves,
}

#[derive(Clone, Copy, Debug)]
pub struct Found {
    pub link_lives: bool,
    pub is_owed: bool,
    /// Another link or newer guard has the wire.
    pub is_succeeded: bool,
    pub is_signed_off: bool,
    /// The robot's simulator has ended.
    pub is_robot_gone: bool,
}

impl Found {
    pub const fn role(self) -> Role {
        if self.link_lives {
            return Role::Waits;
        }
        let ends = self.is_succeeded || self.is_signed_off || self.is_robot_gone;
        if self.is_owed && !ends { Role::Orders } else { Role::Leaves }
    }
}

#[cfg(test)]
mod tests;
