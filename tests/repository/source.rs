//! As much of Rust's grammar as it takes to see what a file imports: words, paths, `use` trees, and what is test code.

/// A word or a punctuation mark, with its line (from 1).
#[derive(Clone, Debug)]
pub(crate) struct Token {
    pub line: usize,
    pub text: String,
}

impl Token {
    fn is(&self, text: &str) -> bool {
        self.text == text
    }

    fn is_word(&self) -> bool {
        self.text.starts_with(|c: char| c.is_alphabetic() || c == '_')
    }
}

/// The tokens of a file without comments, literals and test code.
pub(crate) fn tokens(source: &str) -> Vec<Token> {
    without_tests(&lex(source))
}

/// Words, `::` and single marks. Comments, strings, characters and lifetimes leave nothing.
fn lex(source: &str) -> Vec<Token> {
    let text: Vec<char> = source.chars().collect();
    let (mut out, mut at, mut line) = (Vec::new(), 0, 1);
    let starts = |at: usize, with: &str| with.chars().enumerate().all(|(i, c)| text.get(at + i) == Some(&c));
    while at < text.len() {
        let start = at;
        if starts(at, "//") {
            at += text[at..].iter().position(|&c| c == '\n').unwrap_or(text.len() - at);
        } else if starts(at, "/*") {
            let mut depth = 0;
            loop {
                if starts(at, "/*") {
                    (depth, at) = (depth + 1, at + 2);
                } else if starts(at, "*/") {
                    (depth, at) = (depth - 1, at + 2);
                } else {
                    at += 1;
                }
                if depth == 0 || at >= text.len() {
                    break;
                }
            }
        } else if let Some(hashes) = raw_string(&text[at..]) {
            let end: String = std::iter::once('"').chain(std::iter::repeat_n('#', hashes)).collect();
            at += text[at..].iter().position(|&c| c == '"').unwrap_or(0) + 1;
            while at < text.len() && !starts(at, &end) {
                at += 1;
            }
            at += end.len();
        } else if text[at] == '"' {
            at += 1;
            while at < text.len() && text[at] != '"' {
                at += if text[at] == '\\' { 2 } else { 1 };
            }
            at += 1;
        } else if text[at] == '\'' {
            // A character ends with a quote, a lifetime does not.
            at += match (text.get(at + 1), text.get(at + 2)) {
                (Some('\\'), _) => 3 + text[at + 3..].iter().position(|&c| c == '\'').unwrap_or(0) + 1,
                (_, Some('\'')) => 3,
                _ => 1,
            };
        } else if text[at].is_alphanumeric() || text[at] == '_' {
            while at < text.len() && (text[at].is_alphanumeric() || text[at] == '_') {
                at += 1;
            }
            out.push(Token { line, text: text[start..at].iter().collect() });
        } else if starts(at, "::") {
            at += 2;
            out.push(Token { line, text: "::".into() });
        } else {
            at += 1;
            if !text[start].is_whitespace() {
                out.push(Token { line, text: text[start].into() });
            }
        }
        line += text[start..at.min(text.len())].iter().filter(|&&c| c == '\n').count();
    }
    out
}

/// The number of `#` of a raw string that begins here.
fn raw_string(text: &[char]) -> Option<usize> {
    let rest = text.strip_prefix(&['b']).unwrap_or(text).strip_prefix(&['r'])?;
    let hashes = rest.iter().take_while(|&&c| c == '#').count();
    (rest.get(hashes) == Some(&'"')).then_some(hashes)
}

/// Leaves out each item under an attribute `#[cfg(test)]`, or another `cfg` that names `test` and not `not`.
fn without_tests(tokens: &[Token]) -> Vec<Token> {
    let (mut out, mut at) = (Vec::new(), 0);
    while at < tokens.len() {
        if tokens[at].is("#") && tokens.get(at + 1).is_some_and(|t| t.is("[")) {
            let end = closing(tokens, at + 1);
            let words = &tokens[at + 2..end];
            let test = words.first().is_some_and(|t| t.is("cfg"))
                && words.iter().any(|t| t.is("test"))
                && !words.iter().any(|t| t.is("not"));
            if test {
                at = item_end(tokens, end + 1);
                continue;
            }
            at = end + 1;
            continue;
        }
        out.push(tokens[at].clone());
        at += 1;
    }
    out
}

