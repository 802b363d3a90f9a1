//! The program, and a page without a browser.

use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest as _;
use tungstenite::{Message, WebSocket};

/// Whatever is waited for is there by then, also on a busy machine.
pub(crate) const PATIENCE: Duration = Duration::from_mins(1);

/// `splatblur view`, until it is dropped.
pub(crate) struct Program {
    pub(crate) child: Child,
    /// `http://127.0.0.1:PORT/TOKEN/`.
    pub(crate) link: String,
    pub(crate) begin: Instant,
}

impl Program {
    pub(crate) fn start(scene: &Path, more: &[&str]) -> Self {
        let begin = Instant::now();
        let mut child = Command::new(env!("CARGO_BIN_EXE_splatblur"))
            .args(["view", "--backend", "cpu", "--quiet"])
            .args(more)
            .arg(scene)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut link = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut link).unwrap();
        assert!(link.starts_with("http://127.0.0."), "{link:?}");
        Self { child, link: link.trim().to_owned(), begin }
    }

    /// `127.0.0.1:PORT` and `TOKEN`.
    pub(crate) fn parts(&self) -> (String, String) {
        let (host, rest) = self.link.strip_prefix("http://").unwrap().split_once('/').unwrap();
        (host.to_owned(), rest.trim_end_matches('/').to_owned())
    }

    pub(crate) fn connect(&self) -> TcpStream {
        Self::connect_to(&self.parts().0)
    }

    pub(crate) fn connect_to(host: &str) -> TcpStream {
        let stream = TcpStream::connect(host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream
    }

    /// The whole answer to a request with these lines.
    pub(crate) fn ask(&self, lines: &[&str]) -> String {
        Self::ask_at(self.connect(), lines)
    }

    pub(crate) fn ask_at(mut stream: TcpStream, lines: &[&str]) -> String {
        stream.write_all((lines.join("\r\n") + "\r\n\r\n").as_bytes()).unwrap();
        let mut answer = Vec::new();
        // A refused connection may end before its answer.
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    pub(crate) fn page(&self) -> Page {
        let (host, token) = self.parts();
        let mut request = format!("ws://{host}/{token}/socket").into_client_request().unwrap();
        request.headers_mut().insert("Origin", format!("http://{host}").parse().unwrap());
        let (socket, _) = tungstenite::client(request, self.connect()).unwrap();
        Page { socket, serial: 0 }
    }

    /// Resident memory, bytes.
    pub(crate) fn memory(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
        line.split_whitespace().next().unwrap().parse::<u64>().unwrap() * 1024
    }

    /// Processor time so far, seconds.
    pub(crate) fn cpu(&self) -> f64 {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.child.id())).unwrap();
        let fields: Vec<&str> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
        // In hundredths of a second on every Linux of today.
        (fields[11].parse::<f64>().unwrap() + fields[12].parse::<f64>().unwrap()) / 100.0
    }
}

/// The small scene in a folder of its own, a program that shows it, and a page that has heard of it.
pub(crate) struct Visit {
    /// The folder; removed at the end.
    pub(crate) dir: tempfile::TempDir,
    pub(crate) scene: PathBuf,
    /// Where the program saves.
    pub(crate) out: PathBuf,
    pub(crate) program: Program,
    pub(crate) page: Page,
}

impl Visit {
    pub(crate) fn new() -> Self {
        Self::to(scene)
    }

