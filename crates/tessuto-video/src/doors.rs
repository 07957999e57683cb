//! What is not opened at all: what is no file, and lists of other files.

use std::fs::{File, Metadata};
use std::io::Read;
use std::path::Path;

use crate::refusal::Refusal;

/// Beginnings, in small letters, of files that name other files: HLS, ffmpeg's concat, DASH, PLS, ASX, SMIL,
/// RealMedia and QuickTime references, SDP.
const LISTS: [(&str, &str); 13] = [
    ("#extm3u", "a playlist (m3u8)"),
    ("#extinf", "a playlist (m3u8)"),
    ("ffconcat", "a list of files for ffmpeg (ffconcat)"),
    ("file '", "a list of files for ffmpeg (ffconcat)"),
    ("<?xml", "XML, as playlists are"),
    ("<mpd", "a playlist (MPD)"),
    ("<asx", "a playlist (ASX)"),
    ("<smil", "a playlist (SMIL)"),
    ("[playlist]", "a playlist (PLS)"),
    ("[reference]", "a playlist (ASF reference)"),
    ("rtsptext", "a reference to another film"),
    ("rtsp://", "a reference to another film"),
    ("v=0", "a description of a stream (SDP)"),
];
/// This many bytes are enough to know a list.
const HEAD: u64 = 64;

/// Refuses what is no file of its own, such as a pipe, which can be read only once and may never come to an end.
/// Folders pass: who wants a file says so.
///
/// # Errors
/// [`Refusal`] naming what is there. A path at which nothing is passes as well.
pub fn expect_file(path: &Path) -> Result<(), Refusal> {
    // What is open already has names in folders of the system; behind them may be anything, and it may have been
    // read in part.
    let is_open_already =
        ["/dev/stdin", "/dev/fd/", "/proc/self/fd/"].iter().any(|door| path.starts_with(door));
    let Ok(metadata) = std::fs::metadata(path) else {
        return if is_open_already { Err(no_file("a pipe")) } else { Ok(()) };
    };
    match kind(&metadata) {
        Some(kind) => Err(no_file(kind)),
        None if is_open_already && metadata.is_file() => Err(no_file("what another program has open")),
        None => Ok(()),
    }
}

fn no_file(kind: &str) -> Refusal {
    Refusal::new(format!("is {kind}"), "save it as a file first, and name that")
}

#[cfg(unix)]
fn kind(metadata: &Metadata) -> Option<&'static str> {
    use std::os::unix::fs::FileTypeExt as _;
    let kind = metadata.file_type();
    if kind.is_fifo() {
        Some("a pipe")
    } else if kind.is_socket() {
        Some("a socket")
    } else if kind.is_char_device() || kind.is_block_device() {
        Some("a device")
    } else {
        None
    }
}

#[cfg(not(unix))]
fn kind(metadata: &Metadata) -> Option<&'static str> {
    (!metadata.is_file() && !metadata.is_dir()).then_some("no file")
}

/// Refuses a list of other files by its first bytes: nothing outside of the named file is to be opened.
///
/// # Errors
/// [`Refusal`] naming the kind of list, or why the file cannot be read.
pub(crate) fn expect_no_list(path: &Path) -> Result<(), Refusal> {
    let unreadable = |e| Refusal::new(format!("cannot be read: {e}"), "check the path and its permissions");
    let mut head = Vec::new();
    File::open(path).map_err(unreadable)?.take(HEAD).read_to_end(&mut head).map_err(unreadable)?;
    match list(&head) {
        None => Ok(()),
        Some(kind) => Err(Refusal::new(
            format!("is no film, but {kind}; other files are not opened"),
            "name the film itself; a list of parts is made one film by ffmpeg -i LIST -c copy FILM.mkv",
        )),
    }
}

fn list(head: &[u8]) -> Option<&'static str> {
    let text = head.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(head).trim_ascii_start().to_ascii_lowercase();
    LISTS.iter().find(|(beginning, _)| text.starts_with(beginning.as_bytes())).map(|(_, kind)| *kind)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_known_by_their_beginnings() {
        for head in [
            &b"#EXTM3U\n"[..],
            b"\xEF\xBB\xBF\n #extm3u",
            b"ffconcat version 1.0",
            b"<?xml version",
            b"v=0\r\n",
        ] {
            assert!(list(head).is_some(), "{}", String::from_utf8_lossy(head));
        }
        for head in [&b"\0\0\0\x20ftypisom"[..], b"\x1A\x45\xDF\xA3", b"GIF89a", b"", b"\x47\x40\x00\x10"] {
            assert!(list(head).is_none());
        }
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_file_is_not_opened() {
        for (path, what) in [
            ("/dev/null", "a device"),
            ("/dev/stdin", "is "),
            ("/dev/fd/63", "is "),
            ("/proc/self/fd/0", "is "),
        ] {
            let refusal = expect_file(Path::new(path)).unwrap_err();
            assert!(
                refusal.what.contains(what) && refusal.way_out.contains("save it as a file"),
                "{path}: {refusal}"
            );
        }
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("socket.mp4");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        assert_eq!(expect_file(&socket).unwrap_err().what, "is a socket");
        assert!(expect_file(folder.path()).is_ok() && expect_file(Path::new("/no/such/film.mp4")).is_ok());
    }
}
