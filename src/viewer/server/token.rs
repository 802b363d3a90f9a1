//! The secret in the address: who does not know it is refused.

use std::fmt;
use std::fs::OpenOptions;
use std::io::{self, Write as _};
use std::path::Path;

use rand::TryRng as _;
use rand::rngs::SysRng;

use super::super::error::ViewerError;
use crate::files::{self, InputError};

/// Random bytes of a token.
const BYTES: usize = 16;

/// Most bytes of the file of a token, blanks around it included.
const MOST_BYTES: u64 = 1 << 12;

/// 32 hexadecimal digits.
#[derive(Clone, PartialEq, Eq)]
pub(super) struct Token(String);

impl Token {
    /// A new one.
    pub(super) fn new() -> Result<Self, ViewerError> {
        let mut bytes = [0; BYTES];
        SysRng.try_fill_bytes(&mut bytes).map_err(|why| ViewerError::Random { what: why.to_string() })?;
        Ok(Self(format!("{:032x}", u128::from_be_bytes(bytes))))
    }

    /// The token of a file. Where the file is missing it is made, for this user alone.
    pub(super) fn of_file(path: &Path) -> Result<Self, ViewerError> {
        let failed = |source| ViewerError::TokenFile { path: path.to_owned(), source };
        match files::read(path, MOST_BYTES) {
            Ok(bytes) => {
                let text = String::from_utf8_lossy(&bytes);
                let text = text.trim();
                let is_token = text.len() == 2 * BYTES && text.bytes().all(|b| b.is_ascii_hexdigit());
                is_token.then(|| Self(text.to_owned())).ok_or_else(|| ViewerError::Token { path: path.to_owned() })
            }
            Err(InputError::Io(why)) if why.kind() == io::ErrorKind::NotFound => {
                let token = Self::new()?;
                let mut options = OpenOptions::new();
                options.write(true).create_new(true);
                #[cfg(unix)]
                std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
                let written = options.open(path).and_then(|mut file| writeln!(file, "{token}"));
                written.map_err(failed)?;
                Ok(token)
            }
            Err(why) => Err(failed(why.into())),
        }
    }

    /// Is it this text? The time does not tell how much of it is right.
    pub(super) fn is(&self, text: &str) -> bool {
        let different = self.0.bytes().zip(text.bytes()).fold(0, |different, (a, b)| different | (a ^ b));
        text.len() == self.0.len() && different == 0
    }
}

impl fmt::Display for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn tokens_differ_and_know_themselves() {
        let [a, b] = [Token::new().ok().unwrap(), Token::new().ok().unwrap()];
        assert!(a != b && a.0.len() == 32);
        assert!(a.is(&a.to_string()));
        let mut other = a.to_string();
        other.replace_range(31.., if other.ends_with('0') { "1" } else { "0" });
        assert!(!a.is(&other) && !a.is("") && !a.is(&a.0[..31]) && !a.is(&format!("{a}0")));
    }

    #[test]
    fn a_file_keeps_its_token() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("token");
        let token = Token::of_file(&path).ok().unwrap();
        assert!(Token::of_file(&path).is_ok_and(|again| again == token));
        fs::write(&path, "short").unwrap();
        assert!(matches!(Token::of_file(&path), Err(ViewerError::Token { .. })));
        #[cfg(unix)]
        {
            fs::remove_file(&path).unwrap();
            Token::of_file(&path).ok().unwrap();
            let mode = std::os::unix::fs::PermissionsExt::mode(&fs::metadata(&path).unwrap().permissions());
            assert_eq!(mode & 0o777, 0o600);
        }
    }
}
