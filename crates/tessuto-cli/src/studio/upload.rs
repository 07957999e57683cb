//! A clip that comes from the browser.

use std::fs::File;
use std::io::{Read, Write as _};
use std::path::Path;
use std::sync::Mutex;
use std::time::Duration;

use super::entries::is_video;
use super::place::{LONGEST_NEW, Project, is_name};
use crate::http::{BodyError, Request};

/// Where clips go.
const FOLDER: &str = "clips";
/// Largest clip [bytes]: a minute as a phone films at its best is one or two GB.
const LONGEST: u64 = 8 << 30;
/// Longest time that a clip may take: the server is on the same machine.
const WITHIN: Duration = Duration::from_secs(1800);

/// One upload at a time.
static BUSY: Mutex<()> = Mutex::new(());

/// Writes the body of `request` into the project under `name`, beside what is there; the name it got.
///
/// # Errors
/// Status and a sentence for the user.
pub fn receive(
    project: &Project,
    request: &mut Request,
    stream: &mut impl Read,
    name: &str,
) -> Result<String, (&'static str, String)> {
    let refuse = |status, text: &str| Err((status, text.to_owned()));
    if name.len() > LONGEST_NEW {
        let text =
            format!("the name of the clip has {} bytes: give it one of {LONGEST_NEW} at most", name.len());
        return refuse("400 Bad Request", &text);
    }
    if !is_name(name) || name.contains('/') || !is_video(name) {
        return refuse("400 Bad Request", "that is no video: choose a file such as clip.mp4 or clip.mov");
    }
    let Ok(_busy) = BUSY.try_lock() else {
        return refuse("409 Conflict", "another clip is being copied: wait for it");
    };
    let failed = |e: std::io::Error| {
        ("500 Internal Server Error", format!("the clip cannot be copied to {FOLDER}: {e}"))
    };
    let folder =
        project.place(FOLDER).ok_or(("403 Forbidden", format!("{FOLDER} leads out of the project")))?;
    std::fs::create_dir_all(&folder).map_err(failed)?;
    let partial = folder.join(".upload.partial");
    // A link in its place is removed, not followed.
    let _ = std::fs::remove_file(&partial);
    let mut file = File::create_new(&partial).map_err(failed)?;
    let took = request.body(stream, LONGEST, WITHIN, |piece| file.write_all(piece));
    let result = match took {
        Ok(written) => written
            .and_then(|()| file.sync_all())
            .and_then(|()| publish(&partial, &folder, name))
            .map_err(failed),
        Err(BodyError::NoLength) => {
            refuse("411 Length Required", "the request does not give the length of the clip")
        }
        Err(BodyError::TooLong) => {
            refuse("413 Content Too Large", "the clip is larger than 8 GB: cut it first")
        }
        Err(BodyError::Stalled) => refuse("408 Request Timeout", "the copy broke off: choose the clip again"),
    };
    if result.is_err() {
        let _ = std::fs::remove_file(&partial);
    }
    result
}

/// Gives the file a name that nothing else has.
fn publish(partial: &Path, folder: &Path, name: &str) -> std::io::Result<String> {
    let (stem, ending) = name.rsplit_once('.').unwrap_or((name, ""));
    let names = std::iter::once(name.to_owned()).chain((2..).map(|n| format!("{stem}-{n}.{ending}")));
    for name in names {
        // A link is made only where nothing is, so that no file is ever replaced.
        match std::fs::hard_link(partial, folder.join(&name)) {
            Ok(()) => {
                std::fs::remove_file(partial)?;
                return Ok(format!("{FOLDER}/{name}"));
            }
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {}
            // Some file systems have no links.
            Err(_) if folder.join(&name).symlink_metadata().is_err() => {
                std::fs::rename(partial, folder.join(&name))?;
                return Ok(format!("{FOLDER}/{name}"));
            }
            Err(_) => {}
        }
    }
    unreachable!("names do not end")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn upload(project: &Project, name: &str, length: u64, body: &str) -> Result<String, &'static str> {
        let text = format!("PUT / HTTP/1.1\r\nContent-Length: {length}\r\n\r\n{body}");
        let mut stream = text.as_bytes();
        let mut request = Request::read(&mut stream).unwrap();
        receive(project, &mut request, &mut stream, name).map_err(|(status, _)| status)
    }

    #[test]
    fn clips_come_whole_beside_what_is_there_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let project = Project::open(folder.path()).unwrap();
        assert_eq!(upload(&project, "a b.mp4", 3, "abc").unwrap(), "clips/a b.mp4");
        assert_eq!(upload(&project, "a b.mp4", 3, "xyz").unwrap(), "clips/a b-2.mp4");
        assert_eq!(std::fs::read(folder.path().join("clips/a b.mp4")).unwrap(), b"abc");
        let long = format!("{}.mp4", "a".repeat(250));
        for name in [&long, "../a.mp4", "/a.mp4", "x/a.mp4", ".a.mp4", "a.sh", "a", "..", ""] {
            assert_eq!(upload(&project, name, 3, "abc"), Err("400 Bad Request"), "{name}");
        }
        assert_eq!(upload(&project, "b.mp4", 9, "abc"), Err("408 Request Timeout"));
        assert_eq!(upload(&project, "b.mp4", LONGEST + 1, "abc"), Err("413 Content Too Large"));
        let busy = BUSY.lock().unwrap();
        assert_eq!(upload(&project, "b.mp4", 3, "abc"), Err("409 Conflict"));
        drop(busy);
        let left: Vec<_> = folder.path().join("clips").read_dir().unwrap().collect();
        assert_eq!(left.len(), 2, "{left:?}");
    }
}
