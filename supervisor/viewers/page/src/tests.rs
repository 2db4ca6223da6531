//! Tests of the operator's rights, and of attacks on a served page over real sockets.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::{
    fs,
    io::{ErrorKind, Read as _, Write as _},
    net::{SocketAddr, TcpStream},
    os::unix::fs::MetadataExt as _,
    sync::{Arc, Mutex},
    time::Duration,
};

use clap::Parser as _;
use console::failure::code;
use rustix::process::geteuid;
use serde_json::{Value, json};
use tungstenite::{Message, WebSocket, protocol::Role};

use crate::{
    Arguments,
    orders::{Operator, Order},
    serving::Page,
};

/// Orders given to an operator.
type Noted = Arc<Mutex<Vec<Order>>>;

/// Returns an operator that records its orders, and refuses to send the robot back.
fn noting(noted: &Noted) -> Operator {
    let noted = noted.clone();
    Arc::new(move |order| {
        if *order == Order::GoBack {
            return Err("the robot has no supervisor".to_owned());
        }
        noted.lock().unwrap().push(order.clone());
        Ok("confirmed".to_owned())
    })
}

fn options(listen: &str) -> Arguments {
    Arguments::parse_from(["firsthand-page", "--robot", "page-test", "--listen", listen])
}

fn page() -> (Page, Noted) {
    let noted = Noted::default();
    (Page::open(&options("127.0.0.1:0"), noting(&noted)).unwrap(), noted)
}

/// Longest wait of a test.
const PATIENCE: Duration = Duration::from_secs(30);

impl Page {
    fn address(&self) -> SocketAddr {
        let kept = self.kept.to_string_lossy();
        let (_, port) = kept.rsplit_once('-').unwrap();
        SocketAddr::from(([127, 0, 0, 1], port.parse().unwrap()))
    }
}

fn connect(page: &Page) -> TcpStream {
    let stream = TcpStream::connect(page.address()).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    stream
}

/// Returns what the other end says until it closes `stream`.
fn rest(mut stream: TcpStream) -> String {
    let mut rest = Vec::new();
    if let Err(error) = stream.read_to_end(&mut rest) {
        assert_eq!(error.kind(), ErrorKind::ConnectionReset);
    }
    String::from_utf8(rest).unwrap()
}

fn ask(page: &Page, lines: &[&str]) -> String {
    let mut stream = connect(page);
    stream.write_all((lines.join("\r\n") + "\r\n\r\n").as_bytes()).unwrap();
    rest(stream)
}

fn get(page: &Page, path: &str) -> String {
    ask(page, &[&format!("GET {path} HTTP/1.1"), &host(page)])
}

fn status(answer: &str) -> &str {
    answer.split(' ').nth(1).unwrap_or_default()
}

fn host(page: &Page) -> String {
    format!("Host: {}", page.address())
}

fn origin(page: &Page) -> String {
    format!("Origin: http://{}", page.address())
}

const UPGRADE: &str = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==";

struct Browser(WebSocket<TcpStream>);

