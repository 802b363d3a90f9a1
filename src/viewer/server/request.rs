//! Requests: read under a deadline, and refused unless they come from the viewer's own page.

use std::io::{self, Read as _};
use std::net::{IpAddr, TcpStream};
use std::time::{Duration, Instant};

use super::token::Token;

/// Time in which a request must be there.
const DEADLINE: Duration = Duration::from_secs(5);
/// Longest head of a request, bytes.
const LONGEST: usize = 16 << 10;
/// Most header fields of a request.
const MOST_FIELDS: usize = 64;

/// The files of the page: name, type, content.
const FILES: [(&str, &str, &str); 6] = [
    ("", "text/html; charset=utf-8", include_str!("../page/index.html")),
    ("style.css", "text/css; charset=utf-8", include_str!("../page/style.css")),
    ("main.js", "text/javascript; charset=utf-8", include_str!("../page/main.js")),
    ("camera.js", "text/javascript; charset=utf-8", include_str!("../page/camera.js")),
    ("keys.js", "text/javascript; charset=utf-8", include_str!("../page/keys.js")),
    ("canvas.js", "text/javascript; charset=utf-8", include_str!("../page/canvas.js")),
];

/// The resource that is asked for.
#[derive(Debug, PartialEq)]
pub(super) enum Resource {
    /// A file of the page.
    File { kind: &'static str, text: &'static str },
    /// The WebSocket: the answer to its key, and what came after the request.
    Socket { accept: String, rest: Vec<u8> },
}

/// Why a request is refused. The answers do not tell what would be right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Refused {
    Malformed,
    Method,
    Host,
    Origin,
    Token,
    Missing,
    Upgrade,
    TooMany,
}

impl Refused {
    pub(super) const fn status(self) -> &'static str {
        match self {
            Self::Malformed => "400 Bad Request",
            Self::Method => "405 Method Not Allowed",
            Self::Host | Self::Origin | Self::Token => "403 Forbidden",
            Self::Missing => "404 Not Found",
            Self::Upgrade => "426 Upgrade Required",
            Self::TooMany => "503 Service Unavailable",
        }
    }

    pub(super) const fn why(self) -> &'static str {
        match self {
            Self::Malformed => "no request of HTTP/1.1\n",
            Self::Method => "only GET is served\n",
            Self::Host => "wrong host\n",
            Self::Origin => "wrong origin\n",
            Self::Token => "wrong token: open the link that `splatblur view` prints\n",
            Self::Missing => "there is no such file\n",
            Self::Upgrade => "a WebSocket (version 13) is served here\n",
            Self::TooMany => "too many pages are open: close one\n",
        }
    }
}

/// The parts of a request that are looked at.
#[derive(Debug, Default)]
pub(super) struct Request {
    path: String,
    host: Option<String>,
    origin: Option<String>,
    upgrade: bool,
    key: Option<String>,
    rest: Vec<u8>,
}

