//! Tests of the page in a headless browser.

use std::{
    io::{BufRead as _, BufReader},
    process::Child,
};

use rustix::process::Signal;
use serde_json::json;

use crate::support::{
    Browser, ENDLESS, Run, assert_nothing_left, firsthand, golden, has_browser, not_run,
    operate as operate_robot, printed, refused, signal_process, start_piped,
};

/// `firsthand page`, which ends with the test.
struct Page {
    child: Child,
    watch: String,
    drive: String,
}

impl Page {
    fn start(robot: &str, listen: &str) -> Self {
        let mut child = firsthand(&["page", "--robot", robot, "--listen", listen]);
        let mut child = start_piped(&mut child);
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap);
        let mut address = |role: &str| {
            let line = lines.next().unwrap();
            line.strip_prefix(role).unwrap().trim_start().to_owned()
        };
        let (watch, drive) = (address("watch"), address("drive"));
        Self { child, watch, drive }
    }

    fn listen(&self) -> &str {
        self.watch.strip_prefix("http://").unwrap().split('/').next().unwrap()
    }

    fn signal(&self, signal: Signal) {
        signal_process(self.child.id(), signal);
    }

    fn end(mut self, signal: Signal) {
        self.signal(signal);
        let _ = self.child.wait();
    }
}

const IS_LOST: &str = "document.body.classList.contains('lost')";
const IS_THERE: &str = "!document.body.classList.contains('lost')";
const GOES: &str = "document.getElementById('status').textContent.startsWith('the robot goes')";
const RESTS: &str = "document.getElementById('status').textContent.includes('at rest')";

const TITLES: &str =
    "return [...document.querySelectorAll('figcaption')].map((it) => it.textContent.split(',')[0])";
const CHARTS: [&str; 9] = [
    "Speed",
    "Turn rate",
    "Left wheel",
    "Right wheel",
    "Sonar",
    "Infrared",
    "Battery",
    "Tick latency",
    "Ticks by latency",
];

#[test]
fn a_robot_is_watched_stopped_and_resumed_on_a_phone_that_loses_and_regains_its_server() {
    if !has_browser() {
        return not_run("the page on a phone", "chromium and chromedriver are missing");
    }
    let robot = "page-phone";
    let page = Page::start(robot, "127.0.0.1:0");
    let browser = Browser::open(390);
    browser.go(&page.drive);
    browser.wait_for("status", "no robot runs");
    assert_eq!(browser.run("return location.hash"), "", "the token is not shown");
    let mut run = Run::start(robot, "open-room", ENDLESS);
    run.wait_until_driving();
    browser.wait_until(GOES);
    browser.wait_until("document.querySelectorAll('#stages tr').length === 6");
    browser.wait_until("document.querySelectorAll('#figures canvas').length >= 5");
    let wide = "document.documentElement.scrollWidth <= innerWidth";
    assert_eq!(browser.run(&format!("return {wide}")), true, "it fits the window");

    browser.assert_legible();
    browser.tap("map", 40, -30);
    browser.wait_for("chosen", ",");
    browser.wait_until("!document.getElementById('go').disabled");
    browser.tap("go", 0, 0);
    browser.wait_for("answer", "target: the supervisor sends the robot there");
    let sent = run.wait_until("the robot has another target", |status| {
        status["target"]["number"].as_u64() > Some(1)
    });
    assert_eq!(sent["order"], "driving");
    browser.wait_for("results", "target 1(4.00, 0.00): replaced");

    browser.tap("stop", 0, 0);
    browser.wait_for("answer", "stop: the robot rests");
    browser.wait_until(RESTS);
    browser.tap_until("resume", GOES);
    browser.press(" ");
    browser.wait_until(RESTS);
    browser.tap_until("resume", GOES);

    // The browser scrubs back, while the header stays live.
    browser.run("const time = document.getElementById('time'); time.value = time.min; time.dispatchEvent(new Event('input'))");
    browser.wait_until("document.getElementById('live').getAttribute('aria-pressed') === 'false'");
    browser.wait_until("!document.getElementById('past').hidden");
    browser.wait_for("past", "Shown: ");
    operate_robot(robot, "stop");
    browser.wait_until(RESTS);
    browser.wait_until("document.querySelector('header').className === 'bad'");
    operate_robot(robot, "resume");
    browser.wait_until(GOES);
    browser.tap("live", 0, 0);
    browser.wait_until("document.getElementById('past').hidden");
    browser.wait_until("document.getElementById('live').getAttribute('aria-pressed') === 'true'");

    page.signal(Signal::STOP);
    browser.wait_until(IS_LOST);
    browser.wait_for("status", "unknown; last known");
    browser.wait_until("document.querySelector('header').className === 'bad'");
    page.signal(Signal::CONT);
    browser.wait_until(IS_THERE);
    browser.wait_until("document.body.classList.contains('drive')");
    let listen = page.listen().to_owned();
    page.end(Signal::KILL);
    browser.wait_until(IS_LOST);
    // The next page has other tokens. Attempts follow every half second, and here none may.
    let page = Page::start(robot, &listen);
    browser.wait_for("notice", "wrong or expired: open an address that `firsthand page`");
    browser.run("window.since = performance.now()");
    browser.wait_until("performance.now() - window.since > 2000");
    assert!(browser.text("notice").contains("expired"), "the notice stays");
    browser.go(&page.watch);
    browser.wait_until(IS_THERE);
    browser.wait_until("!document.body.classList.contains('drive')");
    browser.wait_until(GOES);
    run.stop();
    browser.wait_for("status", "the run ended at");
    page.end(Signal::TERM);
    assert_nothing_left(robot);
}

