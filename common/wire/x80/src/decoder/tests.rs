//! Guarantees of the decoder, by example and by property.

use super::*;
use crate::MAX_FRAME_BYTES;
use proptest::prelude::*;

type Owned = (u8, u8, u8, Vec<u8>);

fn drain(decoder: &mut Decoder) -> Vec<Owned> {
    let mut frames = Vec::new();
    while let Some(frame) = decoder.next_frame() {
        frames.push((frame.rid, frame.sn, frame.did, frame.data.to_vec()));
    }
    frames
}

fn decode(pieces: &[&[u8]]) -> Vec<Owned> {
    let mut decoder = Decoder::default();
    let mut frames = Vec::new();
    for piece in pieces {
        decoder.push(piece);
        frames.extend(drain(&mut decoder));
    }
    frames
}

fn encoded(did: u8, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let frame = Frame { rid: 1, sn: 0, did, data };
    frame.encode(&mut bytes);
    bytes
}

const PING: [u8; 10] = [0x5e, 0x02, 0x01, 0x00, 0xff, 0x01, 0x00, 0xdb, 0x5e, 0x0d];
fn ping() -> Owned {
    (1, 0, 255, vec![0])
}

#[test]
fn what_is_forgotten_does_not_swallow_the_frame_behind_it() {
    let mut decoder = Decoder::default();
    // The start of a frame of 64 data bytes whose rest never arrives.
    decoder.push(&[0x5e, 0x02, 0x00, 0x00, 0x7d, 64, 1, 2, 3]);
    assert_eq!(drain(&mut decoder), []);
    decoder.reset();
    decoder.push(&PING);
    assert_eq!(drain(&mut decoder), [ping()]);
    assert_eq!(decoder.tally().noise_bytes, 9);
}

#[test]
fn a_frame_is_heard_after_zeros_or_a_noisy_header_and_with_wrong_or_without_end_bytes() {
    let zeros = [&[0; 65][..], &PING[..9], &[0x13]].concat();
    let (bare, noisy) = (&PING[..8], &[0x5e, 0x02, 0x00, 0x00, 0x7b, 0xff][..]);
    for (pieces, pings) in [
        (&[&zeros[..], &zeros][..], 2),
        (&[bare], 1),
        (&[bare, &PING], 2),
        (&[bare, &[0xff, 0x5e], &PING], 2),
        (&[noisy, &PING], 1),
    ] {
        assert_eq!(decode(pieces), vec![ping(); pings], "{pieces:x?}");
    }
}

#[test]
fn a_whole_frame_inside_data_is_data_with_either_ending() {
    for last in [0x0d, 0x13] {
        let mut outer = encoded(9, &PING);
        outer.pop();
        outer.push(last);
        for cut in 0..outer.len() {
            let (first, second) = outer.split_at(cut);
            let data = vec![(1, 0, 9, PING.to_vec())];
            assert_eq!(decode(&[first, second]), data, "cut at {cut}");
        }
    }
}

#[test]
fn a_datagram_of_false_headers_takes_bounded_work_and_the_next_frame_is_found() {
    // Every third byte begins a header that claims 255 bytes of data.
    let mut decoder = Decoder::default();
    decoder.push(&[0x5e, 0x02, 0xff].repeat(18_000));
    drain(&mut decoder);
    assert!(decoder.work.get() < 2 * MOST_WORK, "{}", decoder.work.get());
    assert!(decoder.tally().dropped_bytes > 0, "{:?}", decoder.tally());
    decoder.push(&PING);
    assert_eq!(drain(&mut decoder), vec![ping()]);
}

/// Returns a torn frame that claims `len` data bytes, holds `has`, and takes a byte of the
/// following ping as its CRC. One of the 256 serial numbers makes it right.
fn torn_before_a_ping(len: u8, has: &[u8]) -> Vec<u8> {
    let crc_at = 6 + usize::from(len);
    (0..=255)
        .map(|sn| [&[0x5e, 0x02, 0x01, sn, 0x09, len], has, &PING].concat())
        .find(|bytes| crc8(&bytes[2..crc_at]) == bytes[crc_at])
        .expect("the CRC takes every value over SN")
}

