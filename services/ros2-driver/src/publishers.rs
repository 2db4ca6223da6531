//! Publishers of odometry. With two the pose alternates between theirs.

/// DDS writer identifier.
pub type Gid = [u8; 16];

/// First byte of a piece with the numbers of two odometry publishers.
pub(crate) const TWO: u8 = u8::MAX;
/// Silence of a publisher that is gone, and report interval.
const GONE_NS: u64 = 1_000_000_000;

#[derive(Debug, Default)]
pub struct Publishers {
    newest: Option<(Gid, u64)>,
    other: Option<(Gid, u64)>,
    reported_ns: Option<u64>,
}

impl Publishers {
    /// Takes a message's sender. Returns a piece if two publish in turn, and not if one replaced
    /// another.
    pub fn take(&mut self, from: Gid, now_ns: u64) -> Option<Vec<u8>> {
        let before = self.newest.replace((from, now_ns)).filter(|(gid, _)| *gid != from)?;
        let earlier = self.other.replace(before);
        let is_recent = |then_ns: u64| now_ns.saturating_sub(then_ns) <= GONE_NS;
        let is_back = earlier.is_some_and(|(gid, then_ns)| gid == from && is_recent(then_ns));
        if !is_back || self.reported_ns.is_some_and(is_recent) {
            return None;
        }
        self.reported_ns = Some(now_ns);
        Some([&[TWO][..], &before.0, &from].concat())
    }
}

pub(crate) fn words(topic: &str, gids: &[u8]) -> Option<String> {
    let (one, other) = gids.split_first_chunk()?;
    let [one, other] = [*one, other.try_into().ok()?].map(gid_text);
    Some(format!(
        "two nodes publish {topic}, with the GIDs {one} and {other}; end one, or give it a namespace"
    ))
}

#[must_use]
pub fn gid_text(gid: Gid) -> String {
    gid.map(|byte| format!("{byte:02x}")).join(".")
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn two_that_publish_in_turn_are_reported_once_a_second_and_one_after_another_is_not() {
        let mut publishers = Publishers::default();
        let [robot, bridge, restarted] = [[1; 16], [2; 16], [3; 16]];
        let mut take = |gid, ms: u64| publishers.take(gid, ms * MS).is_some();
        assert!(![0, 50, 100].map(|ms| take(robot, ms)).contains(&true));
        assert!(!take(restarted, 150) && !take(restarted, 200));
        assert!(!take(bridge, 210) && !take(bridge, 240));
        assert!(take(restarted, 250) && !take(bridge, 280) && !take(restarted, 300));
        assert!(!take(bridge, 1200) && take(restarted, 1300));
        // One that was silent for long replaced the other.
        assert!(!take(bridge, 9000) && !take(restarted, 12_000) && !take(bridge, 15_000));
    }
}
