//! Enemies on the same computer or in the same browser: each is refused or bounded, and a page beside them goes on.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::process::Command;
use std::time::{Duration, Instant};

use serde_json::json;
use tungstenite::Message;

use crate::support::{Heard, PATIENCE, Page, Program, Visit, scene};

/// Runs `attack` beside a page, which gets a picture before and after it.
fn beside(attack: impl FnOnce(&Program)) {
    let dir = tempfile::tempdir().unwrap();
    let mut program = Program::start(&scene(dir.path()), &[]);
    let mut page = program.page();
    page.text("scene");
    let serial = page.see(json!({}));
    page.finished(serial);
    attack(&program);
    let serial = page.see(json!({ "frame": 2 }));
    page.finished(serial);
    let mut other = program.page();
    other.text("scene");
    let serial = other.see(json!({ "frame": 3 }));
    other.finished(serial);
    assert!(program.child.try_wait().unwrap().is_none());
}

fn status(answer: &str) -> &str {
    answer.split(' ').nth(1).unwrap_or(answer)
}

#[test]
fn requests_of_others_are_refused() {
    beside(|program| {
        let (host, token) = program.parts();
        let get = |path: &str| format!("GET {path} HTTP/1.1");
        let page = get(&format!("/{token}/"));
        let own = format!("Host: {host}");
        assert_eq!(status(&program.ask(&[&page, &own])), "200");
        let tunnel = "Host: localhost:8000\r\nOrigin: http://localhost:8000";
        assert_eq!(status(&program.ask(&[&page, tunnel])), "200");
        for (path, fields, wanted) in [
            (get("/"), own.clone(), "403"),
            (get(&format!("/{}/", "0".repeat(32))), own.clone(), "403"),
            (get(&format!("/{token}/../../etc/passwd")), own.clone(), "404"),
            (page.clone(), "Host: viewer.example".to_owned(), "403"),
            (page.clone(), format!("Host: viewer.example:80\r\n{own}"), "400"),
            (page.clone(), format!("{own}\r\nOrigin: http://evil.example"), "403"),
            (page.replace("GET", "POST"), own.clone(), "405"),
            (get(&format!("/{token}/socket")), own.clone(), "403"),
            (get(&format!("/{token}/socket")), format!("{own}\r\nOrigin: http://{host}"), "426"),
        ] {
            assert_eq!(status(&program.ask(&[&path, &fields])), wanted, "{path} {fields}");
        }
        let answer = program.ask(&[&page, &own]);
        for field in ["default-src 'none'", "frame-ancestors 'none'", "Referrer-Policy: no-referrer", "nosniff"] {
            assert!(answer.contains(field), "{field}");
        }
    });
}

#[test]
fn a_socket_needs_the_token_and_the_origin() {
    beside(|program| {
        let (host, token) = program.parts();
        let upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
                       Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==";
        let wrong = "f".repeat(32);
        for (token, host, origin) in [
            (&wrong, host.as_str(), format!("http://{host}")),
            (&token, host.as_str(), "http://evil.example".to_owned()),
            (&token, "evil.example", "http://evil.example".to_owned()),
            (&token, host.as_str(), "null".to_owned()),
        ] {
            let line = format!("GET /{token}/socket HTTP/1.1");
            let answer = program.ask(&[&line, &format!("Host: {host}"), &format!("Origin: {origin}"), upgrade]);
            assert_eq!(status(&answer), "403", "{host} {origin}");
        }
    });
}

