//! What a client is answered.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read as _, Write};
use std::sync::Arc;

use super::Request;

/// An answer.
pub struct Response {
    status: &'static str,
    kind: &'static str,
    headers: Vec<(&'static str, String)>,
    body: Body,
    /// Whether the body is left out, though its length is stated: the answer to HEAD.
    head_only: bool,
}

enum Body {
    Text(Arc<String>),
    Static(&'static str),
    /// This many bytes of a file.
    File(File, u64),
}

impl Response {
    fn new(status: &'static str, kind: &'static str, body: Body) -> Self {
        Self { status, kind, headers: Vec::new(), body, head_only: false }
    }

    /// Plain text with another status than 200.
    pub fn plain(status: &'static str, text: impl Into<String>) -> Self {
        Self::new(status, "text/plain; charset=utf-8", Body::Text(Arc::new(text.into())))
    }

    /// A page.
    pub fn page(text: Arc<String>) -> Self {
        Self::new("200 OK", "text/html; charset=utf-8", Body::Text(text))
    }

    /// JSON.
    pub fn json(text: String) -> Self {
        Self::new("200 OK", "application/json; charset=utf-8", Body::Text(Arc::new(text)))
    }

    /// A part of the program.
    pub fn embedded(kind: &'static str, text: &'static str) -> Self {
        Self::new("200 OK", kind, Body::Static(text))
    }

    /// A file as it is now.
    pub fn file(kind: &'static str, file: File) -> io::Result<Self> {
        let length = file.metadata()?.len();
        Ok(Self::new("200 OK", kind, Body::File(file, length)))
    }

    /// With a header; its value must not come from outside.
    #[must_use]
    pub fn with(mut self, name: &'static str, value: impl Into<String>) -> Self {
        self.headers.push((name, value.into()));
        self
    }

    /// Without its body where `request` asks for the head alone.
    #[must_use]
    pub fn to(mut self, request: &Request) -> Self {
        self.head_only = request.method == "HEAD";
        self
    }

    /// Its status code and reason.
    #[cfg(test)]
    pub fn status(&self) -> &'static str {
        self.status
    }

    /// Writes it.
    ///
    /// # Errors
    /// The client has gone.
    pub fn send(self, stream: &mut impl Write) -> io::Result<()> {
        let length = match &self.body {
            Body::Text(text) => text.len() as u64,
            Body::Static(text) => text.len() as u64,
            Body::File(_, length) => *length,
        };
        let mut head = format!(
            "HTTP/1.1 {}\r\nContent-Type: {}\r\nContent-Length: {length}\r\n\
             X-Content-Type-Options: nosniff\r\nConnection: close\r\n",
            self.status, self.kind
        );
        for (name, value) in &self.headers {
            let _ = write!(head, "{name}: {value}\r\n");
        }
        if !self.headers.iter().any(|(name, _)| *name == "Cache-Control") {
            head.push_str("Cache-Control: no-store\r\n");
        }
        head.push_str("\r\n");
        stream.write_all(head.as_bytes())?;
        if self.head_only {
            return Ok(());
        }
        match self.body {
            Body::Text(text) => stream.write_all(text.as_bytes()),
            Body::Static(text) => stream.write_all(text.as_bytes()),
            Body::File(file, length) => io::copy(&mut file.take(length), stream).map(|_| ()),
        }
    }
}