/// Script that lists elements whose middle is outside the window or covered.
const SEEN: &str = "const hidden = ids.filter((id) => {
  const box = document.getElementById(id).getBoundingClientRect();
  const top = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
  return !top || !document.getElementById(id).contains(top);
});
return hidden";

#[test]
fn actions_and_answers_are_in_view_at_every_size_without_scrolling() {
    if !has_browser() {
        return not_run("the page at four sizes", "chromium and chromedriver are missing");
    }
    let robot = "page-sizes";
    let mut run = Run::start(robot, "open-room", ENDLESS);
    run.wait_until_driving();
    let page = Page::start(robot, "127.0.0.1:0");
    let browser = Browser::open(1400);
    browser.go(&page.drive);
    browser.wait_until(GOES);
    for (width, height) in [(360, 640), (1280, 720), (1366, 768), (1400, 900)] {
        let size =
            json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        browser.command("Emulation.setDeviceMetricsOverride", &size);
        let seen = |ids: &[&str], scrolled: &str, when: &str| {
            browser.run(&format!("scrollTo(0, {scrolled})"));
            let hidden = browser.run(&format!("const ids = {};\n{SEEN}", json!(ids)));
            assert_eq!(hidden, json!([]), "{when} at {width} x {height}");
        };
        seen(&["stop", "resume", "chosen", "return", "play", "live"], "0", "before a choice");
        browser.tap("map", 20, -30);
        browser.wait_until("!document.getElementById('go').disabled");
        seen(&["stop", "go", "waypoint", "clear", "chosen"], "0", "after a choice");
        if (width, height) == (1280, 720) {
            browser.tap("go", 0, 0);
            browser.wait_for("answer", "target: the supervisor sends the robot there");
        }
        browser.tap("stop", 0, 0);
        browser.wait_for("answer", "stop: the robot rests");
        seen(&["stop", "answer", "status", "go"], "0", "after a stop");
        seen(&["stop", "answer", "status"], "document.body.scrollHeight", "scrolled down");
        browser.assert_legible();
        browser.tap_until("resume", GOES);
        browser.tap("clear", 0, 0);
    }
    run.stop();
    page.end(Signal::TERM);
}