impl Browser {
    fn open(page: &Page) -> Self {
        let mut stream = connect(page);
        let lines = ["GET /live HTTP/1.1", &host(page), &origin(page), UPGRADE].join("\r\n");
        stream.write_all((lines + "\r\n\r\n").as_bytes()).unwrap();
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            let mut byte = [0];
            stream.read_exact(&mut byte).unwrap();
            head.push(byte[0]);
        }
        assert!(head.starts_with(b"HTTP/1.1 101"), "{}", String::from_utf8_lossy(&head));
        Self(WebSocket::from_raw_socket(stream, Role::Client, None))
    }

    fn with_token(page: &Page, token: &str) -> Self {
        let mut browser = Self::open(page);
        browser.say(&json!({"token": token}).to_string());
        browser
    }

    fn watching(page: &Page) -> Self {
        Self::with_token(page, page.access.watch.reveal())
    }

    fn driving(page: &Page) -> Self {
        Self::with_token(page, page.access.drive.reveal())
    }

    fn say(&mut self, text: &str) {
        let _ = self.0.send(Message::text(text));
    }

    /// Returns the next message, or a closure without a code.
    fn hear(&mut self) -> Message {
        self.0.read().unwrap_or(Message::Close(None))
    }

    fn await_key(&mut self, key: &str) -> Value {
        loop {
            match self.hear() {
                Message::Text(text) => {
                    if let Some(value) = serde_json::from_str::<Value>(&text).unwrap().get(key) {
                        return value.clone();
                    }
                }
                Message::Close(frame) => panic!("closed with {frame:?} before {key}"),
                _ => {}
            }
        }
    }

    fn await_close(&mut self) -> u16 {
        loop {
            if let Message::Close(frame) = self.hear() {
                return frame.map_or(0, |frame| frame.code.into());
            }
        }
    }

    /// Returns whether an order is done, and the answer's text.
    fn order(&mut self, order: &str) -> (bool, String) {
        let mut asked: Value = serde_json::from_str(order).unwrap();
        asked["id"] = 7.into();
        self.say(&asked.to_string());
        let answer = self.await_key("answer");
        assert_eq!(answer["id"], 7);
        (answer["ok"] == true, answer["text"].as_str().unwrap().to_owned())
    }
}

#[test]
fn a_request_that_names_another_host_or_none_or_two_is_misdirected() {
    let (page, _) = page();
    let (own, port) = (host(&page), page.address().port());
    let foreign = format!("Host: evil.example:{port}");
    for lines in [
        &["GET / HTTP/1.1", &foreign][..],
        &["GET / HTTP/1.1", "Host: 127.0.0.1"],
        &["GET / HTTP/1.1", "Host: localhost:80"],
        &["GET / HTTP/1.1", &format!("{own}.evil")],
        &["GET / HTTP/1.0"],
        &["GET / HTTP/1.1", &own, &foreign],
        &["GET http://evil.example/ HTTP/1.1", &own],
    ] {
        let answer = ask(&page, lines);
        // The HTTP library refuses requests that no server may accept.
        assert!(["421", "400"].contains(&status(&answer)), "{lines:?}: {answer}");
    }
    for accepted in [own, format!("Host: localhost:{port}")] {
        assert_eq!(status(&ask(&page, &["GET / HTTP/1.1", &accepted])), "200");
    }
}

#[test]
fn a_foreign_origin_and_a_websocket_or_a_change_without_one_are_forbidden() {
    let (page, _) = page();
    let (own, origin) = (host(&page), origin(&page));
    let answers =
        |lines: &[&str], wanted: &str| assert_eq!(status(&ask(&page, lines)), wanted, "{lines:?}");
    for foreign in [
        "Origin: null",
        "Origin: http://evil.example",
        &own.replace("Host: ", "Origin: https://"),
        &(origin.clone() + "/"),
    ] {
        answers(&["GET /live HTTP/1.1", &own, UPGRADE, foreign], "403");
        answers(&["GET / HTTP/1.1", &own, foreign], "403");
    }
    answers(&["GET /live HTTP/1.1", &own, UPGRADE], "403");
    answers(&["POST / HTTP/1.1", &own], "403");
    answers(&["POST / HTTP/1.1", &own, &origin], "405");
}

#[test]
fn every_file_forbids_scripts_of_others_and_none_has_a_token() {
    let (page, _) = page();
    for (path, kind, _) in page::assets::ALL {
        let answer = get(&page, path);
        assert_eq!(status(&answer), "200", "{path}");
        let head = answer.to_lowercase();
        for line in [
            "content-security-policy: default-src 'none'; script-src 'self';",
            "x-content-type-options: nosniff",
            "referrer-policy: no-referrer",
            "cache-control: no-store",
            kind,
        ] {
            assert!(head.contains(line), "{path}: {line}");
        }
        assert!(!head.contains("set-cookie"));
        for token in [&page.access.watch, &page.access.drive] {
            assert!(!answer.contains(token.reveal()));
            assert!(!format!("{token:?}").contains(token.reveal()), "a log hides it");
        }
    }
    let secret = page.access.drive.reveal();
    assert!(!get(&page, &format!("/?token={secret}")).contains(secret));
    assert_eq!(status(&get(&page, "/../Cargo.toml")), "404");
}

