//! Headless Chromium, driven through its `DevTools` protocol: <https://chromedevtools.github.io/devtools-protocol>.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

use crate::support::PATIENCE;

/// Names under which systems have it.
const NAMES: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// A browser with one page.
pub(crate) struct Browser {
    child: Child,
    socket: WebSocket<TcpStream>,
    session: String,
    calls: u64,
    /// What the page complained about.
    pub(crate) complaints: Vec<String>,
    /// The profile; removed at the end.
    _profile: tempfile::TempDir,
}

/// Starts the browser; where there is none, says so and skips, unless `REQUIRE_BROWSER` is set.
pub(crate) fn browser_or_skip(test: &str) -> Option<Browser> {
    let found = NAMES.iter().find(|name| Command::new(name).arg("--version").output().is_ok());
    match found {
        Some(name) => Some(Browser::start(name)),
        None if std::env::var_os("REQUIRE_BROWSER").is_none() => {
            // Past the capture of the test harness: a skip is never silent.
            let _ = writeln!(std::io::stderr(), "SKIPPED {test}: there is no browser ({})", NAMES.join(", "));
            None
        }
        None => panic!("REQUIRE_BROWSER is set, but {test} found none of {}", NAMES.join(", ")),
    }
}

impl Browser {
    fn start(name: &str) -> Self {
        let profile = tempfile::tempdir().unwrap();
        let mut child = Command::new(name)
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
            .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
            .args(["--disable-dev-shm-usage", "--remote-debugging-port=0"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg("about:blank")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
        let prefix = "DevTools listening on ";
        let address = lines.find_map(|line| Some(line.ok()?.strip_prefix(prefix)?.to_owned())).expect("its address");
        // Nobody reads the rest, but its pipe must not fill.
        std::thread::spawn(move || lines.for_each(drop));
        let host = address.strip_prefix("ws://").unwrap().split('/').next().unwrap();
        let stream = TcpStream::connect(host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.set_nodelay(true).unwrap();
        let (socket, _) = tungstenite::client(&address, stream).unwrap();
        let mut browser =
            Self { child, socket, session: String::new(), calls: 0, complaints: Vec::new(), _profile: profile };
        let target = browser.call("Target.createTarget", json!({ "url": "about:blank" }))["targetId"].clone();
        let attached = browser.call("Target.attachToTarget", json!({ "targetId": target, "flatten": true }));
        attached["sessionId"].as_str().unwrap().clone_into(&mut browser.session);
        for domain in ["Page", "Runtime", "Log"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        browser
    }

    /// Calls a method, and returns its result.
    #[allow(clippy::needless_pass_by_value, reason = "callers make it on the spot")]
    pub(crate) fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.calls += 1;
        let mut call = json!({ "id": self.calls, "method": method, "params": parameters });
        if !self.session.is_empty() {
            call["sessionId"] = json!(self.session);
        }
        self.socket.send(Message::text(call.to_string())).unwrap();
        loop {
            let message = self.socket.read().unwrap();
            let Message::Text(text) = message else { continue };
            let mut message: Value = serde_json::from_str(&text).unwrap();
            if message["id"] == self.calls {
                assert!(message["error"].is_null(), "{method}: {message}");
                return message["result"].take();
            }
            let entry = &message["params"]["entry"];
            if message["method"] == "Runtime.exceptionThrown" {
                self.complaints.push(message["params"]["exceptionDetails"].to_string());
            // A connection that is refused while the program starts again is no fault of the page.
            } else if entry["level"] == "error" && !entry["text"].to_string().contains("ERR_CONNECTION") {
                self.complaints.push(entry["text"].to_string());
            }
        }
    }

    pub(crate) fn open(&mut self, link: &str) {
        self.call("Page.navigate", json!({ "url": link }));
        self.wait("document.readyState === 'complete' && !!window.viewer?.scene");
    }

    /// The value of an expression of the page.
    pub(crate) fn value(&mut self, expression: &str) -> Value {
        let parameters = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let result = self.call("Runtime.evaluate", parameters);
        assert!(result["exceptionDetails"].is_null(), "{expression}: {result}");
        result["result"]["value"].clone()
    }

    pub(crate) fn number(&mut self, expression: &str) -> f64 {
        self.value(expression).as_f64().unwrap_or(f64::NAN)
    }

    pub(crate) fn text(&mut self, expression: &str) -> String {
        self.value(expression).as_str().unwrap_or_default().to_owned()
    }

    /// Waits until an expression is true; returns the seconds.
    pub(crate) fn wait(&mut self, expression: &str) -> f64 {
        let begin = Instant::now();
        while self.value(&format!("!!({expression})")) != true {
            if begin.elapsed() > PATIENCE {
                let state = self.text("document.body.innerText");
                panic!("waited in vain for {expression}: {state}");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        begin.elapsed().as_secs_f64()
    }

    pub(crate) fn mouse(&mut self, kind: &str, [x, y]: [f64; 2]) {
        let buttons = i32::from(kind != "mouseReleased");
        let (button, clicks) = if kind == "mouseMoved" { ("none", 0) } else { ("left", 1) };
        let parameters =
            json!({ "type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": clicks });
        self.call("Input.dispatchMouseEvent", parameters);
    }

    /// Presses a key that writes `text`, or that is named by it.
    pub(crate) fn key(&mut self, text: &str) {
        let named = text.len() > 1;
        let mut parameters = json!({ "type": if named { "rawKeyDown" } else { "keyDown" }, "key": text });
        if !named {
            parameters["text"] = json!(text);
        }
        self.call("Input.dispatchKeyEvent", parameters);
        self.call("Input.dispatchKeyEvent", json!({ "type": "keyUp", "key": text }));
    }

    /// Writes into a control and leaves it, as a person does.
    pub(crate) fn write(&mut self, id: &str, text: &str) {
        let text = json!(text);
        self.value(&format!(
            "(() => {{ const e = document.getElementById('{id}'); e.value = {text}; \
             e.dispatchEvent(new Event('change')); }})()"
        ));
    }

    pub(crate) fn size(&mut self, width: u32, height: u32, ratio: f64) {
        let parameters = json!({ "width": width, "height": height, "deviceScaleFactor": ratio, "mobile": false });
        self.call("Emulation.setDeviceMetricsOverride", parameters);
    }

    pub(crate) fn scheme(&mut self, scheme: &str) {
        let feature = json!({ "name": "prefers-color-scheme", "value": scheme });
        self.call("Emulation.setEmulatedMedia", json!({ "features": [feature] }));
    }

    /// A picture of the page, where `VIEW_SCREENSHOTS` names a folder for it.
    pub(crate) fn screenshot(&mut self, name: &str) {
        let Some(folder) = std::env::var_os("VIEW_SCREENSHOTS") else { return };
        let data = self.call("Page.captureScreenshot", json!({ "format": "png" }))["data"].take();
        let bytes = from_base64(data.as_str().unwrap());
        std::fs::write(Path::new(&folder).join(format!("{name}.png")), bytes).unwrap();
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn from_base64(text: &str) -> Vec<u8> {
    const DIGITS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digits = text.bytes().filter_map(|c| DIGITS.iter().position(|&digit| digit == c));
    let (mut bytes, mut bits, mut count) = (Vec::new(), 0_u32, 0);
    for digit in digits {
        (bits, count) = (bits << 6 | digit as u32, count + 6);
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
        }
    }
    bytes
}
