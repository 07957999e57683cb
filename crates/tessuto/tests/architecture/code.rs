//! What of a source file is code.

/// `text` without comments, strings and the test module at its end.
pub fn code(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let skipped = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").map_or(rest.len(), |end| end + 2)
        } else if let Some(raw) = rest.strip_prefix("r\"") {
            raw.find('"').map_or(rest.len(), |end| end + 3)
        } else if rest.starts_with("r#\"") {
            rest.find("\"#").map_or(rest.len(), |end| end + 2)
        } else if first == '"' {
            string_length(rest)
        } else if rest.starts_with("'\"'") || rest.starts_with("b'\"'") {
            rest.find("\"'").map_or(rest.len(), |end| end + 2)
        } else {
            0
        };
        if skipped == 0 {
            out.push(first);
            rest = &rest[first.len_utf8()..];
        } else {
            rest = &rest[skipped..];
        }
    }
    let tests = out.match_indices("#[cfg(test)]").find(|(at, mark)| {
        let next = out[at + mark.len()..].trim_start().lines().next().unwrap_or_default();
        next.contains("mod ") && next.contains('{')
    });
    if let Some((at, _)) = tests {
        out.truncate(at);
    }
    out
}

/// Bytes of the string literal that `text` starts with.
fn string_length(text: &str) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => return at + 1,
            _ => {}
        }
    }
    text.len()
}

#[test]
fn comments_strings_and_tests_are_no_code() {
    let text = "//! a\n/// [`b`]\nconst S: &str = \"c \\\" d\"; // e\nconst Q: char = '\"'; fn f() { g() }\n\
                #[cfg(test)]\nmod tests { use h; }";
    let left = code(text);
    let left: Vec<&str> = left.split_whitespace().collect();
    let expected =
        ["const", "S:", "&str", "=", ";", "const", "Q:", "char", "=", ";", "fn", "f()", "{", "g()", "}"];
    assert_eq!(left, expected);
}
