//! Chromium without a window, driven over the DevTools protocol: opens a page, moves a pen on it, looks at
//! it.

use std::io::Write;
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use base64::Engine as _;
use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

/// Longest time that the browser may take for anything.
const PATIENCE: Duration = Duration::from_secs(60);

/// A browser with one page.
pub struct Chromium {
    child: Child,
    socket: WebSocket<TcpStream>,
    session: String,
    next: u64,
    /// Complaints of the page: exceptions, errors on its console, failed loads.
    complaints: Vec<String>,
    _profile: tempfile::TempDir,
}

/// Size and colours of the window.
pub struct Look {
    pub width: u32,
    pub height: u32,
    pub dark: bool,
}

fn program() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let names = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
    names
        .iter()
        .find_map(|name| std::env::split_paths(&path).map(|dir| dir.join(name)).find(|file| file.is_file()))
}

impl Chromium {
    /// A browser, or none and a line that says so where none is installed.
    pub fn start() -> Option<Self> {
        let Some(program) = program() else {
            // The harness swallows what `eprintln` says in a test that passes.
            let _ = std::io::stderr().write_all(
                b"SKIPPED: chromium is not installed: nothing of the page was looked at in a browser\n",
            );
            return None;
        };
        let profile = tempfile::tempdir().expect("a folder for the browser");
        let mut command = Command::new(program);
        command.args(["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]);
        command.args(["--no-first-run", "--disable-extensions", "--disable-background-networking"]);
        command.arg("--autoplay-policy=no-user-gesture-required");
        command.args(["--mute-audio", "--hide-scrollbars", "--remote-debugging-port=0", "about:blank"]);
        command.arg(format!("--user-data-dir={}", profile.path().display()));
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        // The program may be a script that starts others: all of them are one group, and end together.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let child = command.spawn().expect("chromium starts");
        let mut browser = Self::connect(child, profile);
        browser.open_page();
        Some(browser)
    }

    fn connect(child: Child, profile: tempfile::TempDir) -> Self {
        let port_file = profile.path().join("DevToolsActivePort");
        let text = wait("chromium says its port", || {
            std::fs::read_to_string(&port_file).ok().filter(|text| text.lines().count() == 2)
        });
        let (port, path) = text.split_once('\n').expect("two lines");
        let stream = TcpStream::connect(format!("127.0.0.1:{port}")).expect("chromium listens");
        stream.set_nodelay(true).expect("a socket");
        stream.set_read_timeout(Some(Duration::from_millis(50))).expect("a socket");
        let url = format!("ws://127.0.0.1:{port}{}", path.trim());
        let socket = shake(&url, stream);
        Self { child, socket, session: String::new(), next: 0, complaints: Vec::new(), _profile: profile }
    }

    fn open_page(&mut self) {
        let target = self.call("Target.createTarget", json!({ "url": "about:blank" }));
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        let session = self.call("Target.attachToTarget", attach);
        self.session = session["sessionId"].as_str().expect("a session").to_owned();
        for domain in ["Page", "Runtime", "Log", "Network"] {
            self.call(&format!("{domain}.enable"), json!({}));
        }
    }

    /// Sends a command and waits for no answer: awaited events come at 60 a second.
    pub fn send(&mut self, method: &str, params: Value) -> u64 {
        self.next += 1;
        let mut command = json!({ "id": self.next, "method": method, "params": params });
        if !self.session.is_empty() {
            command["sessionId"] = json!(self.session);
        }
        self.socket.send(Message::text(command.to_string())).expect("chromium hears");
        self.next
    }

    /// Sends a command and returns its result.
    pub fn call(&mut self, method: &str, params: Value) -> Value {
        let id = self.send(method, params);
        let mut answer = self.wait_for(method, id);
        assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
        answer["result"].take()
    }

    /// Whether an answer to a command has come: what it is. Waits for nothing.
    pub fn answer(&mut self, id: u64) -> Option<Value> {
        let set = |browser: &mut Self, waits: bool| {
            browser.socket.get_mut().set_nonblocking(!waits).expect("a socket");
        };
        set(self, false);
        let mut found = None;
        while let (None, Some(mut message)) = (&found, self.read()) {
            found = (message["id"] == id).then(|| message["result"].take());
        }
        set(self, true);
        found
    }

    /// Waits for the answer to a command, which comes behind those that nobody waited for.
    fn wait_for(&mut self, what: &str, id: u64) -> Value {
        wait(what, || {
            let mut message = self.read();
            while message.as_ref().is_some_and(|message| message["id"] != id) {
                message = self.read();
            }
            message
        })
    }

    /// One message of the browser, if there is one.
    fn read(&mut self) -> Option<Value> {
        let text = match self.socket.read() {
            Ok(message) => message.into_text().ok()?,
            Err(tungstenite::Error::Io(e))
                if matches!(e.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) =>
            {
                return None;
            }
            Err(e) => panic!("chromium is gone: {e}"),
        };
        let message: Value = serde_json::from_str(&text).expect("JSON");
        let params = &message["params"];
        match message["method"].as_str().unwrap_or_default() {
            "Runtime.exceptionThrown" => self.complaints.push(params["exceptionDetails"].to_string()),
            "Runtime.consoleAPICalled"
                if matches!(params["type"].as_str(), Some("error" | "warning" | "assert")) =>
            {
                self.complaints.push(params["args"].to_string());
            }
            "Log.entryAdded" if params["entry"]["level"] == "error" => {
                self.complaints.push(format!("{} {}", params["entry"]["text"], params["entry"]["url"]));
            }
            _ => {}
        }
        Some(message)
    }

    /// Complaints of the page so far.
    pub fn complaints(&mut self) -> Vec<String> {
        self.eval("1");
        std::mem::take(&mut self.complaints)
    }

    /// The value of an expression; a promise is awaited.
    pub fn eval(&mut self, script: &str) -> Value {
        let params = json!({ "expression": script, "returnByValue": true, "awaitPromise": true });
        let mut result = self.call("Runtime.evaluate", params);
        assert!(result["exceptionDetails"].is_null(), "{script}: {}", result["exceptionDetails"]);
        result["result"]["value"].take()
    }

    /// Runs a script on the page without waiting for it; see [`answer`](Self::answer).
    pub fn asks(&mut self, script: &str) -> u64 {
        self.send("Runtime.evaluate", json!({ "expression": script, "returnByValue": true }))
    }

    /// Waits until an expression is true.
    pub fn until(&mut self, script: &str) {
        wait(script, || (self.eval(script) == true).then_some(()));
    }

    /// Says how the page is looked at.
    pub fn look(&mut self, look: &Look) {
        let Look { width, height, dark } = look;
        let narrow = *width < 620;
        let scale = if narrow { 2 } else { 1 };
        let metrics =
            json!({ "width": width, "height": height, "deviceScaleFactor": scale, "mobile": narrow });
        self.call("Emulation.setDeviceMetricsOverride", metrics);
        let scheme =
            json!([{ "name": "prefers-color-scheme", "value": if *dark { "dark" } else { "light" } }]);
        self.call("Emulation.setEmulatedMedia", json!({ "features": scheme }));
    }

    /// Opens an address, and returns once its page stands.
    pub fn open(&mut self, url: &str) {
        self.call("Page.navigate", json!({ "url": url }));
        self.until(&format!("location.href === {} && document.readyState === 'complete'", json!(url)));
    }

    /// A pen over a point: `mousePressed`, `mouseMoved` or `mouseReleased`, and how hard. Waits for nothing.
    pub fn pen(&mut self, event: &str, [x, y]: [f64; 2], force: f64) {
        let down = event != "mouseReleased";
        self.send(
            "Input.dispatchMouseEvent",
            json!({
                "type": event, "x": x, "y": y, "force": force, "pointerType": "pen", "button": "left",
                "buttons": u8::from(down), "clickCount": u8::from(event == "mousePressed"),
            }),
        );
    }

    /// A key down and up.
    pub fn key(&mut self, key: &str, code: &str) {
        for event in ["keyDown", "keyUp"] {
            let virtual_code = match code {
                "Space" => 32,
                "Tab" => 9,
                _ => 0,
            };
            let text = if event == "keyDown" && key.len() == 1 { key } else { "" };
            let params = json!({
                "type": event, "key": key, "code": code, "text": text, "windowsVirtualKeyCode": virtual_code,
            });
            self.call("Input.dispatchKeyEvent", params);
        }
    }

    /// The middle of an element, in CSS pixels.
    pub fn middle(&mut self, selector: &str) -> [f64; 2] {
        let script = format!(
            "(() => {{ const e = document.querySelector({}); e.scrollIntoView({{ block: 'center' }}); \
             const b = e.getBoundingClientRect(); return [b.left + b.width / 2, b.top + b.height / 2]; }})()",
            json!(selector)
        );
        let at = self.eval(&script);
        [0, 1].map(|i| at[i].as_f64().expect("a place"))
    }

    /// Clicks an element.
    pub fn click(&mut self, selector: &str) {
        let [x, y] = self.middle(selector);
        for event in ["mousePressed", "mouseReleased"] {
            let params = json!({ "type": event, "x": x, "y": y, "button": "left", "clickCount": 1 });
            self.call("Input.dispatchMouseEvent", params);
        }
    }

    /// Sends a signal to the browser and all its processes: STOP, and CONT.
    pub fn signal(&self, name: &str) {
        let group = format!("-{}", self.child.id());
        let done = Command::new("kill").args([&format!("-{name}"), "--", &group]).status();
        assert!(done.is_ok_and(|status| status.success()), "kill -{name}");
    }

    /// A picture of the window as it stands, while something is done on the page that waits for no answer:
    /// nothing is laid out anew for it, so that what moves goes on.
    pub fn picture_while(&mut self, file: &Path, doing: impl FnOnce(&mut Self)) {
        let id = self.send("Page.captureScreenshot", json!({}));
        doing(self);
        let answer = self.wait_for("a picture", id);
        let data = answer["result"]["data"].as_str().expect("a picture");
        let png = base64::engine::general_purpose::STANDARD.decode(data).expect("base64");
        std::fs::write(file, png).expect("a file");
    }
}

impl Drop for Chromium {
    fn drop(&mut self) {
        self.session.clear();
        let close = json!({ "id": self.next + 1, "method": "Browser.close" });
        let _ = self.socket.send(Message::text(close.to_string()));
        let until = Instant::now() + Duration::from_secs(5);
        while Instant::now() < until && matches!(self.child.try_wait(), Ok(None)) {
            std::thread::sleep(Duration::from_millis(20));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Opens a WebSocket over a socket whose reads may time out.
fn shake(url: &str, stream: TcpStream) -> WebSocket<TcpStream> {
    let mut shaken = tungstenite::client(url, stream);
    let until = Instant::now() + PATIENCE;
    loop {
        match shaken {
            Ok((socket, _)) => return socket,
            Err(tungstenite::HandshakeError::Interrupted(mid)) if Instant::now() < until => {
                shaken = mid.handshake()
            }
            Err(e) => panic!("chromium does not answer: {e}"),
        }
    }
}

/// Tries until `look` finds something.
fn wait<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let until = Instant::now() + PATIENCE;
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(Instant::now() < until, "waited too long: {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}
