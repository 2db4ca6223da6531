//! Tests of every worked frame, and of every message encoded and decoded.

use proptest::prelude::*;

use super::*;

fn bytes(hex: &str) -> Vec<u8> {
    hex.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

fn encoded(encode: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut out = Vec::new();
    encode(&mut out);
    out
}

fn decoded<T>(bytes: &[u8], parse: impl FnOnce(&Frame<'_>) -> T) -> T {
    let mut decoder = Decoder::default();
    decoder.push(bytes);
    parse(&decoder.next_frame().expect("one sound frame"))
}

fn wheels(first: i16, second: i16, limit_ms: Option<u16>) -> Command {
    Command::velocity([Some(first), Some(second)], limit_ms)
}

#[test]
fn every_worked_frame_is_written_and_read() {
    let standard = |request| Command::Stream { stream: Stream::Standard, request };
    let pid = Command::Parameter {
        channel: 0,
        parameter: Parameter::VelocityPid(Gains { kp: Some(15), kd: Some(0), ki_x100: Some(0) }),
    };
    let worked = [
        (Command::System(SystemSignal::Ack), "5e 02 01 00 ff 01 01 85 5e 0d"),
        (Command::System(SystemSignal::Ping), "5e 02 01 00 ff 01 00 db 5e 0d"),
        (standard(Request::Start), "5e 02 01 00 7d 00 b0 5e 0d"),
        (standard(Request::Stop), "5e 02 01 00 7d 01 00 f6 5e 0d"),
        (wheels(400, -400, None), "5e 02 01 00 1b 0c 90 01 70 fe 00 80 00 80 00 80 00 80 3c 5e 0d"),
        (
            wheels(400, -400, Some(1000)),
            "5e 02 01 00 1b 0e 90 01 70 fe 00 80 00 80 00 80 00 80 e8 03 98 5e 0d",
        ),
        (pid, "5e 02 01 00 07 0b 08 00 01 0f 00 02 00 00 03 00 00 27 5e 0d"),
    ];
    for (meant, hex) in worked {
        let worked = bytes(hex);
        let out = encoded(|out| meant.encode(Addressing::Numbered, out));
        assert_eq!(out, worked, "{meant:?}");
        assert_eq!(decoded(&worked, Command::parse), Ok(meant), "{hex}");
    }
    let ack = Report::System(SystemSignal::Ack);
    let worked = bytes("5e 02 00 00 ff 01 01 48 5e 0d");
    assert_eq!(encoded(|out| ack.encode(Addressing::Numbered, out)), worked);
    assert_eq!(decoded(&worked, Report::parse), Ok(ack));
}

fn parsed(did: u8, data: &[u8]) -> Result<Command, MessageError> {
    Command::parse(&Frame { rid: 1, sn: 0, did, data })
}

#[test]
fn commands_are_taken_in_every_form_that_hosts_send() {
    let all = |limit_ms| wheels(400, -400, limit_ms);
    let motion =
        |quantity, targets, limit_ms| Command::Motion(Motion { quantity, targets, limit_ms });
    let one =
        |limit_ms| motion(Quantity::Position, Targets::One { channel: 1, value: -2 }, limit_ms);
    let start = Command::Stream { stream: Stream::All, request: Request::Start };
    for (did, data, meant) in [
        (27, "90 01 70 fe 00 80 00 80 00 80 00 80 e8 03", all(Some(1000))),
        (27, "90 01 70 fe 00 80 00 80 00 80 00 80 1c e8 03", all(Some(1000))),
        (27, "90 01 70 fe 00 80 00 80 00 80 00 80 e8 03 00", all(Some(1000))),
        // Both ways to leave a channel alone.
        (27, "90 01 70 fe 01 80 01 80 00 80 01 80", all(None)),
        (26, "01 01 80", motion(Quantity::Velocity, Targets::All([None; 6]), None)),
        (3, "01 fe ff", one(None)),
        (3, "01 fe ff 1c 0a 01", one(Some(266))),
        (3, "01 fe ff 0a 01", one(Some(266))),
        (127, "ff", start),
        (127, "", start),
    ] {
        assert_eq!(parsed(did, &bytes(data)), Ok(meant), "{did}: {data}");
    }
}

#[test]
fn what_is_no_message_is_refused_with_its_did() {
    for (did, data) in [
        (27, &[0; 13][..]),
        (27, &[0; 11]),
        (26, &[6, 0, 0]),
        (30, &[]),
        (30, &[1, 9]),
        (7, &[14, 0, 3]),
        (7, &[8, 0, 1, 5]),
        (255, &[2]),
        (200, &[]),
    ] {
        let text = parsed(did, data).expect_err("was taken").to_string();
        assert!(text.contains(&format!("DID {did}")), "{text}");
    }
}

#[test]
fn the_motor_frame_and_the_standard_frame_which_may_be_a_byte_longer_lie_as_the_notes_say() {
    let data: Vec<u8> = (1..=41).collect();
    // A word of the bytes 1 and 2 is 0x0201.
    for (did, bytes, said) in [
        (
            123,
            33,
            "Ok(Motor(MotorSensors { pots: [201, 403, 605, 807, a09, c0b], currents: [e0d, 100f, 1211, 1413, 1615, 1817], encoders: [Encoder { position: 1a19, speed: 1c1b, positive: true }, Encoder { position: 1e1d, speed: 201f, positive: false }] }))",
        ),
        (
            125,
            41,
            "Ok(Standard(StandardSensors { ultrasonic: [1, 2, 3, 4, 5, 6], human: [807, a09, c0b, e0d], tilt: [100f, 1211], overheat: [1413, 1615], temperature: 1817, infrared: 1a19, infrared_code: [1b, 1c, 1d, 1e], board_battery: 201f, motor_battery: 2221, servo_battery: 2423, reference: 2625 }))",
        ),
    ] {
        let frame = Frame { rid: 0, sn: 0, did, data: &data[..bytes] };
        assert_eq!(format!("{:x?}", Report::parse(&frame)), said);
    }
}

proptest! {
    #[test]
    fn any_data_under_any_did_are_a_message_or_an_error(
        did in any::<u8>(),
        data in prop::collection::vec(any::<u8>(), 0..60),
    ) {
        let frame = Frame { rid: 0, sn: 0, did, data: &data };
        // A report keeps all of its data except the frame's unused bytes.
        if let Ok(report) = Report::parse(&frame) {
            let out = encoded(|out| report.encode(Addressing::Lettered, out));
            prop_assert_eq!(decoded(&out, Report::parse), Ok(report));
        }
        if let Ok(command) = Command::parse(&frame) {
            let out = encoded(|out| command.encode(Addressing::Numbered, out));
            prop_assert_eq!(decoded(&out, Command::parse), Ok(command));
        }
    }
}