/// Beyond 127.0.0.1 nobody is heard unless that was asked for. 127.0.0.2 is this computer too, by another address.
#[cfg(target_os = "linux")]
#[test]
fn other_addresses_are_for_those_who_ask() {
    let dir = tempfile::tempdir().unwrap();
    let path = scene(dir.path());
    let asked = |program: &Program, at: &str, host: &str, token: &str| {
        let port = program.parts().0.rsplit(':').next().unwrap().to_owned();
        let stream = Program::connect_to(&format!("{at}:{port}"));
        let line = format!("GET /{token}/ HTTP/1.1");
        status(&Program::ask_at(stream, &[&line, &format!("Host: {host}:{port}")])).to_owned()
    };
    let usual = Program::start(&path, &[]);
    let (host, token) = usual.parts();
    assert!(TcpStream::connect(host.replace("127.0.0.1", "127.0.0.2")).is_err());
    assert_eq!(asked(&usual, "127.0.0.1", "127.0.0.2", &token), "403");

    let all = Program::start(&path, &["--listen", "0.0.0.0"]);
    let (host, token) = all.parts();
    assert!(host.starts_with("127.0.0.1:"), "{host}");
    for (at, host, token, wanted) in [
        ("127.0.0.2", "127.0.0.2", token.as_str(), "200"),
        ("127.0.0.1", "localhost", &token, "200"),
        ("127.0.0.2", "127.0.0.3", &token, "403"),
        ("127.0.0.2", "viewer.example", &token, "403"),
        ("127.0.0.2", "127.0.0.2", &"0".repeat(32), "403"),
    ] {
        assert_eq!(asked(&all, at, host, token), wanted, "{host} at {at}");
    }

    let one = Program::start(&path, &["--listen", "127.0.0.2"]);
    let (host, _) = one.parts();
    assert!(host.starts_with("127.0.0.2:"), "{host}");
    assert!(TcpStream::connect(host.replace("127.0.0.2", "127.0.0.1")).is_err());
    let mut page = one.page();
    page.text("scene");
    // An address of documents (RFC 5737), which no computer has.
    let elsewhere = Command::new(env!("CARGO_BIN_EXE_splatblur"))
        .args(["view", "--listen", "192.0.2.1"])
        .arg(&path)
        .output()
        .unwrap();
    let words = String::from_utf8_lossy(&elsewhere.stderr).into_owned();
    assert!(!elsewhere.status.success() && words.contains("cannot listen on 192.0.2.1:0"), "{words}");
}

#[test]
fn a_message_of_100_megabytes_ends_its_page() {
    beside(|program| {
        let before = program.memory();
        let mut page = program.page();
        // The program may end the connection before all is sent.
        let _ = page.socket.send(Message::text("x".repeat(100 << 20)));
        let why = page.end();
        assert!(why.contains("too long") || why.contains("reset") || why.contains("Broken pipe"), "{why}");
        // Measured: 0.3 MB.
        assert!(program.memory() < before + (16 << 20), "{} bytes before, {} after", before, program.memory());
    });
}

#[test]
fn ten_thousand_messages_a_second_end_their_page() {
    beside(|program| {
        let mut page = program.page();
        let begin = Instant::now();
        for _ in 0..10_000 {
            page.say(&json!({ "type": "shown", "picture": 0 }));
        }
        let why = page.end();
        assert!(begin.elapsed() < PATIENCE);
        assert!(why.contains("too many messages") || why.contains("reset") || why.contains("Broken pipe"), "{why}");
    });
}

#[test]
fn what_a_page_should_not_say_is_answered_in_a_line() {
    beside(|program| {
        let mut page = program.page();
        page.text("scene");
        let mut refused = |changes: serde_json::Value, word: &str| {
            page.see(changes);
            let message = page.text("refused")["message"].to_string();
            assert!(message.contains(word) && !message.contains('\n'), "{message}");
        };
        refused(json!({ "mode": "supersmaple:4" }), "supersmaple");
        refused(json!({ "mode": "supersample:99999999" }), "65536");
        refused(json!({ "width": 0 }), "0 x 72");
        refused(json!({ "width": 8000, "height": 8000 }), "8000 x 8000");
        refused(json!({ "frame": 1e300 }), "no frame");
        refused(json!({ "buffer": "secrets" }), "secrets");
        refused(json!({ "backend": "/dev/null" }), "backend");
        refused(json!({ "prefilter": "blur" }), "blur");
        refused(json!({ "shutter": { "open": 1, "close": 0, "weight": null } }), "closes");
        refused(json!({ "shutter": { "open": 0, "close": 1, "weight": "gaussian:width=0" } }), "width");
        for (readout, word) in [("-1", "frames from 0"), ("1e9", "frames from 0"), ("1,sideways", "sideways")] {
            refused(json!({ "shutter": { "open": 0, "close": 1, "readout": readout } }), word);
        }
        let eye = [1.0, 2.0, 3.0];
        refused(json!({ "camera": { "eye": eye, "at": eye, "up": [0, 1, 0], "fovy": 40 } }), "eye");
        refused(json!({ "camera": { "eye": eye, "at": [0, 0, 0], "up": eye, "fovy": 40 } }), "up");
        refused(json!({ "camera": { "eye": eye, "at": [0, 0, 0], "up": [0, 1, 0], "fovy": 180 } }), "fovy");
        for turn in [json!([0, 0, 0, 0]), json!([1e200, 0, 0, 1])] {
            refused(json!({ "lights": { "turn": turn } }), "quaternion");
        }
        refused(json!({ "file": "/etc/passwd" }), "file");
        for message in [json!(null), json!([]), json!({ "type": "open" }), json!({ "type": "save", "what": "all" })] {
            page.say(&message);
            page.text("refused");
        }
        page.socket.send(Message::text("{")).unwrap();
        page.text("refused");
        // It goes on all the same.
        let serial = page.see(json!({}));
        page.finished(serial);
        page.socket.send(Message::binary(vec![0; 9])).unwrap();
        assert!(page.end().contains("text"));
    });
}

