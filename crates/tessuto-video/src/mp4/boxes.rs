//! Boxes: a size, a kind of four letters, a content.

use std::io::SeekFrom;

use crate::bytes::Bytes;
use crate::refused::{Refused, damaged};
use crate::source::Source;

/// Most boxes inside of one.
const MOST: usize = 100_000;

/// Kind of a box.
pub(crate) type Kind = [u8; 4];

/// The kind as it is written in documents.
pub(crate) fn name(kind: Kind) -> String {
    kind.iter().map(|&b| if b.is_ascii_graphic() { char::from(b) } else { '?' }).collect()
}

/// The boxes inside of `content`.
pub(crate) fn boxes(content: &[u8]) -> Result<Vec<(Kind, &[u8])>, Refused> {
    let mut bytes = Bytes::new(content, "a box");
    let mut found = Vec::new();
    // QuickTime ends some lists by a size of 0.
    while bytes.rest.len() >= 8 {
        let whole = bytes.rest;
        let mut size = u64::from(bytes.u32()?);
        let kind: Kind = bytes.take(4)?.try_into().expect("four bytes");
        let mut head = 8;
        if size == 1 {
            size = bytes.u64()?;
            head = 16;
        }
        if size == 0 {
            break;
        }
        if size < head || size > whole.len() as u64 {
            return damaged(format!("box {} says {size} bytes where {} are left", name(kind), whole.len()));
        }
        found.push((kind, &whole[head as usize..size as usize]));
        if found.len() > MOST {
            return damaged(format!("a box of more than {MOST} others"));
        }
        bytes.rest = &whole[size as usize..];
    }
    Ok(found)
}

/// The first box of a kind inside of `content`.
pub(crate) fn child<'a>(content: &'a [u8], wanted: &Kind) -> Result<Option<&'a [u8]>, Refused> {
    Ok(boxes(content)?.into_iter().find(|(kind, _)| kind == wanted).map(|(_, content)| content))
}

/// The first box of a kind, which must be there.
pub(crate) fn needed<'a>(content: &'a [u8], wanted: &Kind) -> Result<&'a [u8], Refused> {
    match child(content, wanted)? {
        Some(content) => Ok(content),
        None => damaged(format!("box {} is missing", name(*wanted))),
    }
}

/// Version and flags, and what follows them.
pub(crate) fn full<'a>(content: &'a [u8], what: &'a str) -> Result<(u8, u32, Bytes<'a>), Refused> {
    let mut bytes = Bytes::new(content, what);
    let word = bytes.u32()?;
    Ok(((word >> 24) as u8, word & 0xFF_FFFF, bytes))
}

/// A box of the file itself.
pub(crate) struct TopBox {
    pub(crate) kind: Kind,
    /// First byte of the box.
    pub(crate) start: u64,
    /// First byte of its content.
    pub(crate) content: u64,
    /// First byte behind it.
    pub(crate) end: u64,
}

/// The boxes of a file, which are passed over without being read. One that says more than the file has ends with
/// the file: what is missing is found where it is used.
pub(crate) fn of_file(file: &mut dyn Source, length: u64, most: usize) -> Result<Vec<TopBox>, Refused> {
    let mut found = Vec::new();
    let mut start = 0;
    while start + 8 <= length {
        file.seek(SeekFrom::Start(start))?;
        let mut head = [0; 16];
        file.read_exact(&mut head[..8])?;
        let kind: Kind = head[4..8].try_into().expect("four bytes");
        let mut size = u64::from(u32::from_be_bytes(head[..4].try_into().expect("four bytes")));
        let mut content = start + 8;
        if size == 1 && start + 16 <= length {
            file.read_exact(&mut head[8..])?;
            size = u64::from_be_bytes(head[8..].try_into().expect("eight bytes"));
            content = start + 16;
        }
        let end = if size == 0 { length } else { start.saturating_add(size) };
        if end < content {
            return damaged(format!("box {} at byte {start} says {size} bytes", name(kind)));
        }
        found.push(TopBox { kind, start, content, end: end.min(length) });
        if found.len() > most {
            return damaged(format!("more than {most} boxes"));
        }
        start = end;
    }
    Ok(found)
}

/// The content of a box of the file; at most what the file has.
pub(crate) fn content(file: &mut dyn Source, top: &TopBox, most: u64) -> Result<Vec<u8>, Refused> {
    let size = top.end - top.content;
    if size > most {
        return damaged(format!("box {} of {size} bytes; up to {most} are read", name(top.kind)));
    }
    file.seek(SeekFrom::Start(top.content))?;
    let mut bytes = vec![0; size as usize];
    file.read_exact(&mut bytes)?;
    Ok(bytes)
}
