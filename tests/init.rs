//! New robots and new machines: `firsthand init` and `firsthand doctor`.

use std::{
    io::{Read as _, Write as _},
    net::{TcpListener, UdpSocket},
    thread,
};

use crate::support::{ENDLESS, Run, domain, json_of, output, printed, refused, wire::Robot};

#[test]
fn init_writes_a_mission_that_check_accepts_for_a_json_robot_or_an_x80_and_moves_it_nowhere() {
    let json = Robot::start_with("obstacle-course", &["--set", "robot.model='kobuki'"]);
    let x80 = Robot::start("obstacle-course", "tcp", "127.0.0.1:0");
    for (robot, scheme, rows) in [
        (json, "udp://", ["protocol = \"json\"", "name = \"bumper-left\""]),
        (x80, "tcp://", ["protocol = \"x80\"", "front-left"]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("robot.toml");
        let out = file.to_str().unwrap();
        let said = printed(&["init", &format!("{scheme}{}", robot.listening), "--out", out]);
        assert!(said.contains(&format!("firsthand bring-up {out}")), "{said}");
        printed(&["check", out]);
        let text = std::fs::read_to_string(&file).unwrap();
        for row in rows.iter().chain(&["MEASURE", "PLACEHOLDER"]) {
            assert!(text.contains(row), "{row}: {text}");
        }
        refused(&["init", "127.0.0.1:9", "--out", out], "file-exists", &[out]);
        assert_eq!(robot.kill(), 0.0);
    }
}

#[test]
fn a_silent_address_a_foreign_protocol_and_a_robot_that_is_driven_are_refused_with_the_cause() {
    let silent = UdpSocket::bind("127.0.0.1:0").unwrap();
    let at = silent.local_addr().unwrap().to_string();
    let out = tempfile::tempdir().unwrap();
    let out = out.path().join("robot.toml");
    let init = |address: &str, code: &str, says: &[&str]| {
        refused(&["init", address, "--out", out.to_str().unwrap()], code, says);
        assert!(!out.exists());
    };
    init(&at, "no-answer", &["nothing answers", &at]);
    let run = Run::under_way("init-used", "open-room", ENDLESS, 0.3);
    let address = common::run::Run::load(&run.directory()).unwrap().address.to_string();
    init(&address, "address-in-use", &["init-used"]);
    run.stop();
    init("tcp://127.0.0.1:9", "no-answer", &["Connection refused"]);
    init("udp://127.0.0.1", "usage", &["has no port"]);
    init("serial:///dev/no-such-line", "no-answer", &["plug the adapter in"]);
    let garbage = TcpListener::bind("127.0.0.1:0").unwrap();
    let at = format!("tcp://{}", garbage.local_addr().unwrap());
    thread::spawn(move || {
        for mut stream in garbage.incoming().map_while(Result::ok) {
            thread::spawn(move || {
                let _ = stream.write_all(b"220 mail.example ESMTP\r\n");
                while stream.write_all(&[b'{'; 4096]).is_ok() {}
                let _ = stream.read(&mut [0; 1]);
            });
        }
    });
    init(&at, "unknown-protocol", &["220 mail.example ESMTP\\r\\n"]);
}

#[test]
fn doctor_says_a_verdict_for_each_check_and_its_exit_code_follows_from_them() {
    let (code, found) = json_of(&output(&["doctor", "--json"]));
    let is_ill = found.iter().any(|it| it["verdict"] == "problem");
    assert_eq!(code, Some(i32::from(is_ill)), "{found:?}");
    for check in [
        "limit of open files",
        "directory of robots",
        "shared memory",
        "clock",
        "firsthand-page",
        "other robots",
    ] {
        assert!(found.iter().any(|it| it["check"] == check), "{check}: {found:?}");
    }
    assert!(domain("any").directory().parent().unwrap().is_dir());
}
