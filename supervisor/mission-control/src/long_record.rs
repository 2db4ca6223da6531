//! Records of each tick in bounded memory: older ticks are thinned out.

use common::ground_truth::GroundTruthTick;

/// Maximum length: 10 minutes at 7 Hz, 0.7 MB. The newest half stays complete and holds the tick
/// that ends a run.
const MOST_TICKS: usize = 4096;

/// Merges a tick and the `next`; `None` if both are needed.
pub(crate) fn merged(tick: GroundTruthTick, next: GroundTruthTick) -> Option<GroundTruthTick> {
    let clearance_m = tick.clearance_m.min(next.clearance_m);
    (tick.contacts == next.contacts).then_some(GroundTruthTick { clearance_m, ..tick })
}

/// Appends `tick`; a full record first merges pairs of older ticks. `merged` gives `None` for a
/// pair that stays.
pub(crate) fn push<T: Copy>(record: &mut Vec<T>, tick: T, merged: impl Fn(T, T) -> Option<T>) {
    if record.len() >= MOST_TICKS {
        let (older, newer) = record.split_at(MOST_TICKS / 2);
        let mut thinned = Vec::with_capacity(MOST_TICKS);
        for pair in older.chunks(2) {
            let one = match *pair {
                [tick, next] => merged(tick, next),
                _ => None,
            };
            match one {
                Some(one) => thinned.push(one),
                None => thinned.extend_from_slice(pair),
            }
        }
        thinned.extend_from_slice(newer);
        assert!(thinned.len() <= record.len());
        *record = thinned;
    }
    record.push(tick);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_record_is_bounded_and_has_every_contact_the_least_clearance_and_the_newest_ticks() {
        let mut record = Vec::new();
        for tick in 0..100_000u64 {
            let clearance_m = if tick == 777 { 0.1 } else { 1.0 };
            let contacts = u64::from(tick >= 5001);
            let truth = GroundTruthTick { tick, clearance_m, contacts, ..Default::default() };
            push(&mut record, truth, merged);
            assert!(record.len() <= MOST_TICKS);
        }
        let ticks: Vec<u64> = record.iter().map(|truth| truth.tick).collect();
        assert!(ticks.is_sorted() && ticks[0] == 0 && ticks.ends_with(&[99_998, 99_999]));
        let newest = &ticks[ticks.len() - MOST_TICKS / 4 - 1..];
        assert!(newest.is_sorted_by(|one, next| one + 1 == *next));
        assert!(record.iter().any(|truth| truth.clearance_m == 0.1));
        assert_eq!(record.iter().find(|truth| truth.contacts > 0).unwrap().tick, 5001);
    }
}
