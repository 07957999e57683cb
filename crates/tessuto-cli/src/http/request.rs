//! What a client asks.

use std::io::Read;
use std::time::{Duration, Instant};

/// Longest request head that is read [bytes], and most headers in it.
const LONGEST_HEAD: usize = 16 << 10;
const MOST_HEADERS: usize = 64;
/// A head that has not come by then is not waited for, however steadily it drips.
const HEAD_WITHIN: Duration = Duration::from_secs(10);

/// The head of a request, and what came of its body with it.
#[derive(Debug)]
pub struct Request {
    pub method: String,
    /// Before the question mark.
    pub path: String,
    /// After it.
    pub query: String,
    headers: Vec<(String, String)>,
    begun: Vec<u8>,
}

/// Why a body is not read.
#[derive(Debug, PartialEq, Eq)]
pub enum BodyError {
    /// Its length is missing.
    NoLength,
    /// It is longer than it may be.
    TooLong,
    /// It took too long, or the client has gone.
    Stalled,
}

impl Request {
    /// Reads the head; `None` if it is none.
    pub fn read(stream: &mut impl Read) -> Option<Self> {
        let started = Instant::now();
        let (mut bytes, mut buffer) = (Vec::new(), [0; 4096]);
        loop {
            let count = stream.read(&mut buffer).ok().filter(|n| *n > 0)?;
            bytes.extend_from_slice(&buffer[..count]);
            if bytes.len() > LONGEST_HEAD + buffer.len() || started.elapsed() > HEAD_WITHIN {
                return None;
            }
            let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
            let mut head = httparse::Request::new(&mut headers);
            let httparse::Status::Complete(length) = head.parse(&bytes).ok()? else { continue };
            let (method, target) = (head.method?.to_owned(), head.path?);
            let (path, query) = target.split_once('?').unwrap_or((target, ""));
            let (path, query) = (path.to_owned(), query.to_owned());
            let text = |value: &[u8]| String::from_utf8(value.to_vec()).ok();
            let headers = head
                .headers
                .iter()
                .map(|h| Some((h.name.to_owned(), text(h.value)?)))
                .collect::<Option<_>>()?;
            return Some(Self { method, path, query, headers, begun: bytes.split_off(length) });
        }
    }

    /// The value of a header; `Err` if it comes more than once, which no browser does with those asked for here.
    pub fn header(&self, name: &str) -> Result<Option<&str>, ()> {
        let mut found = self.headers.iter().filter(|(known, _)| known.eq_ignore_ascii_case(name));
        let first = found.next().map(|(_, value)| value.as_str());
        if found.next().is_some() { Err(()) } else { Ok(first) }
    }

    /// The value of a part `key=value` of the query, decoded.
    pub fn query(&self, key: &str) -> Option<String> {
        let value = self.query.split('&').filter_map(|p| p.split_once('=')).find(|(k, _)| *k == key);
        value.and_then(|(_, v)| decoded(v))
    }

    /// Hands the body to `take`, piece by piece: `longest` bytes at most, `within` that time.
    ///
    /// # Errors
    /// [`BodyError`]; of an unfinished body some pieces may have been handed over.
    pub fn body(
        &mut self,
        stream: &mut impl Read,
        longest: u64,
        within: Duration,
        mut take: impl FnMut(&[u8]) -> std::io::Result<()>,
    ) -> Result<std::io::Result<()>, BodyError> {
        let started = Instant::now();
        let coded = self.header("transfer-encoding") != Ok(None);
        let length = self.header("content-length").ok().flatten().and_then(|v| v.parse::<u64>().ok());
        let Some(length) = length.filter(|_| !coded) else { return Err(BodyError::NoLength) };
        if length > longest {
            return Err(BodyError::TooLong);
        }
        let mut rest = length;
        let mut piece = std::mem::take(&mut self.begun);
        let mut buffer = vec![0; 64 << 10];
        loop {
            piece.truncate(usize::try_from(rest).unwrap_or(usize::MAX));
            rest -= piece.len() as u64;
            if let Err(e) = take(&piece) {
                return Ok(Err(e));
            }
            if rest == 0 {
                return Ok(Ok(()));
            }
            let count = stream.read(&mut buffer).ok().filter(|n| *n > 0).ok_or(BodyError::Stalled)?;
            if started.elapsed() > within {
                return Err(BodyError::Stalled);
            }
            piece.clear();
            piece.extend_from_slice(&buffer[..count]);
        }
    }
}

/// Text with `%XX` in it; `None` if it is malformed.
pub fn decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let [first, tail @ ..] = rest {
        rest = tail;
        bytes.push(match first {
            b'%' => {
                let (digits, tail) = rest.split_at_checked(2)?;
                rest = tail;
                let digits =
                    std::str::from_utf8(digits).ok().filter(|d| d.bytes().all(|c| c.is_ascii_hexdigit()))?;
                u8::from_str_radix(digits, 16).ok()?
            }
            other => *other,
        });
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Option<Request> {
        Request::read(&mut text.as_bytes())
    }

    #[test]
    fn heads_are_read_or_refused() {
        let request =
            read("GET /a/b?x=1&name=a%20%C3%BC HTTP/1.1\r\nHost: h\r\nhost: g\r\nOrigin: o\r\n\r\n").unwrap();
        assert_eq!((request.method.as_str(), request.path.as_str()), ("GET", "/a/b"));
        assert_eq!(request.query("name").unwrap(), "a ü");
        assert_eq!((request.header("origin"), request.header("host")), (Ok(Some("o")), Err(())));
        let endless = format!("GET / HTTP/1.1\r\nA: {}\r\n\r\n", "a".repeat(40_000));
        let many = format!("GET / HTTP/1.1\r\n{}\r\n", "A: a\r\n".repeat(100));
        for bad in ["", "GET", "GET / HTTP/1.1\r\n", "\u{0}\r\n\r\n", &endless, &many] {
            assert!(read(bad).is_none(), "{}", &bad[..bad.len().min(30)]);
        }
        for bad in ["%", "%1", "%zz", "%+1", "%ff"] {
            assert!(decoded(bad).is_none(), "{bad}");
        }
    }

    #[test]
    fn bodies_have_a_length_and_a_limit() {
        let body = |text: &str, longest| {
            let mut stream = text.as_bytes();
            let mut request = Request::read(&mut stream).unwrap();
            let mut bytes = Vec::new();
            let took = request.body(&mut stream, longest, Duration::from_secs(9), |piece| {
                bytes.extend_from_slice(piece);
                Ok(())
            });
            took.map(|done| done.map(|()| String::from_utf8(bytes).unwrap()).unwrap())
        };
        let head = |length: &str| format!("POST / HTTP/1.1\r\nContent-Length: {length}\r\n\r\nabcdef");
        assert_eq!(body(&head("4"), 4).unwrap(), "abcd");
        assert_eq!(body(&head("6"), 5), Err(BodyError::TooLong));
        assert_eq!(body(&head("7"), 9), Err(BodyError::Stalled));
        for none in ["-1", "x", "99999999999999999999999"] {
            assert_eq!(body(&head(none), 9), Err(BodyError::NoLength));
        }
        let chunked = "POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\nContent-Length: 2\r\n\r\nab";
        assert_eq!(body(chunked, 9), Err(BodyError::NoLength));
    }
}
