//! Headless Chromium through the W3C WebDriver protocol.

use std::{
    io::{self, BufRead as _, BufReader, Read as _, Write as _},
    net::TcpStream,
    process::{Child, Command, Stdio},
    time::Instant,
};

use serde_json::{Value, json};

use super::{PATIENCE, commands::with_parent, start_piped};

/// Browser session that ends its driver on drop.
pub struct Browser {
    driver: Child,
    port: u16,
    session: String,
}

/// Returns whether Chromium and its driver are installed.
pub fn has_browser() -> bool {
    ["chromium", "chromedriver"].into_iter().all(|name| {
        let found = Command::new(name).arg("--version").stdout(Stdio::null()).status();
        found.is_ok_and(|status| status.success())
    })
}

impl Browser {
    /// Opens a window of that width. A window of a phone's width has touch input.
    pub fn open(width: u32) -> Self {
        let mut driver = with_parent(&["chromedriver", "--port=0"]);
        let mut driver = start_piped(driver.stderr(Stdio::null()));
        let lines = BufReader::new(driver.stdout.take().unwrap()).lines();
        // The line is "ChromeDriver was started successfully on port N."
        let started = lines.map(Result::unwrap).find(|line| line.contains("successfully"));
        let port = started.unwrap().trim_end_matches('.').rsplit(' ').next().unwrap().parse();
        let mut browser = Self { driver, port: port.unwrap(), session: String::new() };
        let size = format!("--window-size={width},900");
        let mut options =
            json!({"args": ["--headless=new", "--no-sandbox", "--disable-gpu", size]});
        if width < 500 {
            let metrics = json!({"width": width, "height": 844, "pixelRatio": 2, "touch": true});
            options["mobileEmulation"] = json!({"deviceMetrics": metrics});
        }
        let capabilities = json!({"browserName": "chrome", "goog:chromeOptions": options});
        let wanted = json!({"capabilities": {"alwaysMatch": capabilities}});
        let session = browser.post("/session", &wanted);
        browser.session = format!("/session/{}", session["sessionId"].as_str().unwrap());
        browser
    }

    fn post(&self, path: &str, body: &Value) -> Value {
        let (status, value) = self.answer("POST", path, body).unwrap();
        assert!(status.starts_with("HTTP/1.1 200"), "{path}: {value}");
        value["value"].clone()
    }

    /// Sends a request of the session. Returns the first line of the answer, and its content.
    fn answer(&self, method: &str, path: &str, body: &Value) -> io::Result<(String, Value)> {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port))?;
        stream.set_read_timeout(Some(PATIENCE))?;
        let body = body.to_string();
        let length = body.len();
        let session = &self.session;
        let head = format!(
            "{method} {session}{path} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\nContent-Length: {length}\r\n\r\n"
        );
        stream.write_all((head + &body).as_bytes())?;
        let mut answer = BufReader::new(stream);
        let (mut status, mut length) = (String::new(), 0);
        answer.read_line(&mut status)?;
        for line in answer.by_ref().lines() {
            let line = line?.to_lowercase();
            if line.is_empty() {
                break;
            }
            if let Some(value) = line.strip_prefix("content-length:") {
                length = value.trim().parse().map_err(io::Error::other)?;
            }
        }
        let mut body = vec![0; length];
        answer.read_exact(&mut body)?;
        Ok((status, serde_json::from_slice(&body)?))
    }

    pub fn go(&self, url: &str) {
        self.post("/url", &json!({"url": url}));
    }

    pub fn run(&self, script: &str) -> Value {
        self.post("/execute/sync", &json!({"script": script, "args": []}))
    }

    /// Sends a command of Chromium's own protocol.
    pub fn command(&self, name: &str, parameters: &Value) -> Value {
        self.post("/goog/cdp/execute", &json!({"cmd": name, "params": parameters}))
    }

    /// Asserts that each text of the page is legible, in light and dark colours.
    #[track_caller]
    pub fn assert_legible(&self) {
        for scheme in ["light", "dark"] {
            let features = json!([{"name": "prefers-color-scheme", "value": scheme}]);
            self.command("Emulation.setEmulatedMedia", &json!({"features": features}));
            assert_eq!(self.run(include_str!("legibility.js")), json!([]), "{scheme}");
        }
        self.command("Emulation.setEmulatedMedia", &json!({"features": []}));
    }

    pub fn text(&self, id: &str) -> String {
        let text = self.run(&format!("return document.getElementById('{id}').textContent"));
        text.as_str().unwrap().to_owned()
    }

    /// Waits until the element `id` contains `text`.
    #[track_caller]
    pub fn wait_for(&self, id: &str, text: &str) {
        self.wait_until(&format!("document.getElementById('{id}').textContent.includes('{text}')"));
    }

    fn is_so(&self, script: &str) -> bool {
        self.run(&format!("return Boolean({script})")) == true
    }

    /// Waits until a script returns true.
    #[track_caller]
    pub fn wait_until(&self, script: &str) {
        let began = Instant::now();
        while !self.is_so(script) {
            let texts = ["status", "answer", "notice"].map(|id| self.text(id));
            assert!(began.elapsed() < PATIENCE, "timeout: {script}: {texts:?}");
        }
    }

    /// Taps the element `id` at an offset from its centre, CSS pixels.
    pub fn tap(&self, id: &str, x: i32, y: i32) {
        let found = json!({"using": "css selector", "value": format!("#{id}")});
        let element = self.post("/element", &found);
        self.run(&format!("document.getElementById('{id}').scrollIntoView({{block: 'center'}})"));
        let finger = json!({
            "type": "pointer",
            "id": "finger",
            "parameters": {"pointerType": "touch"},
            "actions": [
                {"type": "pointerMove", "origin": element, "x": x, "y": y, "duration": 0},
                {"type": "pointerDown", "button": 0},
                {"type": "pointerUp", "button": 0},
            ],
        });
        self.post("/actions", &json!({"actions": [finger]}));
    }

    /// Taps until `script` is true: a starved page says that it has no connection, and whoever uses
    /// it taps again.
    pub fn tap_until(&self, id: &str, script: &str) {
        let began = Instant::now();
        let is_lost = "document.getElementById('answer').textContent.includes('no connection')";
        while began.elapsed() < PATIENCE {
            self.tap(id, 0, 0);
            self.wait_until(&format!("{script} || {is_lost}"));
            if self.is_so(script) {
                return;
            }
        }
        panic!("timeout: {script}");
    }

    pub fn press(&self, key: &str) {
        let strokes = ["keyDown", "keyUp"].map(|stroke| json!({"type": stroke, "value": key}));
        let keys = json!({"type": "key", "id": "keys", "actions": strokes});
        self.post("/actions", &json!({"actions": [keys]}));
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // Only the end of the session ends the browser with the driver, also after a failed test.
        if !self.session.is_empty() {
            let _ = self.answer("DELETE", "", &json!({}));
        }
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}
