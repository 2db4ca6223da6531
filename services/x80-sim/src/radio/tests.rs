use common::mission::Realism;

use super::*;
use crate::testing::near;

fn radio(change: impl Fn(&mut mission::Radio)) -> Radio<u8> {
    let mut settings = mission::Radio::preset(Realism::Laboratory);
    change(&mut settings);
    Radio::new(settings, 5)
}

/// Sends 100 datagrams, 10 ms apart. Returns arrivals and their times.
fn arrivals(change: impl Fn(&mut mission::Radio)) -> Vec<(f64, Vec<u8>)> {
    let mut radio = radio(change);
    let mut arrived = Vec::new();
    for number in 0..100_u8 {
        radio.send(f64::from(number) * 0.01, 0, &[number, 0xee]);
    }
    while let Some(due) = radio.next_due() {
        arrived.extend(radio.arrived(due).map(|(_, bytes)| (due, bytes)));
    }
    arrived
}

#[test]
fn a_perfect_radio_says_so_and_no_other_does() {
    assert!(radio(|_| {}).is_perfect());
    assert!(!radio(|r| r.outage_share = 0.1).is_perfect());
    assert!(!radio(|r| r.merge_share = 0.1).is_perfect());
}

#[test]
fn it_is_out_for_its_share_of_the_time_and_never_longer_than_its_longest() {
    for share in [0.2, 0.5] {
        let mut radio = radio(|r| {
            r.outage_share = share;
            r.outage_mean_s = 1.0;
            r.outage_max_s = 2.0;
        });
        let datagrams = 200_000;
        for number in 0..datagrams {
            radio.loses(f64::from(number) * 0.05);
        }
        let ground_truth = radio.ground_truth(f64::from(datagrams) * 0.05);
        let lost = ground_truth.lost as f64 / ground_truth.sent as f64;
        near(lost, share, 0.03);
        let longest = ground_truth.longest_outage_s;
        assert!((1.9..=2.0 + 1e-9).contains(&longest), "{longest} s");
    }
}

#[test]
fn delay_and_jitter_keep_the_order_and_a_reordered_datagram_comes_behind_the_next() {
    let arrived = arrivals(|r| (r.delay_s, r.jitter_s) = (0.02, 0.1));
    for (number, (due, bytes)) in arrived.iter().enumerate() {
        assert_eq!(usize::from(bytes[0]), number);
        assert!(*due >= number as f64 * 0.01 + 0.02);
    }
    let reordered = arrivals(|r| r.reorder_share = 0.3);
    let mut order: Vec<u8> = reordered.iter().map(|(_, bytes)| bytes[0]).collect();
    assert!(order.windows(2).filter(|pair| pair[0] > pair[1]).count() > 10);
    order.sort_unstable();
    // None is lost.
    assert!(arrived.len() == 100 && order.into_iter().eq(0..100));
}

#[test]
fn merging_splitting_and_duplicating_lose_no_byte() {
    let bytes = |arrived: &[(f64, Vec<u8>)]| {
        arrived.iter().flat_map(|(_, bytes)| bytes.clone()).collect::<Vec<_>>()
    };
    let merged = arrivals(|r| r.merge_share = 0.5);
    assert!(merged.len() < 80 && bytes(&merged).len() == 200, "{} datagrams", merged.len());
    let whole: Vec<u8> = (0..100).flat_map(|n| [n, 0xee]).collect();
    assert_eq!(bytes(&arrivals(|r| r.split_share = 1.0)), whole);
    assert_eq!(arrivals(|r| r.duplicate_share = 1.0).len(), 200);
}

#[test]
fn a_flood_is_lost_not_hoarded() {
    let mut radio = radio(|r| r.delay_s = 1.0);
    for _ in 0..3 * MOST_IN_FLIGHT {
        radio.send(0.0, 0, &[1]);
    }
    assert_eq!(radio.in_flight.len(), MOST_IN_FLIGHT);
    assert_eq!(radio.ground_truth(0.0).lost, 2 * MOST_IN_FLIGHT as u64);
}
