//! Cuts a `.anim` file into words, braces and ends of statements; handles quotes and comments.

use std::path::Path;

use crate::anim::error::{AnimError, AnimLocation};

/// A token of the text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Token<'a> {
    Word(Word<'a>),
    Open,
    Close,
    /// `;` or the end of a line: both end a statement, as Maya reads one key a line.
    End,
    Eof,
}

/// A word, without its quotes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Word<'a> {
    pub(super) text: &'a str,
    pub(super) quoted: bool,
}

/// Longest text that a message quotes from the file, characters.
const QUOTED_LENGTH: usize = 40;

/// Most words kept of one statement. No statement needs more, and a hostile line may be the whole file.
const MAX_WORDS: usize = 64;

/// Reads tokens of a text, with one token of look-ahead.
pub(super) struct Words<'a> {
    path: &'a Path,
    text: &'a str,
    position: usize,
    line: usize,
    peeked: Option<Token<'a>>,
    /// Line of the token that was last taken or peeked at.
    token_line: usize,
}

impl<'a> Words<'a> {
    pub(super) fn new(text: &'a str, path: &'a Path) -> Self {
        Self { path, text, position: 0, line: 1, peeked: None, token_line: 1 }
    }

    pub(super) fn at(&self) -> AnimLocation {
        AnimLocation { path: self.path.to_owned(), line: self.token_line }
    }

    /// The error "found this token, expected ..." at the last token.
    pub(super) fn expected(&self, found: Token<'_>, expected: &'static str) -> AnimError {
        let found = match found {
            Token::Word(word) => format!("`{}`", shortened(word.text)),
            Token::Open => "`{`".to_owned(),
            Token::Close => "`}`".to_owned(),
            Token::End => "the end of the statement".to_owned(),
            Token::Eof => "the end of the file".to_owned(),
        };
        AnimError::Expected { at: self.at(), found, expected }
    }

    pub(super) fn peek(&mut self) -> Result<Token<'a>, AnimError> {
        if let Some(token) = self.peeked {
            return Ok(token);
        }
        let token = self.scan()?;
        self.peeked = Some(token);
        Ok(token)
    }

    pub(super) fn take(&mut self) -> Result<Token<'a>, AnimError> {
        let token = self.peek()?;
        self.peeked = None;
        Ok(token)
    }

    /// Takes the next token that does not end a statement.
    pub(super) fn take_solid(&mut self) -> Result<Token<'a>, AnimError> {
        loop {
            match self.take()? {
                Token::End => {}
                token => return Ok(token),
            }
        }
    }

    /// Appends the words up to the end of the statement to `words`. A brace also ends the statement, and is not taken.
    pub(super) fn statement(&mut self, words: &mut Vec<Word<'a>>) -> Result<(), AnimError> {
        while let Token::Word(word) = self.peek()? {
            self.peeked = None;
            if words.len() < MAX_WORDS {
                words.push(word);
            }
        }
        Ok(())
    }

    /// Takes the first word of a statement such as `weighted 0;` and skips the others.
    pub(super) fn value(&mut self, expected: &'static str) -> Result<&'a str, AnimError> {
        match self.peek()? {
            Token::Word(word) => {
                self.statement(&mut Vec::new())?;
                Ok(word.text)
            }
            token => Err(self.expected(token, expected)),
        }
    }

    /// Skips the rest of a block, its closing brace included. The opening brace has been taken.
    pub(super) fn skip_block(&mut self) -> Result<(), AnimError> {
        let mut depth = 1_usize;
        while depth > 0 {
            match self.take()? {
                Token::Open => depth += 1,
                Token::Close => depth -= 1,
                token @ Token::Eof => return Err(self.expected(token, "`}`")),
                _ => {}
            }
        }
        Ok(())
    }

    /// A finite number of magnitude 1e30 or less.
    pub(super) fn number(&self, word: &str) -> Result<f64, AnimError> {
        let found = || shortened(word);
        if word.contains(',') {
            return Err(AnimError::Comma { at: self.at(), found: found() });
        }
        match word.parse::<f64>() {
            Ok(number) if number.abs() <= 1e30 => Ok(number),
            Ok(_) => Err(AnimError::NotFinite { at: self.at(), found: found() }),
            // Old Microsoft libraries write 1.#INF and -1.#IND.
            Err(_) if word.contains('#') => Err(AnimError::NotFinite { at: self.at(), found: found() }),
            Err(_) => Err(AnimError::Expected { at: self.at(), found: format!("`{}`", found()), expected: "a number" }),
        }
    }

    fn scan(&mut self) -> Result<Token<'a>, AnimError> {
        let bytes = self.text.as_bytes();
        while let Some(&byte) = bytes.get(self.position) {
            self.token_line = self.line;
            match byte {
                b'\n' | b'\r' => {
                    // The \r of CRLF is white space; a \r alone ends a line.
                    if byte == b'\n' || bytes.get(self.position + 1) != Some(&b'\n') {
                        self.position += 1;
                        self.line += 1;
                        return Ok(Token::End);
                    }
                    self.position += 1;
                }
                // Maya's reader also skips the line after a single slash.
                b'#' | b'/' => self.skip_line(),
                b';' => return Ok(self.single(Token::End)),
                b'{' => return Ok(self.single(Token::Open)),
                b'}' => return Ok(self.single(Token::Close)),
                b'"' => return self.quoted(),
                _ if is_blank(byte) => self.position += 1,
                _ => return Ok(self.bare()),
            }
        }
        self.token_line = self.line;
        Ok(Token::Eof)
    }

    fn single(&mut self, token: Token<'a>) -> Token<'a> {
        self.position += 1;
        token
    }

    fn skip_line(&mut self) {
        let rest = &self.text.as_bytes()[self.position..];
        self.position += rest.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(rest.len());
    }

    fn quoted(&mut self) -> Result<Token<'a>, AnimError> {
        let start = self.position + 1;
        let rest = &self.text.as_bytes()[start..];
        let length = rest.iter().position(|b| matches!(b, b'"' | b'\n' | b'\r')).unwrap_or(rest.len());
        let text = &self.text[start..start + length];
        if rest.get(length) != Some(&b'"') {
            let found = format!("`\"{}`", shortened(text));
            return Err(AnimError::Expected { at: self.at(), found, expected: "a closing quote on the same line" });
        }
        self.position = start + length + 1;
        Ok(Token::Word(Word { text, quoted: true }))
    }

    fn bare(&mut self) -> Token<'a> {
        let rest = &self.text.as_bytes()[self.position..];
        let ends = |i: usize| match rest[i] {
            b'\n' | b'\r' | b';' | b'{' | b'}' | b'"' => true,
            // A comment may directly follow a word. But `1.#INF` is one bad number, not a 1 with a comment.
            b'#' => i == 0 || rest[i - 1] != b'.',
            b'/' => rest.get(i + 1) == Some(&b'/'),
            byte => is_blank(byte),
        };
        let length = (0..rest.len()).find(|&i| ends(i)).unwrap_or(rest.len());
        let start = self.position;
        self.position += length;
        Token::Word(Word { text: &self.text[start..self.position], quoted: false })
    }
}

fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | 0x0b | 0x0c)
}

/// The beginning of a text, short enough for a message.
pub(super) fn shortened(text: &str) -> String {
    match text.char_indices().nth(QUOTED_LENGTH) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tokens as text, with their lines.
    fn tokens(text: &str) -> Vec<(String, usize)> {
        let mut words = Words::new(text, Path::new("t.anim"));
        let mut found = Vec::new();
        loop {
            let token = words.take().expect("valid text");
            let text = match token {
                Token::Word(word) if word.quoted => format!("\"{}\"", word.text),
                Token::Word(word) => word.text.to_owned(),
                Token::Open => "{".to_owned(),
                Token::Close => "}".to_owned(),
                Token::End => ";".to_owned(),
                Token::Eof => return found,
            };
            found.push((text, words.at().line));
        }
    }

    fn line(text: &str) -> String {
        tokens(text).iter().map(|(t, _)| t.as_str()).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn words_braces_and_ends() {
        assert_eq!(line("anim a.b\tb  c 0 1 0; x{y}"), "anim a.b b c 0 1 0 ; x { y }");
        assert_eq!(line("|grp|ns:ball \"a ; { b\"c"), "|grp|ns:ball \"a ; { b\" c");
    }

    #[test]
    fn comments_anywhere() {
        assert_eq!(line("# a ; {\nb # c\nd// e\n/ f\ng#h"), "; b ; d ; ; g");
        assert_eq!(line("a/b 1.#INF \"x # y // z\""), "a/b 1.#INF \"x # y // z\"");
    }

    #[test]
    fn every_kind_of_line_end_counts_once() {
        let expected = [("a", 1), (";", 1), ("b", 2), (";", 2), ("c", 3), (";", 3), ("d", 4)];
        let expected: Vec<(String, usize)> = expected.iter().map(|&(t, l)| (t.to_owned(), l)).collect();
        for end in ["\n", "\r\n", "\r"] {
            assert_eq!(tokens(&["a", "b", "c", "d"].join(end)), expected, "{end:?}");
        }
    }

    #[test]
    fn quotes_end_on_their_line() {
        for text in ["a \"b", "a \"b\nc\""] {
            let mut words = Words::new(text, Path::new("t.anim"));
            words.take().expect("a word");
            let error = words.take().expect_err("open quote").to_string();
            assert_eq!(error, "t.anim:1: found `\"b`, expected a closing quote on the same line");
        }
    }

    #[test]
    fn numbers() {
        let words = Words::new("", Path::new("t.anim"));
        for (text, value) in
            [("-.5", -0.5), ("+6.0", 6.0), ("1e+01", 10.0), ("5.", 5.0), ("-1E-3", -1e-3), ("1e30", 1e30)]
        {
            assert_eq!(words.number(text).expect("a number"), value);
        }
        let message = |text: &str| words.number(text).expect_err("no number").to_string();
        for text in ["inf", "-nan", "NaN", "1e999", "1.0e31", "1.#INF", "-1.#IND"] {
            assert!(message(text).contains("expected a finite number"), "{text}");
        }
        for text in ["1,234.567", "0,5"] {
            assert!(message(text).contains("comma may separate thousands or decimals"), "{text}");
        }
        for text in ["", "x", "1.2.3", "0x10", "1_000"] {
            assert!(message(text).contains("expected a number"), "{text}");
        }
        assert!(message(&"9x".repeat(1000)).len() < 200);
    }
}