#[test]
fn a_browser_that_shows_a_wrong_token_or_none_in_time_is_left() {
    let (page, noted) = page();
    let earlier = self::page().0;
    for token in ["", earlier.access.drive.reveal(), &page.access.drive.reveal()[..31]] {
        assert_eq!(Browser::with_token(&page, token).await_close(), 4401, "{token}");
    }
    let mut hasty = Browser::open(&page);
    hasty.say(STOP);
    assert_eq!(hasty.await_close(), 4401, "an order is no token");
    assert_eq!(Browser::open(&page).await_close(), 4408, "a late token may be right");
    assert!(noted.lock().unwrap().is_empty());
}

const STOP: &str = r#"{"id": 7, "order": "stop"}"#;
const KILL: &str = r#"{"order": "kill", "stage": "planner"}"#;
const GO_TO: &str = r#"{"order": "go_to", "targets": [[1.0, 2.0]]}"#;
const GO_BACK: &str = r#"{"order": "go_back"}"#;
const HAND: &str = r#"{"order": "hand", "ahead": 1.0, "left": -0.5}"#;
const PREVIEW: &str = r#"{"order": "preview", "x": 1.5, "y": 0.0}"#;

#[test]
fn who_watches_may_stop_the_robot_and_nothing_else() {
    let (page, noted) = page();
    page.shared.lock().begin(&json!({}), true);
    let mut browser = Browser::watching(&page);
    assert_eq!(browser.await_key("role"), "watch");
    for order in [
        r#"{"order": "resume"}"#,
        KILL,
        r#"{"order": "restart", "stage": "planner"}"#,
        GO_TO,
        GO_BACK,
        HAND,
        PREVIEW,
    ] {
        let (done, why) = browser.order(order);
        assert!(!done && why.contains("to drive"), "{order}: {why}");
    }
    assert_eq!(browser.order(STOP), (true, "confirmed".to_owned()));
    assert_eq!(*noted.lock().unwrap(), [Order::Stop]);
}

#[test]
fn who_drives_is_told_what_was_confirmed_or_why_it_was_not_done() {
    let (page, noted) = page();
    let mut browser = Browser::driving(&page);
    assert_eq!(browser.await_key("role"), "drive");
    let (done, why) = browser.order(KILL);
    assert!(!done && why.contains("simulation"), "a real robot's stage: {why}");
    page.shared.lock().begin(&json!({}), true);
    assert_eq!(browser.order(GO_BACK), (false, "the robot has no supervisor".to_owned()));
    let many = GO_TO.replace("[1.0", &format!("{}[1.0", "[0.0, 0.0],".repeat(16)));
    assert!(!browser.order(&many).0);
    for order in [KILL, GO_TO, HAND, PREVIEW] {
        assert!(browser.order(order).0, "{order}");
    }
    assert_eq!(page.shared.lock().wanted, Some([1.5, 0.0]));
    assert_eq!(
        *noted.lock().unwrap(),
        [
            Order::Kill { stage: "planner".to_owned() },
            Order::GoTo { targets: vec![[1.0, 2.0]] },
            Order::Hand { ahead: 1.0, left: -0.5 },
        ]
    );
}

