//! Why the viewer cannot start.

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Why the viewer cannot start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewerError {
    /// The port is taken or may not be used, or the address is none of this computer.
    #[error("cannot listen on {address}")]
    Listen {
        /// The address that was asked for; port 0: any.
        address: SocketAddr,
        /// Why.
        source: io::Error,
    },
    /// The system gives no random bytes.
    #[error("the system gives no random bytes for the token of the address: {what}")]
    Random {
        /// What the system says.
        what: String,
    },
    /// The file of the token cannot be read or made.
    #[error("cannot read or make the token file {}", path.display())]
    TokenFile {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file of the token holds something else.
    #[error("{} holds no token: expected 32 hexadecimal digits; remove it, and a new one is made", path.display())]
    Token {
        /// The file.
        path: PathBuf,
    },
}