#[test]
fn a_torn_frame_whose_crc_happens_to_fit_swallows_no_frame() {
    // The CRC falls on the fifth byte of the ping, and on its first.
    for forged in [torn_before_a_ping(4, &[]), torn_before_a_ping(1, &[7])] {
        for cut in 0..forged.len() {
            let (first, second) = forged.split_at(cut);
            assert_eq!(decode(&[first, second]), vec![ping()], "cut at {cut}");
        }
    }
}

#[test]
fn more_than_is_held_drops_the_oldest_and_keeps_the_newest() {
    let mut decoder = Decoder::default();
    decoder.push(&vec![0x5e; 3 * CAPACITY]);
    decoder.push(&PING);
    assert_eq!(drain(&mut decoder), vec![ping()]);
    assert!(decoder.tally().dropped_bytes > 2 * CAPACITY as u64);
    assert!(decoder.buffer.capacity() <= 2 * CAPACITY);
}

#[test]
fn every_byte_is_accounted_for() {
    let mut decoder = Decoder::default();
    let mut bad = PING;
    bad[6] ^= 1;
    decoder.push(&[&[9, 9, 9][..], &bad, &PING].concat());
    drain(&mut decoder);
    let tally = decoder.tally();
    assert_eq!((tally.frames, tally.bad_crc, tally.noise_bytes), (1, 1, 13));
}

fn tricky_bytes(most: usize) -> impl Strategy<Value = Vec<u8>> {
    let byte = prop_oneof![
        3 => any::<u8>(),
        1 => Just(0x5e_u8),
        1 => Just(0x02_u8),
        1 => Just(0x0d_u8),
    ];
    prop::collection::vec(byte, 0..=most)
}

/// Bytes, and the frame that they were encoded from, with whether it is untouched.
type Piece = (Vec<u8>, Option<(Owned, bool)>);

fn piece() -> impl Strategy<Value = Piece> {
    let index = any::<prop::sample::Index>;
    prop_oneof![
        4 => (any::<u8>(), tricky_bytes(255))
            .prop_map(|(did, data)| (encoded(did, &data), Some(((1, 0, did, data), true)))),
        1 => (tricky_bytes(60), index(), 1..=255_u8).prop_map(|(data, at, mask)| {
            let mut bytes = encoded(77, &data);
            let at = at.index(bytes.len());
            bytes[at] ^= mask;
            (bytes, Some(((1, 0, 77, data), false)))
        }),
        1 => (tricky_bytes(60), index()).prop_map(|(data, at)| {
            let mut bytes = encoded(78, &data);
            bytes.truncate(at.index(bytes.len()));
            (bytes, Some(((1, 0, 78, data), false)))
        }),
        1 => tricky_bytes(80).prop_map(|bytes| (bytes, None)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn every_untouched_frame_comes_out_however_the_stream_is_cut_and_corrupted(
        pieces in prop::collection::vec(piece(), 1..12),
        cuts in prop::collection::vec(any::<prop::sample::Index>(), 0..12),
    ) {
        let mut stream = Vec::new();
        let mut untouched = Vec::new();
        let mut touched = Vec::new();
        for (bytes, frame) in pieces {
            stream.extend(bytes);
            match frame {
                Some((frame, true)) => untouched.push(frame),
                Some((frame, false)) => touched.push(frame),
                None => {}
            }
        }
        // The decoder needs the announced length of a noisy header before it can reject it.
        stream.extend([0; MAX_FRAME_BYTES]);

        let mut cuts: Vec<usize> = cuts.iter().map(|cut| cut.index(stream.len())).collect();
        cuts.push(stream.len());
        cuts.sort_unstable();
        let mut decoder = Decoder::default();
        let mut came = Vec::new();
        let mut from = 0;
        for to in cuts {
            decoder.push(&stream[from..to]);
            came.extend(drain(&mut decoder));
            from = to;
        }

        // Corruption may by chance yield a frame that CRC-8 accepts.
        prop_assume!(came.iter().all(|frame| untouched.contains(frame) || touched.contains(frame)));
        came.retain(|frame| untouched.contains(frame));
        prop_assert_eq!(came, untouched);
    }
}