/// The token that closes the bracket at `open`.
fn closing(tokens: &[Token], open: usize) -> usize {
    let mut depth = 0;
    for (at, token) in tokens.iter().enumerate().skip(open) {
        match token.text.as_str() {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => {
                depth -= 1;
                if depth == 0 {
                    return at;
                }
            }
            _ => {}
        }
    }
    tokens.len()
}

/// Behind an item: behind its `;` or its body.
fn item_end(tokens: &[Token], mut at: usize) -> usize {
    let mut in_use = false;
    while at < tokens.len() {
        match tokens[at].text.as_str() {
            ";" | "," => return at + 1,
            "use" => {
                in_use = true;
                at += 1;
            }
            "{" if !in_use => return closing(tokens, at) + 1,
            "(" | "[" | "{" => at = closing(tokens, at) + 1,
            _ => at += 1,
        }
    }
    at
}

/// A path that a file writes, in words, as it stands there.
#[derive(Clone, Debug)]
pub(crate) struct Written {
    pub line: usize,
    pub path: Vec<String>,
    /// The name under which a `use` makes it known in its file; none for a path in an expression or a type.
    pub name: Option<String>,
}

/// All paths of two words and more; those of `use` trees leaf by leaf.
pub(crate) fn paths(tokens: &[Token]) -> Vec<Written> {
    let (mut out, mut at) = (Vec::new(), 0);
    while at < tokens.len() {
        if tokens[at].is("use") {
            let end = at + tokens[at..].iter().position(|t| t.is(";")).unwrap_or(tokens.len() - at);
            use_tree(&tokens[at + 1..end], &[], &mut out);
            at = end;
        } else if tokens[at].is_word() && tokens.get(at + 1).is_some_and(|t| t.is("::")) {
            let (line, mut path) = (tokens[at].line, vec![tokens[at].text.clone()]);
            while tokens.get(at + 1).is_some_and(|t| t.is("::")) && tokens.get(at + 2).is_some_and(Token::is_word) {
                path.push(tokens[at + 2].text.clone());
                at += 2;
            }
            out.push(Written { line, path, name: None });
        }
        at += 1;
    }
    out
}

fn use_tree(tokens: &[Token], prefix: &[String], out: &mut Vec<Written>) {
    let mut at = 0;
    while at < tokens.len() {
        let line = tokens[at].line;
        let mut path = prefix.to_vec();
        while at < tokens.len() && !tokens[at].is(",") && !tokens[at].is("{") && !tokens[at].is("as") {
            if tokens[at].is_word() || tokens[at].is("*") {
                path.push(tokens[at].text.clone());
            }
            at += 1;
        }
        if tokens.get(at).is_some_and(|t| t.is("{")) {
            let end = closing(tokens, at);
            use_tree(&tokens[at + 1..end], &path, out);
            at = end + 1;
        } else {
            // `use a::{self}` names a.
            if path.len() > 1 && path.last().is_some_and(|word| word == "self") {
                path.pop();
            }
            let mut name = path.last().cloned();
            if tokens.get(at).is_some_and(|t| t.is("as")) {
                name = tokens.get(at + 1).map(|t| t.text.clone());
                at += 2;
            }
            out.push(Written { line, path, name });
        }
        at += 1;
    }
}

/// The names of `mod name;` in their order.
pub(crate) fn modules(tokens: &[Token]) -> Vec<String> {
    let is_module = |w: &&[Token]| w[0].is("mod") && w[1].is_word() && w[2].is(";");
    tokens.windows(3).filter(is_module).map(|w| w[1].text.clone()).collect()
}
