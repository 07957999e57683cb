//! The programs ffmpeg and ffprobe: where they are, how they are run, and the frames that ffmpeg decodes.

use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::thread::JoinHandle;

use crate::ffprobe;
use crate::film::{Frame, Options};
use crate::refusal::Refusal;
use crate::stream::{Fields, Stream};

/// How to get the programs.
const INSTALL: &str = "install it (Debian, Ubuntu: sudo apt install ffmpeg; macOS: brew install ffmpeg; \
     Windows: winget install ffmpeg), set TESSUTO_FFMPEG to where it is, or extract the frames elsewhere and \
     import their folder";
const WHOLE: &str = "play it to see whether it is whole; copy it again";
/// Most of ffmpeg's complaints that are kept.
const MAX_COMPLAINTS: usize = 20;
/// Containers that are opened. What names other files, what the network or a device gives and images alone are not
/// among them.
const CONTAINERS: &str = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg,mpegvideo,flv,live_flv,asf,ogg,\
     gif,apng,mxf,gxf,nut,ivf,dv,rm,wtv,yuv4mpegpipe,h264,hevc,vvc,evc,mjpeg,mjpeg_2000,mpjpeg,smjpeg,m4v,\
     h261,h263,vc1,vc1test,obu,av1,cavsvideo,avs2,avs3,dirac,dnxhd,jpeg_pipe,png_pipe,\
     nsv,pmp,r3d,lxf,dhav,film_cpk,roq,4xm,flic,nuv";

/// Both programs.
#[derive(Clone, Debug)]
pub(crate) struct Programs {
    pub ffmpeg: PathBuf,
    pub ffprobe: PathBuf,
    /// Whether ffmpeg knows `-fps_mode`, of 5.1 and later; older ones know `-vsync`, which is to go.
    pub knows_fps_mode: bool,
    /// Number of the film among the streams of the file.
    pub index: usize,
}

impl Programs {
    /// ffprobe is where ffmpeg is, and named as it is: `ffmpeg-7.exe` has `ffprobe-7.exe` beside it.
    pub fn beside(ffmpeg: &Path) -> Self {
        let name = ffmpeg.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let probe = match name.to_lowercase().rfind("ffmpeg").filter(|at| name.is_char_boundary(*at)) {
            Some(at) if name.is_char_boundary(at + 6) => format!("{}ffprobe{}", &name[..at], &name[at + 6..]),
            _ => "ffprobe".to_owned(),
        };
        let beside = ffmpeg.with_file_name(&probe);
        let is_searched = ffmpeg.parent().is_none_or(|folder| folder.as_os_str().is_empty());
        // A program of that name in the search path is better than none.
        let ffprobe = if is_searched || beside.exists() { beside } else { PathBuf::from("ffprobe") };
        Self { ffmpeg: ffmpeg.to_path_buf(), ffprobe, knows_fps_mode: false, index: 0 }
    }

    /// What keeps both programs to the named file and to frames of a bounded size; these options stand before the file.
    fn bounds(command: &mut Command, options: &Options) {
        command.args(["-v", "error", "-protocol_whitelist", "file,pipe", "-format_whitelist", CONTAINERS]);
        command.args(["-max_pixels", &options.max_pixels().to_string()]);
    }

    /// Runs ffprobe with `arguments` for the file at `path`; its JSON, and what it complained of last.
    ///
    /// # Errors
    /// [`Refusal`] if it is missing or what it says is no JSON.
    pub fn probe<T: serde::de::DeserializeOwned>(
        &self,
        path: &Path,
        arguments: &[&str],
        options: &Options,
    ) -> Result<(Option<T>, String), Refusal> {
        let mut command = Command::new(&self.ffprobe);
        command.arg("-hide_banner");
        Self::bounds(&mut command, options);
        let mut child = start(command.args(arguments).args(["-of", "json", "-i"]).arg(url(path)))
            .map_err(|e| self.missing(&self.ffprobe, &e))?;
        let (stdout, complaints) = (child.stdout.take(), complaints(&mut child));
        let read = stdout.map(|stdout| serde_json::from_reader(BufReader::new(stdout)));
        let ended = child.wait().is_ok_and(|status| status.success());
        let said = complaints.join().unwrap_or_default();
        let last = said
            .lines()
            .rev()
            .find(|line| !line.trim().is_empty())
            .unwrap_or("nothing said")
            .trim()
            .to_owned();
        match read {
            Some(Ok(answer)) if ended => Ok((Some(answer), last)),
            Some(Err(e)) if ended => {
                Err(Refusal::new(format!("what ffprobe sends cannot be read: {e}"), INSTALL))
            }
            _ => Ok((None, last)),
        }
    }