impl Request {
    /// Reads a request. The inner error is answered.
    ///
    /// # Errors
    /// The connection ends, or the deadline passes before all is there.
    pub(super) fn read(mut stream: &TcpStream) -> io::Result<Result<Self, Refused>> {
        let end = Instant::now() + DEADLINE;
        let mut bytes = Vec::new();
        let mut buffer = [0; 2048];
        loop {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(io::ErrorKind::TimedOut.into());
            }
            stream.set_read_timeout(Some(left))?;
            let count = stream.read(&mut buffer)?;
            if count == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            bytes.extend(&buffer[..count]);
            if let Some(request) = Self::parse(&bytes) {
                return Ok(request);
            }
            if bytes.len() > LONGEST {
                return Ok(Err(Refused::Malformed));
            }
        }
    }

    /// The request, once it is whole.
    fn parse(bytes: &[u8]) -> Option<Result<Self, Refused>> {
        let mut fields = [httparse::EMPTY_HEADER; MOST_FIELDS];
        let mut parsed = httparse::Request::new(&mut fields);
        let length = match parsed.parse(bytes) {
            Ok(httparse::Status::Complete(length)) => length,
            Ok(httparse::Status::Partial) => return None,
            Err(_) => return Some(Err(Refused::Malformed)),
        };
        if parsed.method != Some("GET") {
            return Some(Err(Refused::Method));
        }
        let mut request = Self { rest: bytes[length..].to_vec(), ..Self::default() };
        parsed.path.unwrap_or_default().clone_into(&mut request.path);
        let [mut upgrade, mut connection, mut version] = [false; 3];
        for field in parsed.headers.iter() {
            let Ok(value) = std::str::from_utf8(field.value) else { continue };
            let has = |word: &str| value.split(',').any(|part| part.trim().eq_ignore_ascii_case(word));
            let once = |place: &mut Option<String>| place.replace(value.to_owned()).is_some();
            let twice = match &*field.name.to_ascii_lowercase() {
                "host" => once(&mut request.host),
                "origin" => once(&mut request.origin),
                "sec-websocket-key" => once(&mut request.key),
                "upgrade" => std::mem::replace(&mut upgrade, has("websocket")),
                "connection" => {
                    connection |= has("upgrade");
                    false
                }
                "sec-websocket-version" => std::mem::replace(&mut version, value.trim() == "13"),
                _ => false,
            };
            if twice {
                return Some(Err(Refused::Malformed));
            }
        }
        request.upgrade = upgrade && connection && version;
        Some(Ok(request))
    }

    /// The resource that is asked for at the address `own` of this computer, if it may be had.
    pub(super) fn resource(&self, token: &Token, own: IpAddr) -> Result<Resource, Refused> {
        let host = self.host.as_deref().filter(|host| is_here(host, own)).ok_or(Refused::Host)?;
        let own = |origin: &String| origin.strip_prefix("http://") == Some(host);
        if self.origin.as_ref().is_some_and(|origin| !own(origin)) {
            return Err(Refused::Origin);
        }
        let path = self.path.strip_prefix('/').unwrap_or_default();
        let (given, name) = path.split_once('/').ok_or(Refused::Token)?;
        if !token.is(given) {
            return Err(Refused::Token);
        }
        if name == "socket" {
            // Browsers always send it here.
            self.origin.as_ref().ok_or(Refused::Origin)?;
            let key = self.key.as_ref().filter(|_| self.upgrade).ok_or(Refused::Upgrade)?;
            let accept = tungstenite::handshake::derive_accept_key(key.as_bytes());
            return Ok(Resource::Socket { accept, rest: self.rest.clone() });
        }
        let file = FILES.iter().find(|(known, _, _)| *known == name);
        file.map(|&(_, kind, text)| Resource::File { kind, text }).ok_or(Refused::Missing)
    }
}