// Not deep: it waits for a deadline of 5 s, and takes little of the processor.
#[test]
fn half_open_connections_do_not_keep_others_out() {
    beside(|program| {
        let half: Vec<TcpStream> = (0..200)
            .map(|i| {
                let mut stream = program.connect();
                // Some say nothing at all.
                if i % 2 == 0 {
                    let _ = stream.write_all(b"GET / HTTP/1.1\r\nHost: ");
                }
                stream
            })
            .collect();
        let (host, token) = program.parts();
        let begin = Instant::now();
        let answer = program.ask(&[&format!("GET /{token}/ HTTP/1.1"), &format!("Host: {host}")]);
        assert_eq!(status(&answer), "200");
        assert!(begin.elapsed() < Duration::from_secs(4), "{:?}", begin.elapsed());
        // Those for which there is no room are ended at once, and all after the deadline of 5 s.
        for (number, mut stream) in half.into_iter().enumerate() {
            let mut bytes = Vec::new();
            let _ = stream.read_to_end(&mut bytes);
            assert!(bytes.is_empty());
            assert!(number > 150 || begin.elapsed() < Duration::from_secs(4), "{number}: {:?}", begin.elapsed());
        }
        assert!(begin.elapsed() < PATIENCE);
    });
}

// Not deep: it waits for pages, and takes little of the processor.
#[test]
fn a_page_that_never_reads_gets_one_picture_and_holds_nobody_up() {
    beside(|program| {
        let before = program.memory();
        let mut pages: Vec<Page> = (0..4).map(|_| program.page()).collect();
        for frame in 0..200 {
            for page in &mut pages {
                page.see(json!({ "frame": frame % 12, "moving": true, "mode": "still:1" }));
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        // Measured: 3 MB, of four small pages.
        assert!(program.memory() < before + (64 << 20), "{} bytes before, {} after", before, program.memory());
        for page in &mut pages {
            let mut pictures = 0;
            page.socket.get_ref().set_read_timeout(Some(Duration::from_secs(1))).unwrap();
            // Reads, but never says that a picture was shown.
            loop {
                match page.listen() {
                    Heard::Picture(..) => pictures += 1,
                    Heard::Text(_) => {}
                    Heard::End(_) => break,
                }
            }
            assert_eq!(pictures, 1);
        }
    });
}

#[test]
fn few_files_wait_to_be_saved() {
    let mut visit = Visit::new();
    visit.page.see(json!({ "mode": "supersample:65536", "width": 640, "height": 480 }));
    for _ in 0..100 {
        visit.page.say(&json!({ "type": "save", "what": "scene" }));
    }
    // What was asked for in vain does not count.
    visit.page.say(&json!({ "type": "save", "what": "all" }));
    visit.page.text("refused");
    visit.page.see(json!({}));
    visit.page.text("rests");
    assert_eq!(std::fs::read_dir(&visit.out).unwrap().count(), 8);
}

#[test]
fn more_pages_than_eight_are_refused() {
    beside(|program| {
        let pages: Vec<Page> = (0..7).map(|_| program.page()).collect();
        let (host, token) = program.parts();
        let answer = program.ask(&[
            &format!("GET /{token}/socket HTTP/1.1"),
            &format!("Host: {host}"),
            &format!("Origin: http://{host}"),
            "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13",
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        ]);
        assert_eq!(status(&answer), "503");
        drop(pages);
        // Their places are free when their threads have ended.
        std::thread::sleep(Duration::from_secs(2));
    });
}