    fn missing(&self, program: &Path, error: &std::io::Error) -> Refusal {
        // Whoever has ffmpeg alone reads what is missing.
        let is_other = program == self.ffprobe && runs(&self.ffmpeg);
        let needed =
            if is_other { "the program ffprobe, which comes with ffmpeg" } else { "the program ffmpeg" };
        let what = format!("needs {needed}; {} cannot be started: {error}", program.display());
        Refusal { lacks_program: true, ..Refusal::new(what, INSTALL) }
    }
}

fn runs(program: &Path) -> bool {
    let mut command = Command::new(program);
    command.arg("-version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok()
}

/// The path as the programs take it even if it looks like an option or a protocol.
fn url(path: &Path) -> OsString {
    let mut url = OsString::from("file:");
    url.push(path);
    url
}

fn start(command: &mut Command) -> std::io::Result<Child> {
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()
}

/// Reads what a program complains of while another pipe is read.
fn complaints(child: &mut Child) -> JoinHandle<String> {
    let mut stderr = child.stderr.take();
    std::thread::spawn(move || {
        let mut text = Vec::new();
        // What cannot be read of the complaints is lost; the exit status still says so.
        let _ = stderr.as_mut().map(|s| s.read_to_end(&mut text));
        String::from_utf8_lossy(&text).into_owned()
    })
}

/// Frames as ffmpeg decodes them.
pub(crate) struct Decoder {
    child: Child,
    stdout: Option<BufReader<ChildStdout>>,
    said: Option<JoinHandle<String>>,
    complaints: Vec<String>,
    max_side: usize,
    /// Number of frames that are still to come, where that is bounded.
    left: Option<usize>,
    /// Looks for the reason where the decoder gives up.
    diagnosis: Box<dyn Fn() -> Option<Refusal> + Send + Sync>,
}

impl Decoder {
    /// Starts decoding.
    pub(crate) fn start(
        path: &Path,
        programs: &Programs,
        stream: &Stream,
        end: Option<usize>,
        options: &Options,
    ) -> Result<Self, Refusal> {
        let mut command = Command::new(&programs.ffmpeg);
        command.args(["-hide_banner", "-nostdin"]);
        Programs::bounds(&mut command, options);
        let lies = stream.fields != Fields::Progressive && stream.turn != 0;
        if lies {
            // Rows are fields only before frames are turned.
            command.arg("-noautorotate");
        }
        command.arg("-i").arg(url(path)).args(["-map", &format!("0:{}", programs.index)]);
        command.args(["-vf", &filters(stream)]);
        // Every frame once, whatever its time stamp: who knows the stamps chooses.
        command.args([if programs.knows_fps_mode { "-fps_mode" } else { "-vsync" }, "passthrough"]);
        if let Some(end) = end {
            command.args(["-frames:v", &end.to_string()]);
        }
        command.args(["-f", "image2pipe", "-c:v", "ppm", "-pix_fmt", "rgb24", "pipe:1"]);
        let mut child = start(&mut command).map_err(|e| programs.missing(&programs.ffmpeg, &e))?;
        let (stdout, said) = (child.stdout.take(), complaints(&mut child));
        let diagnosis = {
            let (path, programs) = (path.to_path_buf(), programs.clone());
            let (max_side, max_bytes, max_frames) = (options.max_side, options.max_bytes, options.max_frames);
            let nothing = PathBuf::new();
            move || {
                let options = Options { ffmpeg: &nothing, max_side, max_bytes, max_frames, end };
                ffprobe::change_of_size(&path, &programs, &options)
            }
        };
        Ok(Self {
            child,
            stdout: stdout.map(BufReader::new),
            said: Some(said),
            complaints: Vec::new(),
            max_side: options.max_side,
            left: end,
            diagnosis: Box::new(diagnosis),
        })
    }

    /// What the decoder complained of without giving up, once all frames are read.
    pub fn complaint(&self) -> Option<&str> {
        self.complaints.first().map(String::as_str)
    }

    fn finish(&mut self) -> Result<(), Refusal> {
        self.stdout = None;
        let status = self.child.wait();
        let said = self.said.take().and_then(|t| t.join().ok()).unwrap_or_default();
        self.complaints =
            said.lines().filter(|l| !l.trim().is_empty()).take(MAX_COMPLAINTS).map(str::to_owned).collect();
        // What it meets behind the last frame that is wanted does not matter.
        let is_sound = status.is_ok_and(|s| s.success());
        if is_sound || self.left == Some(0) {
            self.complaints.retain(|_| is_sound);
            return Ok(());
        }
        if let Some(change) = (self.diagnosis)() {
            return Err(change);
        }
        let last = self.complaints.last().map_or("nothing said", String::as_str);
        Err(Refusal::new(format!("ffmpeg cannot decode it: {last}"), WHOLE))
    }

    /// The next frame; `None` at the end.
    fn read(&mut self) -> std::io::Result<Option<Frame>> {
        let Some(reader) = &mut self.stdout else { return Ok(None) };
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
        let side = |text: &str| text.parse::<usize>().ok().filter(|n| (2..=self.max_side).contains(n));
        let (Some(width), Some(height)) = (side(width), side(height)) else { return Err(bad()) };
        let mut rgb = vec![0u8; 3 * width * height];
        match reader.read_exact(&mut rgb) {
            // A decoder that fails leaves a part of a frame; its exit status says so.
            Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => Ok(None),
            Err(e) => Err(e),
            Ok(()) => Ok(Some(Frame { size: [width, height], rgb })),
        }
    }
}

/// What frames go through.
fn filters(stream: &Stream) -> String {
    let is_interlaced = stream.fields != Fields::Progressive;
    let [width, height] = if is_interlaced { stream.size } else { stream.upright_size() };
    // The filters are set up anew where frames change their size; an impossible width then ends the decoder, which
    // would scale them else.
    let mut filters = vec![format!(r"crop=w=if(eq(iw\,{width})*eq(ih\,{height})\,iw\,-1):h=ih:exact=1")];
    if is_interlaced {
        let first = if stream.fields == Fields::TopFirst { "tff" } else { "bff" };
        filters.push(format!("bwdif=mode=send_field:parity={first}:deint=all"));
        match stream.turn {
            45..135 => filters.push("transpose=clock".to_owned()),
            135..225 => filters.push("hflip,vflip".to_owned()),
            225..315 => filters.push("transpose=cclock".to_owned()),
            _ => {}
        }
    }
    filters.join(",")
}

impl Iterator for Decoder {
    type Item = Result<Frame, Refusal>;

    fn next(&mut self) -> Option<Self::Item> {
        self.stdout.as_ref()?;
        match self.read() {
            Ok(Some(frame)) => {
                self.left = self.left.map(|left| left.saturating_sub(1));
                Some(Ok(frame))
            }
            Ok(None) => self.finish().err().map(Err),
            Err(e) => {
                self.stdout = None;
                Some(Err(Refusal::new(format!("what ffmpeg sends cannot be read: {e}"), INSTALL)))
            }
        }
    }
}

impl Drop for Decoder {
    /// No decoder outlives its reader.
    fn drop(&mut self) {
        self.stdout = None;
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ffprobe_is_beside_ffmpeg() {
        let beside = |path: &str| Programs::beside(Path::new(path)).ffprobe;
        assert_eq!(beside("ffmpeg"), PathBuf::from("ffprobe"));
        assert_eq!(beside("ffmpeg-7.exe"), PathBuf::from("ffprobe-7.exe"));
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        // One that is not there may still be in the search path.
        assert_eq!(Programs::beside(&path("my-ffmpeg7")).ffprobe, PathBuf::from("ffprobe"));
        std::fs::write(path("my-ffprobe7"), "").unwrap();
        assert_eq!(Programs::beside(&path("my-ffmpeg7")).ffprobe, path("my-ffprobe7"));
    }
}