#[test]
fn a_recorded_run_is_scrubbed_played_and_printed_with_what_moved_in_windows_of_both_widths() {
    if !has_browser() {
        return not_run("a recorded page", "chromium and chromedriver are missing");
    }
    let (_, directory) = Run::at_own_speed("page-movers", "walkers", "").arrives_in();
    let page = directory.path().join("run/report/report.html");
    let out = tempfile::tempdir().unwrap();
    let golden = golden().path;
    let golden = ["report", golden.to_str().unwrap(), "--out", out.path().to_str().unwrap()];
    let golden = printed(&golden);
    let has_metrics = "document.querySelectorAll('#metrics tr').length > 10";
    let time = "document.getElementById('time')";
    let ends = format!("{time}.value === {time}.max");
    let picture = "return document.getElementById('map').toDataURL()";
    for width in [1280, 390] {
        let browser = Browser::open(width);
        browser.go(&format!("file://{}", golden.trim_end()));
        browser.wait_until(has_metrics);
        assert_eq!(browser.run(TITLES), json!(CHARTS));
        browser.go(&format!("file://{}", page.display()));
        browser.wait_until(has_metrics);
        browser.wait_until("document.querySelectorAll('#figures canvas').length >= 5");
        browser.wait_until(&ends);
        browser.wait_until("document.getElementById('status').className === 'good'");
        browser.assert_legible();
        let at_the_end = browser.run(picture);
        let scrub = |at: &str| {
            browser.run(&format!("{time}.value = {at}; {time}.dispatchEvent(new Event('input'))"));
            let shown = "document.getElementById('now').textContent";
            browser.wait_until(&format!("{shown} === Number({at}).toFixed(1) + ' s'"));
        };
        scrub(&format!("{time}.min"));
        assert_eq!(browser.run(MOVERS), 0, "nothing is known yet");
        scrub("5");
        assert!(browser.run(MOVERS).as_u64() > Some(50), "five people walk");
        assert!(browser.text("legend").contains("moving"));
        assert_ne!(browser.run(picture), at_the_end, "the map shows another time");
        browser.run("document.getElementById('speed').value = '10'");
        browser.tap("play", 0, 0);
        browser.wait_until(&ends);
        browser.wait_for("play", "Play");
        let there =
            browser.run("return getComputedStyle(document.getElementById('urgent')).display");
        assert_eq!(there, "none", "a recording has no stop button");
        if width == 1280 {
            assert_dark_is_printed_in_light(&browser);
        }
    }
}

/// Script that counts pixels in the colour of movers.
const MOVERS: &str = "const map = document.getElementById('map');
const { data } = map.getContext('2d').getImageData(0, 0, map.width, map.height);
const hex = getComputedStyle(document.documentElement).getPropertyValue('--mover').trim();
const colour = [1, 3, 5].map((from) => parseInt(hex.slice(from, from + 2), 16));
let count = 0;
for (let from = 0; from < data.length; from += 4) {
  if (colour.every((part, at) => Math.abs(part - data[from + at]) < 12)) count++;
}
return count";

fn assert_dark_is_printed_in_light(browser: &Browser) {
    let features = json!([{"name": "prefers-color-scheme", "value": "dark"}]);
    browser.command("Emulation.setEmulatedMedia", &json!({"features": features}));
    let corner = "document.getElementById('map').getContext('2d').getImageData(2, 2, 1, 1).data[0]";
    browser.wait_until(&format!("{corner} === 23"));
    browser.run(&format!("addEventListener('beforeprint', () => (window.paper = {corner}))"));
    let printed = browser.command("Page.printToPDF", &json!({"preferCSSPageSize": true}));
    assert!(printed["data"].as_str().unwrap().starts_with("JVBERi"), "a PDF in base64");
    assert_eq!(browser.run("return window.paper"), 255);
    browser.wait_until(&format!("{corner} === 23"));
}

#[test]
fn a_page_for_others_than_this_machine_is_refused_and_one_without_a_robot_ends_on_request() {
    let listen = ["page", "--robot", "page-far", "--listen"];
    refused(
        &[&listen[..], &["0.0.0.0:0"]].concat(),
        "not-loopback",
        &["0.0.0.0", "--behind-proxy"],
    );
    refused(&[&listen[..], &["here"]].concat(), "usage", &["--listen"]);
    let mut page = Page::start("page-none", "127.0.0.1:0");
    page.signal(Signal::TERM);
    assert!(page.child.wait().unwrap().success());
}
