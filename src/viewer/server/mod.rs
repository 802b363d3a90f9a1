//! The viewer on an address of this computer: HTTP for the page, and a WebSocket for each page.
//!
//! The needs are small: four files that are in the program, and an upgrade. So requests are read here, with `httparse`,
//! under a deadline and a bound on their length, and `tungstenite` speaks the WebSocket. An HTTP library of threads
//! (`tiny_http`) would wait without end for requests that stay half open.

mod request;
mod socket;
mod token;

use std::io::Write as _;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use std::{io, thread};

use self::request::{Refused, Request, Resource};
use self::token::Token;
use super::error::ViewerError;
use super::session::Page;
use super::shared::{Listener, Setup, Shared};
use crate::scene_file::LoadedScene;

/// Connections whose request is being read. The oldest goes when one more comes.
const MOST_WAITING: usize = 32;
/// Time in which an answer must be taken.
const WRITE: Duration = Duration::from_secs(10);

/// The viewer of a scene.
pub struct Viewer {
    shared: Arc<Shared>,
    listener: TcpListener,
    address: SocketAddr,
    token: Arc<Token>,
}

impl Viewer {
    /// Listens on an address of this computer; all who can reach it are kept out by the token alone, which travels
    /// unencrypted. Port 0 is any free one. The token is a new one, or that of `token_file`, which is made where it is
    /// missing.
    ///
    /// # Errors
    /// The port is taken, the address is none of this computer, there are no random bytes, or the file of the token
    /// cannot be used.
    pub fn open(setup: Setup, address: SocketAddr, token_file: Option<&Path>) -> Result<Self, ViewerError> {
        let token = Arc::new(token_file.map_or_else(Token::new, Token::of_file)?);
        let refused = |source| ViewerError::Listen { address, source };
        let listener = TcpListener::bind(address).map_err(refused)?;
        let address = listener.local_addr().unwrap_or(address);
        Ok(Self { shared: Arc::new(Shared::new(setup)), listener, address, token })
    }

    /// The address to open in a browser. Who knows it may use the viewer.
    pub fn link(&self) -> String {
        let ip = match self.address.ip() {
            IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
            IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
            ip => ip,
        };
        format!("http://{}/{}/", SocketAddr::new(ip, self.address.port()), self.token)
    }

    /// Held while a file is written: whoever holds it may end the program.
    pub fn gate(&self) -> Arc<Mutex<()>> {
        Arc::clone(&self.shared.saving)
    }

    /// Serves pages, and reads the scene with `load` now and whenever one of its files changes. Does not return.
    pub fn run(self, mut load: impl FnMut() -> Result<LoadedScene, String>) -> ! {
        let Self { shared, listener, token, .. } = self;
        let server = Arc::new(Server { shared: Arc::clone(&shared), token, waiting: Mutex::default() });
        thread::spawn(move || server.accept(&listener));
        shared.watch(&mut load)
    }
}

struct Server {
    shared: Arc<Shared>,
    token: Arc<Token>,
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
        let (Ok(request), Ok(()), Ok(own)) = (request, set_up, stream.local_addr()) else { return };
        let resource = request.and_then(|request| request.resource(&self.token, own.ip().to_canonical()));
        match resource {
            Ok(Resource::Socket { accept, rest }) => self.page(stream, &accept, rest),
            Ok(Resource::File { kind, text }) => send(stream, "200 OK", kind, text),
            Err(refused) => send(stream, refused.status(), "text/plain; charset=utf-8", refused.why()),
        }
    }

    /// Serves a page until it has gone.
    fn page(&self, stream: &TcpStream, accept: &str, rest: Vec<u8>) {
        let page = Arc::new(Page::default());
        if let Some(_seat) = self.shared.seat(Arc::clone(&page) as Arc<dyn Listener>) {
            socket::serve(&self.shared, &page, stream, accept, rest);
        } else {
            let refused = Refused::TooMany;
            send(stream, refused.status(), "text/plain; charset=utf-8", refused.why());
        }
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
