//! Properties of the decoder for all inputs, shared by the fuzz target and the corpus test.

use x80_protocol::{Addressing, Command, Decoder, Frame, MAX_FRAME_BYTES, Report};

const PING: [u8; 10] = [0x5e, 0x02, 0x01, 0x00, 0xff, 0x01, 0x00, 0xdb, 0x5e, 0x0d];

/// Feeds `input` to a decoder and checks its properties. The first byte is the size of the pieces
/// of the rest.
pub(crate) fn check(input: &[u8]) {
    let Some((&size, bytes)) = input.split_first() else {
        return;
    };
    let mut decoder = Decoder::default();
    for piece in bytes.chunks(usize::from(size).max(1)) {
        decoder.push(piece);
        drain(&mut decoder);
    }
    // The decoder decodes a frame after any input.
    decoder.push(&[0; MAX_FRAME_BYTES]);
    drain(&mut decoder);
    let before = decoder.tally();
    decoder.push(&PING);
    let frame = decoder.next_frame().expect("a sound frame after any bytes");
    assert_eq!((frame.rid, frame.did, frame.data), (1, 255, &[0][..]));
    let after = decoder.tally();
    assert_eq!(after.frames, before.frames + 1);
    // Nothing here is more than is held.
    assert_eq!(after.dropped_bytes, 0);
}

fn drain(decoder: &mut Decoder) {
    while let Some(frame) = decoder.next_frame() {
        if let Ok(command) = Command::parse(&frame) {
            again(
                |out| command.encode(Addressing::Numbered, out),
                |frame| {
                    assert_eq!(Command::parse(frame), Ok(command));
                },
            );
        }
        if let Ok(report) = Report::parse(&frame) {
            again(
                |out| report.encode(Addressing::Lettered, out),
                |frame| {
                    assert_eq!(Report::parse(frame), Ok(report));
                },
            );
        }
    }
}

fn again(write: impl Fn(&mut Vec<u8>), same: impl Fn(&Frame<'_>)) {
    let mut bytes = Vec::new();
    write(&mut bytes);
    let mut decoder = Decoder::default();
    decoder.push(&bytes);
    same(&decoder.next_frame().expect("an encoded frame can be decoded"));
}
