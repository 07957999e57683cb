//! Videos through the program ffmpeg: what it says of a file, and the frames it decodes, one after the other.

use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::thread::JoinHandle;

use crate::error::{Error, Hint, Remedy, Result};
use crate::io::image::MAX_SIDE;

/// How to get the program.
const INSTALL: &str = "install it (Debian, Ubuntu: sudo apt install ffmpeg; macOS: brew install ffmpeg; Windows: winget install ffmpeg), \
     set TESSUTO_FFMPEG to where it is, or extract the frames elsewhere and import their folder";
/// A mean rate so close to the nominal one `[fraction]` is constant but for rounding.
const CONSTANT: f64 = 0.01;
/// Most of ffmpeg's complaints that are kept.
const MAX_COMPLAINTS: usize = 20;

/// A video file, looked at.
pub(super) struct Video {
    path: PathBuf,
    ffmpeg: PathBuf,
    /// Frames per second of what [`stream`](Self::stream) gives.
    pub fps: f64,
    /// As ffmpeg is told.
    rate: String,
    /// Whether time stamps decide which frame is shown, rather than one frame following the other.
    resampled: bool,
}

/// One frame, 8-bit colour, shape [height, width, 3].
pub(super) struct Raw {
    /// Width and height `[px]`.
    pub size: [usize; 2],
    pub rgb: Vec<u8>,
}

impl Video {
    /// Asks ffmpeg about the file; `fps` asks for another frame rate than its own.
    ///
    /// # Errors
    /// [`Error::Input`] if ffmpeg is missing or finds no video.
    pub fn probe(path: &Path, ffmpeg: &Path, fps: Option<f64>, notes: &mut Vec<String>) -> Result<Self> {
        let place = path.display().to_string();
        let output = command(ffmpeg)
            .arg("-i")
            .arg(url(path))
            .stdin(Stdio::null())
            .output()
            .map_err(|e| missing(&place, ffmpeg, &e))?;
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let Some(stream) = said
            .lines()
            .find(|l| l.contains("Video:") && l.contains("Stream #") && !l.contains("attached pic"))
        else {
            let last =
                said.lines().rev().find(|l| !l.trim().is_empty() && !l.contains("At least one output"));
            return Err(Error::input(
                place,
                format!("ffmpeg finds no video in it: {}", last.unwrap_or("nothing said").trim()),
                "name a video file, or a folder of PNG or JPEG images",
            ));
        };
        let turn = said.split("rotation of ").nth(1).and_then(|t| t.split(" degrees").next());
        if let Some(turn) = turn.filter(|t| t.trim().parse::<f64>().is_ok_and(|t| t != 0.0)) {
            notes.push(format!(
                "{place}: the recording is marked as turned by {turn}°; frames are written upright"
            ));
        }
        if stream.contains("smpte2084") || stream.contains("arib-std-b67") {
            notes.push(format!("{place}: high dynamic range (HLG or PQ); its colours will look flat: record in standard range, or convert it first"));
        }
        let before = |unit: &str| {
            let text = stream.split(unit).next().filter(|t| t.len() < stream.len())?;
            let number = text.rsplit(", ").next()?.trim();
            match number.strip_suffix('k') {
                Some(thousands) => thousands.parse::<f64>().ok().map(|v| v * 1000.0),
                None => number.parse::<f64>().ok(),
            }
        };
        let (mean, nominal) = (before(" fps"), before(" tbr"));
        let Some(mean) = mean.or(nominal).filter(|v| *v > 0.0) else {
            return match fps {
                Some(fps) => Ok(Self::new(path, ffmpeg, fps, true)),
                None => Err(Error::input(
                    place,
                    "does not tell its frame rate",
                    Hint::from("give its frames per second").with(Remedy::Fps),
                )),
            };
        };
        let nominal = nominal.filter(|v| *v > 0.0).unwrap_or(mean);
        if let Some(fps) = fps {
            return Ok(Self::new(path, ffmpeg, fps, (fps - mean).abs() > CONSTANT * mean));
        }
        if (nominal - mean).abs() <= CONSTANT * nominal {
            return Ok(Self::new(path, ffmpeg, exact(nominal), false));
        }
        // Time bases of screen recorders pose as rates of thousands.
        let chosen = if nominal < 2.0 * mean { exact(nominal) } else { mean.round().max(1.0) };
        notes.push(format!(
            "{place}: its frame rate varies ({mean} per second on average); brought to {chosen:.4} per second by its time stamps, \
             frames repeat or are left out: another rate can be given (fps)"
        ));
        Ok(Self::new(path, ffmpeg, chosen, true))
    }

