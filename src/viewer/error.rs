//! Why the viewer cannot start.

use std::io;
use std::path::PathBuf;

/// Why the viewer cannot start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewerError {
    /// The port is taken, or may not be used.
    #[error("cannot listen on 127.0.0.1:{port}")]
    Listen {
        /// The port that was asked for; 0: any.
        port: u16,
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
