//! Tests of the radio's shares, durations and order.

use common::mission::Realism;

use super::*;

fn radio(change: impl Fn(&mut mission::Radio)) -> Radio<u8> {
    let mut settings = mission::Radio::preset(Realism::Laboratory);
    change(&mut settings);
    Radio::new(settings, 5)
}

fn arrivals(radio: &mut Radio<u8>, times: &[f64]) -> Vec<(f64, Vec<u8>)> {
    let mut arrived = Vec::new();
    for (number, &time) in times.iter().enumerate() {
        radio.send(time, 0, &[number as u8, 0xee]);
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
        assert!((lost - share).abs() < 0.03, "{lost} lost of {share}");
        let longest = ground_truth.longest_outage_s;
        assert!((1.9..=2.0 + 1e-9).contains(&longest), "{longest} s");
    }
}

#[test]
fn delay_and_jitter_keep_the_order() {
    let mut radio = radio(|r| {
        r.delay_s = 0.02;
        r.jitter_s = 0.1;
    });
    let times: Vec<f64> = (0..100).map(|n| f64::from(n) * 0.01).collect();
    let arrived = arrivals(&mut radio, &times);
    let order: Vec<u8> = arrived.iter().map(|(_, bytes)| bytes[0]).collect();
    assert_eq!(order, (0..100).collect::<Vec<u8>>());
    assert!(arrived.iter().zip(&times).all(|((due, _), sent)| *due >= sent + 0.02));
}

#[test]
fn a_reordered_datagram_comes_behind_the_next() {
    let mut radio = radio(|r| r.reorder_share = 0.3);
    let times: Vec<f64> = (0..100).map(|n| f64::from(n) * 0.01).collect();
    let order: Vec<u8> = arrivals(&mut radio, &times).iter().map(|(_, bytes)| bytes[0]).collect();
    let mut sorted = order.clone();
    sorted.sort_unstable();
    assert_eq!(sorted, (0..100).collect::<Vec<u8>>(), "none is lost");
    assert!(order.windows(2).filter(|pair| pair[0] > pair[1]).count() > 10);
}

#[test]
fn merging_splitting_and_duplicating_lose_no_byte() {
    let mut merging = radio(|r| r.merge_share = 0.5);
    let times: Vec<f64> = (0..100).map(|n| f64::from(n) * 0.01).collect();
    let arrived = arrivals(&mut merging, &times);
    assert!(arrived.len() < 80, "{} datagrams", arrived.len());
    let bytes: usize = arrived.iter().map(|(_, bytes)| bytes.len()).sum();
    assert_eq!(bytes, 200);

    let mut splitting = radio(|r| r.split_share = 1.0);
    let arrived = arrivals(&mut splitting, &times);
    let bytes: Vec<u8> = arrived.into_iter().flat_map(|(_, bytes)| bytes).collect();
    let whole: Vec<u8> = (0..100).flat_map(|n| [n, 0xee]).collect();
    assert_eq!(bytes, whole);

    let mut twice = radio(|r| r.duplicate_share = 1.0);
    assert_eq!(arrivals(&mut twice, &times).len(), 200);
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