    fn new(path: &Path, ffmpeg: &Path, fps: f64, resampled: bool) -> Self {
        // ffmpeg wants whole numbers where a decimal fraction would drift.
        let ntsc = (fps * 1.001).round();
        let rate = if (fps - ntsc / 1.001).abs() < 1e-6 {
            format!("{}/1001", ntsc * 1000.0)
        } else {
            fps.to_string()
        };
        Self { path: path.to_path_buf(), ffmpeg: ffmpeg.to_path_buf(), fps, rate, resampled }
    }

    /// Gives every frame of the file, whatever its time.
    pub fn every_frame(self) -> Self {
        Self { resampled: false, ..self }
    }

    /// Whether frames were repeated or left out to make the rate constant.
    pub fn resampled(&self) -> bool {
        self.resampled
    }

    /// Starts decoding the frames up to `end`.
    ///
    /// # Errors
    /// [`Error::Input`] if ffmpeg cannot be started.
    pub fn stream(&self, end: Option<usize>) -> Result<Stream> {
        let mut command = command(&self.ffmpeg);
        command.args(["-v", "error", "-protocol_whitelist", "file,pipe", "-i"]).arg(url(&self.path));
        // V leaves out cover images; turning by the file's mark is what ffmpeg does by itself.
        command.args(["-map", "0:V:0"]);
        let rate = &self.rate;
        if self.resampled {
            command.arg("-vf").arg(format!("fps={rate}"));
        } else {
            // Even time stamps, so that no frame is repeated or dropped for their jitter.
            command.arg("-vf").arg(format!("setpts=N/({rate})/TB")).args(["-r", rate]);
        }
        if let Some(end) = end {
            command.args(["-frames:v", &end.to_string()]);
        }
        command.args(["-f", "image2pipe", "-c:v", "ppm", "-pix_fmt", "rgb24", "pipe:1"]);
        let place = self.path.display().to_string();
        let mut child = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| missing(&place, &self.ffmpeg, &e))?;
        let (stdout, mut stderr) = (child.stdout.take(), child.stderr.take());
        let said = std::thread::spawn(move || {
            let mut text = Vec::new();
            // What cannot be read of the complaints is lost; the exit status still tells.
            let _ = stderr.as_mut().map(|s| s.read_to_end(&mut text));
            String::from_utf8_lossy(&text).into_owned()
        });
        Ok(Stream {
            place,
            child,
            frames: stdout.map(BufReader::new),
            said: Some(said),
            complaints: Vec::new(),
        })
    }

    /// The error of a video without frames.
    pub fn empty(&self) -> Error {
        Error::input(
            self.path.display().to_string(),
            "holds no frame that ffmpeg can decode",
            "play it to see whether it is whole; copy it again",
        )
    }
}

/// Rates of television are thousandths off round ones, which ffmpeg prints with two digits.
fn exact(rate: f64) -> f64 {
    let ntsc = (rate * 1.001).round() / 1.001;
    if (rate - ntsc).abs() < 0.006 && (rate - rate.round()).abs() > 0.006 { ntsc } else { rate }
}

fn command(ffmpeg: &Path) -> Command {
    let mut command = Command::new(ffmpeg);
    command.args(["-hide_banner", "-nostdin"]);
    command
}

