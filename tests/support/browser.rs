//! Headless Chromium through the W3C WebDriver protocol.

use std::{
    io::{self, BufRead as _, BufReader, Read as _, Write as _},
    net::TcpStream,
    process::{Child, Command, Stdio},
    time::Instant,
};

use serde_json::{Value, json};

use super::{PATIENCE, commands::with_parent};

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
        let mut driver = with_parent(&["chromedriver", "--port=0"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
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
        let session = browser.ask("POST", "/session", &wanted);
        browser.session = format!("/session/{}", session["sessionId"].as_str().unwrap());
        browser
    }

    fn ask(&self, method: &str, path: &str, body: &Value) -> Value {
        let (head, value) = self.answer(method, path, body).unwrap();
        assert!(head.starts_with("HTTP/1.1 200"), "{path}: {value}");
        value["value"].clone()
    }

    fn answer(&self, method: &str, path: &str, body: &Value) -> io::Result<(String, Value)> {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port))?;
        stream.set_read_timeout(Some(PATIENCE))?;
        let body = body.to_string();
        let length = body.len();
        let head = format!(
            "{method} {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\nContent-Length: {length}\r\n\r\n"
        );
        stream.write_all((head + &body).as_bytes())?;
        let mut answer = BufReader::new(stream);
        let (mut head, mut length) = (String::new(), 0);
        while !head.ends_with("\r\n\r\n") {
            let start = head.len();
            if answer.read_line(&mut head)? == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            let line = head[start..].to_lowercase();
            if let Some(value) = line.strip_prefix("content-length:") {
                length = value.trim().parse().map_err(io::Error::other)?;
            }
        }
        let mut body = vec![0; length];
        answer.read_exact(&mut body)?;
        Ok((head, serde_json::from_slice(&body)?))
    }

    pub fn go(&self, url: &str) {
        self.ask("POST", &format!("{}/url", self.session), &json!({"url": url}));
    }

    pub fn run(&self, script: &str) -> Value {
        let asked = json!({"script": script, "args": []});
        self.ask("POST", &format!("{}/execute/sync", self.session), &asked)
    }

    /// Sends a command of Chromium's own protocol.
    pub fn command(&self, name: &str, parameters: &Value) -> Value {
        let asked = json!({"cmd": name, "params": parameters});
        self.ask("POST", &format!("{}/goog/cdp/execute", self.session), &asked)
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

    /// Waits until a script returns true.
    #[track_caller]
    pub fn wait_until(&self, script: &str) {
        let began = Instant::now();
        while self.run(&format!("return Boolean({script})")) != true {
            let texts = ["status", "answer", "notice"].map(|id| self.text(id));
            assert!(began.elapsed() < PATIENCE, "timeout: {script}: {texts:?}");
        }
    }

    /// Taps the element `id` at an offset from its centre, CSS pixels.
    pub fn tap(&self, id: &str, x: i32, y: i32) {
        let found = json!({"using": "css selector", "value": format!("#{id}")});
        let element = self.ask("POST", &format!("{}/element", self.session), &found);
        self.run(&format!("document.getElementById('{id}').scrollIntoView({{block: 'center'}})"));
        let actions = json!({"actions": [{
            "type": "pointer",
            "id": "finger",
            "parameters": {"pointerType": "touch"},
            "actions": [
                {"type": "pointerMove", "origin": element, "x": x, "y": y, "duration": 0},
                {"type": "pointerDown", "button": 0},
                {"type": "pointerUp", "button": 0},
            ],
        }]});
        self.ask("POST", &format!("{}/actions", self.session), &actions);
    }

    pub fn press(&self, key: &str) {
        let actions = json!({"actions": [{
            "type": "key",
            "id": "keys",
            "actions": [{"type": "keyDown", "value": key}, {"type": "keyUp", "value": key}],
        }]});
        self.ask("POST", &format!("{}/actions", self.session), &actions);
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // Only the end of the session ends the browser with the driver, also after a failed test.
        if !self.session.is_empty() {
            let _ = self.answer("DELETE", &self.session, &json!({}));
        }
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}
