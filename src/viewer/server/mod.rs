//! The viewer on the loopback address: HTTP for the page, and a WebSocket for each page.
//!
//! The needs are small: four files that are in the program, and an upgrade. So requests are read here, with `httparse`,
//! under a deadline and a bound on their length, and `tungstenite` speaks the WebSocket. An HTTP library of threads
//! (`tiny_http`) would wait without end for requests that stay half open.

mod request;
mod socket;
mod token;

use std::io::Write as _;
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use std::{io, thread};

use self::request::{Refused, Request, Resource};
use self::token::Token;
use super::error::ViewerError;
use super::watch::{Setup, Shared};
use crate::scene_file::Loaded;

/// Connections whose request is being read. The oldest goes when one more comes.
const MOST_WAITING: usize = 32;
/// Pages at a time.
const MOST_PAGES: usize = 8;
/// Time in which an answer must be taken.
const WRITE: Duration = Duration::from_secs(10);

/// The viewer of a scene.
pub struct Viewer {
    shared: Arc<Shared>,
    listener: TcpListener,
    port: u16,
    token: Arc<Token>,
}

impl Viewer {
    /// Listens on the loopback address. Port 0 is any free one. The token is a new one, or that of `token_file`, which
    /// is made where it is missing.
    ///
    /// # Errors
    /// The port is taken, there are no random bytes, or the file of the token cannot be used.
    pub fn open(setup: Setup, port: u16, token_file: Option<&Path>) -> Result<Self, ViewerError> {
        let token = Arc::new(token_file.map_or_else(Token::new, Token::of_file)?);
        let refused = |source| ViewerError::Listen { port, source };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(refused)?;
        let port = listener.local_addr().as_ref().map_or(port, SocketAddr::port);
        Ok(Self { shared: Arc::new(Shared::new(setup)), listener, port, token })
    }

    /// The address to open in a browser. Who knows it may use the viewer.
    pub fn link(&self) -> String {
        format!("http://127.0.0.1:{}/{}/", self.port, self.token)
    }

    /// Held while a file is written: whoever holds it may end the program.
    pub fn gate(&self) -> Arc<Mutex<()>> {
        Arc::clone(&self.shared.saving)
    }

    /// Serves pages, and reads the scene with `load` now and whenever one of its files changes. Does not return.
    pub fn run(self, mut load: impl FnMut() -> Result<Loaded, String>) -> ! {
        let Self { shared, listener, token, .. } = self;
        let server = Arc::new(Server {
            shared: Arc::clone(&shared),
            token,
            pages: AtomicUsize::new(0),
            waiting: Mutex::default(),
        });
        thread::spawn(move || server.accept(&listener));
        shared.watch(&mut load)
    }
}

struct Server {
    shared: Arc<Shared>,
    token: Arc<Token>,
    /// Pages that are open.
    pages: AtomicUsize,
    /// Connections whose request is being read, oldest first.
    waiting: Mutex<Vec<(u64, TcpStream)>>,
}

impl Server {
    fn accept(self: &Arc<Self>, listener: &TcpListener) {
        for number in 0.. {
            let Ok((stream, _)) = listener.accept() else {
                // As where no more files may be open: others must close first.
                thread::sleep(Duration::from_millis(50));
                continue;
            };
            let Ok(again) = stream.try_clone() else { continue };
            {
                let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
                if waiting.len() >= MOST_WAITING {
                    let (_, oldest) = waiting.remove(0);
                    // It may be gone already.
                    let _ = oldest.shutdown(Shutdown::Both);
                }
                waiting.push((number, again));
            }
            let server = Arc::clone(self);
            // Without a thread the connection is closed.
            let _ = thread::Builder::new().spawn(move || server.answer(number, &stream));
        }
    }

    /// Reads a request and answers it.
    fn answer(&self, number: u64, stream: &TcpStream) {
        let request = Request::read(stream);
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner).retain(|(other, _)| *other != number);
        let set_up = stream.set_write_timeout(Some(WRITE)).and_then(|()| stream.set_nodelay(true));
        let Ok(request) = request.and_then(|request| set_up.map(|()| request)) else { return };
        let resource = request.as_ref().map_err(|refused| *refused).and_then(|request| request.resource(&self.token));
        match resource {
            Ok(Resource::Socket { accept, rest }) => self.page(stream, &accept, rest),
            Ok(Resource::File { kind, text }) => send(stream, "200 OK", kind, text),
            Err(refused) => send(stream, refused.status(), "text/plain; charset=utf-8", refused.why()),
        }
    }

    /// Serves a page until it has gone.
    fn page(&self, stream: &TcpStream, accept: &str, rest: Vec<u8>) {
        if self.pages.fetch_add(1, Ordering::Relaxed) < MOST_PAGES {
            socket::serve(&self.shared, stream, accept, rest);
        } else {
            let refused = Refused::TooMany;
            send(stream, refused.status(), "text/plain; charset=utf-8", refused.why());
        }
        self.pages.fetch_sub(1, Ordering::Relaxed);
    }
}

/// An answer, after which the connection is closed.
fn send(mut stream: &TcpStream, status: &str, kind: &str, text: &str) {
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\n\
         Cache-Control: no-store\r\nReferrer-Policy: no-referrer\r\nX-Content-Type-Options: nosniff\r\n\
         Cross-Origin-Resource-Policy: same-origin\r\nCross-Origin-Opener-Policy: same-origin\r\n\
         Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; img-src blob: data:; \
         connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n\r\n",
        text.len()
    );
    let sent: io::Result<()> = stream
        .write_all(head.as_bytes())
        .and_then(|()| stream.write_all(text.as_bytes()))
        .and_then(|()| stream.flush());
    // Nobody waits for it where it failed.
    if sent.is_ok() {
        let _ = stream.shutdown(Shutdown::Write);
    }
}