    /// To a scene that `make` puts into a folder.
    pub(crate) fn to(make: impl FnOnce(&Path) -> PathBuf) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let (scene, out) = (make(dir.path()), dir.path().join("saved"));
        let program = Program::start(&scene, &["--out", out.to_str().unwrap()]);
        let mut page = program.page();
        page.text("scene");
        Self { dir, scene, out, program, page }
    }

    /// Asks for a view, and waits for its finished picture.
    pub(crate) fn shown(&mut self, changes: Value) -> (Value, Vec<u8>) {
        let serial = self.page.see(changes);
        self.page.finished(serial)
    }

    /// Saves what is shown; the path.
    pub(crate) fn save(&mut self, what: &str) -> PathBuf {
        self.page.say(&json!({ "type": "save", "what": what }));
        PathBuf::from(self.page.text("saved")["path"].as_str().unwrap())
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A page that is no browser.
pub(crate) struct Page {
    pub(crate) socket: WebSocket<TcpStream>,
    serial: u64,
}

/// What the program sends.
pub(crate) enum Heard {
    Text(Value),
    /// Header and PNG.
    Picture(Value, Vec<u8>),
    /// The connection ended: why.
    End(String),
}

impl Page {
    /// Asks for a view, with these values in place of the usual ones; returns its serial.
    pub(crate) fn see(&mut self, changes: Value) -> u64 {
        self.serial += 1;
        let mut view = json!({
            "type": "view", "serial": self.serial, "width": 96, "height": 72, "frame": 1, "moving": false,
            "camera": null, "shutter": null, "mode": "supersample:4", "split": null, "buffer": "colour",
            "backend": "auto", "prefilter": null, "shading": "phong",
        });
        let Value::Object(changes) = changes else { panic!("no object") };
        view.as_object_mut().unwrap().extend(changes);
        self.say(&view);
        self.serial
    }

    pub(crate) fn say(&mut self, message: &Value) {
        // A connection that was ended is seen when it is read.
        let _ = self.socket.send(Message::text(message.to_string()));
    }

    /// The next message, without a word that it was seen.
    pub(crate) fn listen(&mut self) -> Heard {
        let begin = Instant::now();
        loop {
            // The program asks for signs of life all the time.
            if begin.elapsed() > PATIENCE {
                return Heard::End("nothing was said".to_owned());
            }
            match self.socket.read() {
                Ok(Message::Text(text)) => return Heard::Text(serde_json::from_str(&text).unwrap()),
                Ok(Message::Binary(bytes)) => {
                    let length = u32::from_be_bytes(bytes[..4].try_into().unwrap()) as usize;
                    let header = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
                    return Heard::Picture(header, bytes[4 + length..].to_vec());
                }
                Ok(Message::Close(frame)) => return Heard::End(frame.map_or(String::new(), |f| f.reason.to_string())),
                Ok(_) => {}
                Err(why) => return Heard::End(why.to_string()),
            }
        }
    }

    /// The next message; pictures are acknowledged.
    pub(crate) fn hear(&mut self) -> Heard {
        let heard = self.listen();
        if let Heard::Picture(header, _) = &heard {
            self.say(&json!({ "type": "shown", "picture": header["picture"] }));
        }
        heard
    }

    /// The next text of this type.
    pub(crate) fn text(&mut self, kind: &str) -> Value {
        loop {
            match self.hear() {
                Heard::Text(text) if text["type"] == kind => return text,
                Heard::End(why) => panic!("waiting for {kind}, the connection ended: {why}"),
                _ => {}
            }
        }
    }

    /// The next picture.
    pub(crate) fn picture(&mut self) -> (Value, Vec<u8>) {
        loop {
            match self.hear() {
                Heard::Picture(header, png) => return (header, png),
                Heard::Text(_) => {}
                Heard::End(why) => panic!("the connection ended: {why}"),
            }
        }
    }

    /// The finished picture of view `serial`.
    pub(crate) fn finished(&mut self, serial: u64) -> (Value, Vec<u8>) {
        loop {
            let (header, png) = self.picture();
            if header["serial"] == serial && header["finished"] == true {
                return (header, png);
            }
        }
    }

    /// Why the connection ended.
    pub(crate) fn end(&mut self) -> String {
        loop {
            if let Heard::End(why) = self.listen() {
                return why;
            }
        }
    }
}

/// A ball that flies before a wall, in a folder of its own: small, and with motion.
pub(crate) fn scene(dir: &Path) -> PathBuf {
    let mut ball = String::new();
    for i in 0..40 {
        for j in 0..20 {
            let (a, b) = (f64::from(i) * 0.157, f64::from(j) * 0.157 + 0.08);
            let (x, y, z) = (a.cos() * b.sin(), b.cos(), a.sin() * b.sin());
            writeln!(ball, "{x:.4} {y:.4} {z:.4} {} {} 90", 80 + 4 * i, 200 - 5 * j).unwrap();
        }
    }
    std::fs::write(dir.join("ball.xyz"), ball).unwrap();
    let path = dir.join("flight.xml");
    std::fs::write(&path, SCENE).unwrap();
    path
}

pub(crate) const SCENE: &str = r#"<scene>
  <image width="96" height="72" background="0.1 0.1 0.2"/>
  <frames first="0" last="12"/>
  <shutter open="-0.5" close="0.5"/>
  <camera eye="0 0 8" at="0 0 0" fovy="40"/>
  <light type="directional" direction="-1 -1 -1" intensity="1"/>
  <light type="ambient" intensity="0.2"/>
  <object name="ball">
    <pointModel>ball.xyz</pointModel>
    <motion type="linear" velocity="0.3 0 0"/>
  </object>
</scene>
"#;