/// This computer by its local names or by the address `own` that was connected to, with any port: a tunnel has another
/// one than we. Names that others can choose are refused, though they may lead here.
fn is_here(host: &str, own: IpAddr) -> bool {
    let own = if own.is_ipv6() { format!("[{own}]") } else { own.to_string() };
    ["localhost", "127.0.0.1", "[::1]", &own].iter().any(|known| {
        let Some(rest) = host.strip_prefix(known) else { return false };
        rest.is_empty() || rest.strip_prefix(':').is_some_and(|port| port.parse::<u16>().is_ok())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(token: &Token, path: &str, fields: &str) -> Result<Resource, Refused> {
        let text = format!("GET {path} HTTP/1.1\r\n{fields}\r\n");
        Request::parse(text.as_bytes()).unwrap().and_then(|request| request.resource(token, LOOPBACK))
    }

    const LOOPBACK: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

    #[test]
    fn the_address_that_was_connected_to_is_here() {
        let [lan, other, six]: [IpAddr; 3] = ["192.168.1.5", "192.168.1.55", "fe80::1"].map(|ip| ip.parse().unwrap());
        for (host, own, wanted) in [
            ("192.168.1.5:8000", lan, true),
            ("192.168.1.5", lan, true),
            ("localhost:8000", lan, true),
            ("[fe80::1]:8000", six, true),
            ("192.168.1.55:8000", lan, false),
            ("192.168.1.5:8000", other, false),
            ("192.168.1.5:8000", LOOPBACK, false),
            ("viewer.example:8000", lan, false),
            ("fe80::1", six, false),
        ] {
            assert_eq!(is_here(host, own), wanted, "{host} at {own}");
        }
    }

    #[test]
    fn only_the_own_page_is_served() {
        let token = Token::new().ok().unwrap();
        let page = format!("/{token}/");
        for host in ["localhost", "localhost:8000", "127.0.0.1:1", "[::1]:65535"] {
            let fields = format!("Host: {host}\r\n");
            assert!(matches!(answer(&token, &page, &fields), Ok(Resource::File { .. })), "{host}");
            let fields = format!("Host: {host}\r\nOrigin: http://{host}\r\n");
            assert!(answer(&token, &page, &fields).is_ok(), "{host}");
        }
        for host in
            ["evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "localhost:x", "::1", "0.0.0.0"]
        {
            assert_eq!(answer(&token, &page, &format!("Host: {host}\r\n")), Err(Refused::Host), "{host}");
        }
        assert_eq!(answer(&token, &page, ""), Err(Refused::Host));
        let twice = "Host: localhost\r\nHost: localhost\r\n";
        assert_eq!(answer(&token, &page, twice), Err(Refused::Malformed));
        for origin in ["http://evil.example", "https://localhost:5", "http://localhost", "http://127.0.0.1:5", "null"] {
            let fields = format!("Host: localhost:5\r\nOrigin: {origin}\r\n");
            assert_eq!(answer(&token, &page, &fields), Err(Refused::Origin), "{origin}");
        }
        let host = "Host: localhost\r\n";
        for path in ["/", "/0/", "//", "/socket", "", &format!("/{token}"), &format!("{page}0").to_uppercase()] {
            let refused = answer(&token, path, host);
            assert!(matches!(refused, Err(Refused::Token | Refused::Malformed)), "{path}: {refused:?}");
        }
        for name in ["../Cargo.toml", "x", "style.css/", "%2e%2e"] {
            assert_eq!(answer(&token, &format!("{page}{name}"), host), Err(Refused::Missing), "{name}");
        }
    }

    #[test]
    fn a_socket_needs_all_its_fields() {
        let token = Token::new().ok().unwrap();
        let path = format!("/{token}/socket");
        let fields = [
            "Host: localhost:5",
            "Origin: http://localhost:5",
            "Upgrade: websocket",
            "Connection: keep-alive, Upgrade",
            "Sec-WebSocket-Version: 13",
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        ];
        let join = |fields: &[&str]| fields.iter().flat_map(|field| [field, "\r\n"]).collect::<String>();
        // The example of RFC 6455.
        let accept = "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=".to_owned();
        assert_eq!(answer(&token, &path, &join(&fields)), Ok(Resource::Socket { accept, rest: Vec::new() }));
        for missing in 0..fields.len() {
            let mut fewer = fields.to_vec();
            fewer.remove(missing);
            assert!(answer(&token, &path, &join(&fewer)).is_err(), "without {}", fields[missing]);
        }
    }

    #[test]
    fn what_is_no_request_is_refused() {
        assert!(Request::parse(b"GET / HTTP/1.1\r\nHost: a\r\n").is_none());
        for bytes in [&b"\x16\x03\x01\x02\0"[..], b"GET\r\n\r\n", b"POST / HTTP/1.1\r\nHost: localhost\r\n\r\n"] {
            assert!(Request::parse(bytes).unwrap().is_err(), "{bytes:?}");
        }
        let many = "A: b\r\n".repeat(MOST_FIELDS + 1);
        assert!(Request::parse(format!("GET / HTTP/1.1\r\n{many}\r\n").as_bytes()).unwrap().is_err());
    }
}