#[test]
fn a_long_message_and_a_flood_end_the_session() {
    let (page, noted) = page();
    let mut browser = Browser::watching(&page);
    browser.say(&STOP.replace('}', &format!(", \"x\": \"{}\"}}", "x".repeat(4096))));
    browser.await_close();
    let mut browser = Browser::watching(&page);
    for _ in 0..200 {
        browser.say("{}");
    }
    let code = browser.await_close();
    assert!([4429, 0].contains(&code), "{code}");
    assert!(noted.lock().unwrap().is_empty());
}

#[test]
fn connections_beyond_the_limit_are_closed_at_once_and_silent_ones_soon() {
    let (page, _) = page();
    let mut watching = Browser::watching(&page);
    watching.await_key("role");
    let mut silent: Vec<_> = (0..300).map(|_| connect(&page)).collect();
    // Half a request never completes the header.
    for stream in &mut silent {
        let _ = stream.write_all(b"GET / HTTP/1.1\r\n");
    }
    assert!(watching.order(STOP).0, "who watches is served meanwhile");
    Browser::driving(&page).await_key("role");
    // A connection may end with any answer.
    for stream in silent {
        rest(stream);
    }
    assert_eq!(status(&get(&page, "/")), "200");
}

#[test]
fn clients_without_the_token_take_no_place_of_a_session_and_an_owner_always_gets_one() {
    let (page, _) = page();
    let strangers: Vec<_> = (0..100).map(|_| Browser::open(&page)).collect();
    let mut sessions = Vec::new();
    for open in [Browser::watching, Browser::driving] {
        for _ in 0..17 {
            let mut browser = open(&page);
            browser.await_key("role");
            sessions.push(browser);
        }
    }
    for (number, browser) in sessions.iter_mut().enumerate() {
        match number {
            0 | 17 => assert_eq!(browser.await_close(), 4409, "the oldest of its role goes"),
            _ => assert!(browser.order(STOP).0, "{number}"),
        }
    }
    drop(strangers);
}

#[test]
fn the_addresses_are_kept_for_the_owner_alone_and_removed_with_the_page() {
    let page = page().0;
    let kept = fs::metadata(&page.kept).unwrap();
    assert_eq!((kept.mode() & 0o777, kept.uid()), (0o600, geteuid().as_raw()));
    assert_eq!(fs::read_to_string(&page.kept).unwrap(), page.access.addresses());
    let file = page.kept.clone();
    drop(page);
    assert!(!file.exists());
}

#[test]
fn a_request_without_an_end_is_not_waited_for() {
    let (page, _) = page();
    assert_eq!(rest(connect(&page)), "", "nothing was said");
    let mut stream = connect(&page);
    let _ = stream.write_all(&[b'x'; 1 << 20]);
    assert!(!rest(stream).starts_with("HTTP/1.1 2"));
}

#[test]
fn a_page_that_cannot_be_served_says_why() {
    let refused = |options: &Arguments| Page::open(options, noting(&Noted::default())).unwrap_err();
    let far = refused(&options("0.0.0.0:0"));
    assert_eq!(code(far.as_ref()), Some("not-loopback"), "{far}");
    let (first, _) = page();
    let taken = refused(&options(&first.address().to_string()));
    assert_eq!(code(taken.as_ref()), Some("cannot-listen"), "{taken}");
}

#[test]
fn behind_a_proxy_a_page_is_served_under_its_name_alone() {
    let behind_proxy = Some("robot.example".to_owned());
    let options = Arguments { behind_proxy, ..options("127.0.0.1:0") };
    let page = Page::open(&options, noting(&Noted::default())).unwrap();
    assert!(page.access.addresses().starts_with("watch https://robot.example/#"));
    let from = |origin| ask(&page, &["GET / HTTP/1.1", "Host: robot.example", origin]);
    let answer = from("Origin: https://robot.example");
    assert_eq!(status(&answer), "200");
    assert!(answer.contains("connect-src wss://robot.example;"), "{answer}");
    assert_eq!(status(&from("Origin: http://robot.example")), "403");
    assert_eq!(status(&get(&page, "/")), "421");
}