/// The path as ffmpeg takes it even if it looks like an option or a protocol.
fn url(path: &Path) -> OsString {
    let mut url = OsString::from("file:");
    url.push(path);
    url
}

fn missing(place: &str, ffmpeg: &Path, error: &std::io::Error) -> Error {
    Error::input(
        place,
        format!("needs the program ffmpeg; {} cannot be started: {error}", ffmpeg.display()),
        INSTALL,
    )
}

/// Frames as they are decoded.
pub(super) struct Stream {
    place: String,
    child: Child,
    frames: Option<BufReader<ChildStdout>>,
    said: Option<JoinHandle<String>>,
    complaints: Vec<String>,
}

impl Stream {
    /// What ffmpeg complained of without giving up.
    pub fn complaints(&mut self) -> Option<String> {
        let first = self.complaints.first()?;
        Some(format!("{}: ffmpeg complains, frames may be damaged: {first}", self.place))
    }

    fn finish(&mut self) -> Result<()> {
        self.frames = None;
        let status = self.child.wait();
        let said = self.said.take().and_then(|t| t.join().ok()).unwrap_or_default();
        self.complaints =
            said.lines().filter(|l| !l.trim().is_empty()).take(MAX_COMPLAINTS).map(str::to_owned).collect();
        if status.is_ok_and(|s| s.success()) {
            return Ok(());
        }
        let last = self.complaints.last().map_or("nothing said", String::as_str);
        Err(Error::input(
            &self.place,
            format!("ffmpeg cannot decode it: {last}"),
            "play it to see whether it is whole; copy it again",
        ))
    }

    /// The next frame; `None` at the end.
    fn read(&mut self) -> std::io::Result<Option<Raw>> {
        let Some(reader) = &mut self.frames else { return Ok(None) };
        let mut header = String::new();
        // `P6`, width and height, largest value, each on its line.
        for _ in 0..3 {
            if reader.read_line(&mut header)? == 0 {
                return Ok(None);
            }
        }
        let bad =
            || std::io::Error::new(std::io::ErrorKind::InvalidData, format!("not an image: {header:?}"));
        let words: Vec<&str> = header.split_ascii_whitespace().collect();
        let ["P6", width, height, "255"] = words[..] else { return Err(bad()) };
        let side = |text: &str| text.parse::<usize>().ok().filter(|n| (2..=MAX_SIDE).contains(n));
        let (Some(width), Some(height)) = (side(width), side(height)) else { return Err(bad()) };
        let mut rgb = vec![0u8; 3 * width * height];
        match reader.read_exact(&mut rgb) {
            // A decoder that fails leaves a part of a frame; its exit status says so.
            Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => Ok(None),
            Err(e) => Err(e),
            Ok(()) => Ok(Some(Raw { size: [width, height], rgb })),
        }
    }
}

impl Iterator for Stream {
    type Item = Result<Raw>;

    fn next(&mut self) -> Option<Self::Item> {
        self.frames.as_ref()?;
        match self.read() {
            Ok(Some(frame)) => Some(Ok(frame)),
            Ok(None) => self.finish().err().map(Err),
            Err(e) => {
                self.frames = None;
                Some(Err(Error::input(
                    &self.place,
                    format!("what ffmpeg sends cannot be read: {e}"),
                    INSTALL,
                )))
            }
        }
    }
}

impl Drop for Stream {
    /// No decoder outlives its reader.
    fn drop(&mut self) {
        self.frames = None;
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::exact;

    #[test]
    fn television_rates_are_exact() {
        assert!((exact(29.97) - 30_000.0 / 1001.0).abs() < 1e-12);
        assert!((exact(23.98) - 24_000.0 / 1001.0).abs() < 1e-12);
        assert!((exact(59.94) - 60_000.0 / 1001.0).abs() < 1e-12);
        assert_eq!((exact(25.0), exact(30.0), exact(12.5), exact(1000.0)), (25.0, 30.0, 12.5, 1000.0));
    }
}
