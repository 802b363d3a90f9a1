//! The WebSocket of a page. One thread reads, one writes, one renders.
//!
//! Both directions have a WebSocket of their own over the same connection, so that neither waits for the other.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use tungstenite::protocol::frame::CloseFrame;
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Error, Message, WebSocket};

use super::super::message::Sent;
use super::super::session::{Page, Worker};
use super::super::shared::Shared;

/// Longest message of a page, bytes: a view takes about 600.
const LONGEST: usize = 1 << 16;
/// Most messages of a page in a second. It sends one for each picture of the screen.
const MOST_MESSAGES: u32 = 500;
/// Time between two signs of life that are asked for.
const PING: Duration = Duration::from_secs(20);
/// Time without a sign of life after which a page has gone.
const SILENCE: Duration = Duration::from_mins(1);
/// What may wait to be written: pictures come one by one, text is short.
const QUEUE: usize = 64;

/// What the writer is given.
enum Out {
    Sent(Sent),
    Pong(Vec<u8>),
    /// The last: why the connection ends.
    Close(CloseCode, &'static str),
}

/// Serves a page until it has gone.
pub(super) fn serve(shared: &Arc<Shared>, page: &Arc<Page>, stream: &TcpStream, accept: &str, rest: Vec<u8>) {
    let head = format!(
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Accept: {accept}\r\n\r\n"
    );
    let mut answer = stream;
    let begun = answer.write_all(head.as_bytes()).and_then(|()| stream.set_read_timeout(Some(SILENCE)));
    let (Ok(()), Ok(reading), Ok(writing)) = (begun, stream.try_clone(), stream.try_clone()) else { return };
    let (out, queue) = sync_channel(QUEUE);
    thread::scope(|scope| {
        scope.spawn(move || {
            write(writing, &queue);
            page.close();
        });
        let replies = out.clone();
        scope.spawn(move || {
            let last = read(reading, rest, page, &replies);
            // A full queue is that of a page that does not read.
            let _ = replies.try_send(last);
            page.close();
        });
        let send = |sent| out.try_send(Out::Sent(sent)).is_ok();
        if !Worker::new(shared, page, &send).run() {
            // The page takes nothing any more: this ends the writer and the reader.
            let _ = stream.shutdown(Shutdown::Both);
        }
        drop(out);
    });
}

/// Reads messages until the page has gone or does what it should not; returns the end of the conversation.
fn read(stream: TcpStream, rest: Vec<u8>, page: &Page, replies: &SyncSender<Out>) -> Out {
    let config = WebSocketConfig::default()
        .read_buffer_size(LONGEST)
        .max_message_size(Some(LONGEST))
        .max_frame_size(Some(LONGEST));
    let mut socket = WebSocket::from_partially_read(Reading(stream), rest, Role::Server, Some(config));
    let mut second = (Instant::now(), 0);
    loop {
        let message = match socket.read() {
            Ok(message) => message,
            Err(Error::Capacity(_)) => return Out::Close(CloseCode::Size, "a message is too long"),
            Err(_) => return Out::Close(CloseCode::Protocol, "the connection ends"),
        };
        if second.0.elapsed() > Duration::from_secs(1) {
            second = (Instant::now(), 0);
        }
        second.1 += 1;
        if second.1 > MOST_MESSAGES {
            return Out::Close(CloseCode::Policy, "too many messages");
        }
        match message {
            Message::Text(text) => page.hear(&text),
            Message::Ping(bytes) => {
                let _ = replies.try_send(Out::Pong(bytes.to_vec()));
            }
            Message::Binary(_) => return Out::Close(CloseCode::Unsupported, "messages are text"),
            Message::Close(_) => return Out::Close(CloseCode::Normal, ""),
            Message::Pong(_) | Message::Frame(_) => {}
        }
    }
}

/// Writes what is given until the last of it, or until the page takes nothing any more.
fn write(stream: TcpStream, queue: &Receiver<Out>) {
    let Ok(ending) = stream.try_clone() else { return };
    let mut socket = WebSocket::from_raw_socket(Writing(stream), Role::Server, None);
    loop {
        let message = match queue.recv_timeout(PING) {
            Ok(Out::Sent(Sent::Text(text))) => Message::text(text),
            Ok(Out::Sent(Sent::Picture(bytes))) => Message::binary(bytes),
            Ok(Out::Pong(bytes)) => Message::Pong(bytes.into()),
            Ok(Out::Close(code, reason)) => Message::Close(Some(CloseFrame { code, reason: reason.into() })),
            Err(RecvTimeoutError::Timeout) => Message::Ping(Vec::new().into()),
            Err(RecvTimeoutError::Disconnected) => break,
        };
        let is_last = matches!(message, Message::Close(_));
        if socket.send(message).is_err() || is_last {
            break;
        }
    }
    // Ends the reader too.
    let _ = ending.shutdown(Shutdown::Both);
}

/// The half of a connection that is read. What its WebSocket would answer by itself is the other half's.
struct Reading(TcpStream);

impl Read for Reading {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.read(buffer)
    }
}

impl Write for Reading {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The half of a connection that is written.
struct Writing(TcpStream);

impl Read for Writing {
    fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
        Err(io::ErrorKind::WouldBlock.into())
    }
}

impl Write for Writing {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}
