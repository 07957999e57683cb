//! Videos as cameras, browsers and phones write them: their time, their shape, and what is no film. The clips are
//! made by ffmpeg.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::missing::not_tested;
use serde_json::Value;
use tempfile::TempDir;
use tessuto::io::image::{read, read_mask};

const FOV: [&str; 2] = ["--fov", "43.6"];

/// A folder of clips.
struct Clips {
    home: TempDir,
}

/// What an import printed and wrote.
struct Imported {
    text: String,
    scene: Value,
}

impl Imported {
    fn number(&self, name: &str) -> f64 {
        self.scene[name].as_f64().unwrap_or_else(|| panic!("{name} of {}", self.scene))
    }
}

impl Clips {
    /// `None`, and said so, where there is no ffmpeg.
    fn new() -> Option<Self> {
        if Command::new(ffmpeg()).arg("-version").output().is_err() {
            not_tested("ffmpeg");
            return None;
        }
        Some(Self { home: tempfile::tempdir().unwrap() })
    }

    fn path(&self, name: &str) -> PathBuf {
        self.home.path().join(name)
    }

    /// Runs ffmpeg here with these arguments; whether it could.
    fn try_make(&self, arguments: &str, more: &[&str]) -> bool {
        let mut command = Command::new(ffmpeg());
        command.current_dir(self.home.path()).args(["-v", "error", "-nostdin", "-y"]);
        let output = command.args(arguments.split_whitespace()).args(more).output().unwrap();
        output.status.success()
    }

    fn make(&self, arguments: &str, more: &[&str]) {
        assert!(self.try_make(arguments, more), "ffmpeg {arguments} {more:?}");
    }

    /// `count` frames at `rate` of a pattern that moves, of 64×64 pixels, to `to`.
    fn pattern(&self, rate: &str, count: usize, options: &str, to: &str) {
        let source = format!("-f lavfi -i testsrc2=s=64x64:r={rate} -frames:v {count} {options}");
        self.make(&source, &[to]);
    }

    fn run(&self, input: &str, options: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tessuto"));
        command.current_dir(self.home.path()).args(["import", input, "out", "--force"]);
        command.args(options).output().unwrap()
    }

    fn imported(&self, input: &str, options: &[&str]) -> Imported {
        let output = self.run(input, &[&FOV[..], options].concat());
        let text = one_line(&output.stdout) + &one_line(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{input} {options:?}: {text}");
        let scene = std::fs::read_to_string(self.path("out/scene.json")).unwrap();
        Imported { text, scene: serde_json::from_str(&scene).unwrap() }
    }

    /// Asserts frames, their rate, and whether a note has `fragment`; without one, that there is no note.
    fn gives(&self, input: &str, options: &[&str], frames: f64, fps: f64, fragment: &str) -> Imported {
        let imported = self.imported(input, options);
        let found = (imported.number("n_frames"), imported.number("fps"));
        assert_eq!(found, (frames, fps), "{input} {options:?}: {}", imported.text);
        let is_told = if fragment.is_empty() {
            !imported.text.contains("note: ")
        } else {
            imported.text.contains(fragment)
        };
        assert!(is_told, "{input} {options:?}, {fragment:?}: {}", imported.text);
        imported
    }

    fn refused(&self, input: &str, options: &[&str], fragments: &[&str]) {
        let _ = std::fs::remove_dir_all(self.path("out"));
        let output = self.run(input, &[&FOV[..], options].concat());
        let text = one_line(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "{input}: {text}");
        for fragment in fragments.iter().chain(&["hint: "]) {
            assert!(text.contains(fragment), "{input}: {fragment:?} is missing in: {text}");
        }
        assert!(!self.path("out").exists() && !self.path("out.partial").exists());
    }
}

fn ffmpeg() -> std::ffi::OsString {
    std::env::var_os("TESSUTO_FFMPEG").unwrap_or_else(|| "ffmpeg".into())
}

fn one_line(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).split_whitespace().collect::<Vec<_>>().join(" ")
}

const NTSC: f64 = 30_000.0 / 1001.0;

#[test]
fn the_rate_is_that_of_the_time_stamps() {
    let Some(clips) = Clips::new() else { return };
    // Whole milliseconds, and none of the rate beside them.
    clips.pattern("30000/1001", 90, "-c:v ffv1 -default_mode passthrough", "ntsc.mkv");
    clips.gives("ntsc.mkv", &[], 90.0, NTSC, "");
    // As a browser records: 35 ms between most frames, 22 between some.
    let jumps = "-vf setpts=round(N*35.3-13*floor(N/7))/1000/TB -c:v mjpeg -q:v 3";
    clips.pattern("1000", 24, jumps, "browser.mkv");
    let browser = clips.imported("browser.mkv", &[]);
    assert_eq!(browser.number("fps"), 30.0, "{}", browser.text);
    assert!(
        (23.0..=24.0).contains(&browser.number("n_frames")) && browser.text.contains("its frame rate varies")
    );
    clips.gives("browser.mkv", &["--rate", "30"], 24.0, 30.0, "");
    // Another rate is made by the stamps, and a fraction stays exact.
    clips.gives("ntsc.mkv", &["--fps", "30000/1001"], 90.0, NTSC, "");
    clips.gives("ntsc.mkv", &["--rate", "30", "--fps", "10"], 30.0, 10.0, "");
}

#[test]
fn a_dropped_frame_is_told_and_made_good() {
    let Some(clips) = Clips::new() else { return };
    clips.pattern("30", 145, "-c:v mpeg4 -q:v 2", "whole.mp4");
    clips.pattern("30", 144, r"-vf select=not(eq(n\,60)) -c:v mpeg4 -q:v 2", "gap.mkv");
    let imported =
        clips.gives("gap.mkv", &["--frames", "50..70"], 20.0, 30.0, "frame 60 comes late (the first 0.067 s");
    assert!(imported.text.contains("brought to 30 per second"), "{}", imported.text);
    let frame = |n: usize| read(&clips.path(&format!("out/rgbs/rgb_{n:03}.png"))).unwrap();
    assert_eq!(frame(9), frame(10));
    let late = frame(11);
    clips.gives("whole.mp4", &["--frames", "50..70"], 20.0, 30.0, "");
    // Frame 61 is again where it was filmed.
    let far = |a: &tessuto::Image, b: &tessuto::Image| -> f32 {
        a.data.iter().zip(&b.data).map(|(a, b)| (a - b).abs()).sum::<f32>() / a.data.len() as f32
    };
    assert!(far(&late, &frame(11)) < 0.01, "{}", far(&late, &frame(11)));
    assert!(far(&late, &frame(10)) > 0.01, "the pattern must move");
}

#[test]
fn masks_follow_the_frames_over_a_gap() {
    let Some(clips) = Clips::new() else { return };
    clips.pattern("30", 23, r"-vf select=not(eq(n\,5)) -c:v mpeg4 -q:v 2", "gap.mkv");
    // One mask for each stored frame, at a constant rate: white grows with its number.
    let white = "-f lavfi -i color=black:s=64x64:r=30 -frames:v 23 -vf format=gray,geq=lum=255*lt(X\\,4+2*N) -c:v ffv1";
    clips.make(white, &["masks.mkv"]);
    let imported = clips.imported("gap.mkv", &["--masks", "masks.mkv"]);
    assert_eq!(imported.number("n_frames"), 24.0, "{}", imported.text);
    let width = |n: usize| {
        let (mask, _) = read_mask(&clips.path(&format!("out/masks/mask_{n:03}.png"))).unwrap();
        mask.data[..64].iter().filter(|v| **v > 0.5).count()
    };
    assert_eq!((width(4), width(5), width(6), width(23)), (12, 12, 14, 48));
}

#[test]
fn masks_of_another_rate_are_paired_by_their_times_or_refused() {
    let Some(clips) = Clips::new() else { return };
    clips.pattern("12", 12, "-c:v ffv1", "film.mkv");
    // White grows with the number of the mask.
    let white = |rate: usize, count: usize, to: &str| {
        let grown = format!(
            "-f lavfi -i color=black:s=64x64:r={rate} -frames:v {count} -vf \
             format=gray,geq=lum=255*lt(X\\,4+2*N) -c:v ffv1"
        );
        clips.make(&grown, &[to]);
    };
    let width = |n: usize| {
        let (mask, _) = read_mask(&clips.path(&format!("out/masks/mask_{n:03}.png"))).unwrap();
        mask.data[..64].iter().filter(|v| **v > 0.5).count()
    };
    white(24, 24, "twice.mkv");
    let imported = clips.imported("film.mkv", &["--masks", "twice.mkv"]);
    assert!(
        imported.text.contains("24 masks for 12 frames of the same length; paired by their time stamps"),
        "{}",
        imported.text
    );
    assert_eq!([0, 1, 5, 11].map(width), [4, 8, 24, 48]);
    // As many as frames, whatever their stamps: one by one.
    white(30, 12, "each.mkv");
    clips.imported("film.mkv", &["--masks", "each.mkv"]);
    assert_eq!([0, 1, 5, 11].map(width), [4, 6, 14, 26]);
    white(24, 8, "short.mkv");
    clips.refused(
        "film.mkv",
        &["--masks", "short.mkv"],
        &["short.mkv", "8 masks in 0.33 s", "12 frames in 1.00 s"],
    );
}

#[test]
fn raw_streams_do_not_tell_their_rate() {
    let Some(clips) = Clips::new() else { return };
    clips.pattern("60", 24, "-c:v mjpeg -f mjpeg", "raw.mjpeg");
    clips.pattern("60", 24, "-c:v mpeg4 -f m4v", "raw.m4v");
    for name in ["raw.mjpeg", "raw.m4v"] {
        clips.refused(name, &[], &[name, "has no time stamps", "--rate"]);
        clips.refused(name, &["--fps", "60"], &["has no time stamps", "--rate"]);
        clips.gives(name, &["--rate", "60"], 24.0, 60.0, "");
    }
    // Masks need no rate: they follow one by one.
    clips.make("-f lavfi -i color=white:s=64x64:r=30 -frames:v 24 -c:v mjpeg -f mjpeg", &["masks.mjpeg"]);
    clips.imported("raw.m4v", &["--rate", "60", "--masks", "masks.mjpeg"]);
}

#[test]
fn slow_motion_has_the_rate_at_which_it_was_filmed() {
    let Some(clips) = Clips::new() else { return };
    let tag =
        |fps: &str| format!("-c:v mpeg4 -movflags use_metadata_tags -metadata com.android.capture.fps={fps}");
    clips.pattern("30", 24, &tag("240.0"), "slow.mp4");
    clips.gives("slow.mp4", &[], 24.0, 240.0, "filmed at 240 per second, but is stamped 30 per second");
    clips.gives("slow.mp4", &["--rate", "30"], 24.0, 30.0, "");
    clips.pattern("30", 24, &tag("0.5"), "lapse.mp4");
    clips.gives("lapse.mp4", &[], 24.0, 0.5, "time lapse");
    // The tag of every film, and nonsense.
    for fps in ["30.0", "29.97", "inf", "1e9", "-1"] {
        clips.pattern("30", 24, &tag(fps), "plain.mp4");
        clips.gives("plain.mp4", &[], 24.0, 30.0, "");
    }
    // As cameras of Sony write it, beside the film.
    clips.pattern("30000/1001", 24, "-c:v mpeg4", "sony.mp4");
    let xml = b"<NonRealTimeMeta><VideoFormat><VideoFrame captureFps=\"119.88p\" formatFps=\"29.97p\"/>\
                </VideoFormat></NonRealTimeMeta>";
    let in_box =
        |kind: &[u8], content: &[u8]| [&(content.len() as u32 + 8).to_be_bytes()[..], kind, content].concat();
    let meta = in_box(b"meta", &[&[0; 4][..], &in_box(b"xml ", xml)].concat());
    let film = std::fs::read(clips.path("sony.mp4")).unwrap();
    std::fs::write(clips.path("sony.mp4"), [film, meta].concat()).unwrap();
    clips.gives("sony.mp4", &[], 24.0, 120_000.0 / 1001.0, "filmed at 119.8801 per second");
}

#[test]
fn pixels_that_are_not_square_make_fy_another() {
    let Some(clips) = Clips::new() else { return };
    clips.make("-f lavfi -i testsrc2=s=240x320:r=30,setsar=4/3 -frames:v 4 -c:v mpeg4", &["sar.mp4"]);
    let camera = |options: &[&str]| {
        let output = clips.run("sar.mp4", options);
        assert_eq!(output.status.code(), Some(0), "{}", one_line(&output.stderr));
        let scene: Value =
            serde_json::from_str(&std::fs::read_to_string(clips.path("out/scene.json")).unwrap()).unwrap();
        (scene["fx"].as_f64().unwrap(), scene["fy"].as_f64().unwrap(), one_line(&output.stdout))
    };
    let (fx, fy, text) = camera(&FOV);
    assert!((fx - 300.0).abs() < 0.1 && (fy / fx - 4.0 / 3.0).abs() < 1e-9, "{fx} {fy}");
    assert!(text.contains("not square (4:3)"), "{text}");
    assert_eq!(camera(&["--fx", "150"]).1, 200.0);
    assert_eq!(camera(&["--fx", "150", "--fy", "150"]).1, 150.0, "what is given counts");
    std::fs::write(clips.path("cameras.txt"), "1 PINHOLE 240 320 150 160 120 160\n").unwrap();
    assert_eq!(camera(&["--camera", "cameras.txt"]).1, 160.0);
    clips.make("-f lavfi -i testsrc2=s=240x320:r=30,setsar=5/1 -frames:v 4 -c:v mpeg4", &["thin.mp4"]);
    clips.refused("thin.mp4", &[], &["pixels of 5:1"]);
}

#[test]
fn fields_become_frames() {
    let Some(clips) = Clips::new() else { return };
    let fields = "-vf tinterlace=mode=interleave_top,setfield=tff -flags +ilme+ildct -c:v mpeg2video -q:v 2";
    clips.pattern("60", 12, fields, "interlaced.mkv");
    let told = "is interlaced (the even rows first)";
    let imported = clips.gives("interlaced.mkv", &[], 24.0, 60.0, told);
    assert!(imported.text.contains("at twice the rate"), "{}", imported.text);
    clips.gives("interlaced.mkv", &["--frames", "3..9"], 6.0, 60.0, told);
    clips.gives("interlaced.mkv", &["--rate", "25"], 24.0, 50.0, told);
    // Each moment is the one that was filmed, without combs.
    clips.gives("interlaced.mkv", &[], 24.0, 60.0, told);
    let frames = |count: usize| -> Vec<tessuto::Image> {
        (0..count).map(|n| read(&clips.path(&format!("out/rgbs/rgb_{n:03}.png"))).unwrap()).collect()
    };
    let found = frames(24);
    clips.pattern("60", 24, "-c:v mpeg2video -q:v 2", "whole.mkv");
    clips.gives("whole.mkv", &[], 24.0, 60.0, "");
    let filmed = frames(24);
    let far = |a: &tessuto::Image, b: &tessuto::Image| -> f32 {
        a.data.iter().zip(&b.data).map(|(a, b)| (a - b).abs()).sum::<f32>() / a.data.len() as f32
    };
    for n in 1..23 {
        let [own, before, after] = [n, n - 1, n + 1].map(|k| far(&found[n], &filmed[k]));
        assert!(own < before && own < after, "frame {n}: {own}, {before} before, {after} after");
    }
    // One mask for both moments of a frame, or one for each.
    for count in [12, 24] {
        let white = format!(
            "-f lavfi -i color=black:s=64x64:r=30 -frames:v {count} -vf format=gray,geq=lum=255*lt(X\\,4+2*N) -c:v ffv1"
        );
        clips.make(&white, &["masks.mkv"]);
        clips.imported("interlaced.mkv", &["--masks", "masks.mkv"]);
        let (mask, _) = read_mask(&clips.path("out/masks/mask_011.png")).unwrap();
        let width = mask.data[..64].iter().filter(|v| **v > 0.5).count();
        assert_eq!(width, if count == 12 { 14 } else { 26 });
    }
}

#[test]
fn a_film_that_changes_its_size_is_refused_with_the_frame() {
    let Some(clips) = Clips::new() else { return };
    let part = |size: &str, name: &str| {
        let source = format!("-f lavfi -i testsrc2=s={size}:r=30 -frames:v 12 -c:v libx264 -f mpegts {name}");
        clips.try_make(&source, &[])
    };
    if !part("64x64", "a.ts") || !part("48x64", "b.ts") {
        return not_tested("libx264");
    }
    let bytes = ["a.ts", "b.ts"].map(|name| std::fs::read(clips.path(name)).unwrap()).concat();
    std::fs::write(clips.path("change.ts"), bytes).unwrap();
    let told = ["changes its size at frame 12: 64×64 pixels before, 48×64 from there on", "--frames 0..12"];
    clips.refused("change.ts", &[], &told);
    clips.gives("change.ts", &["--frames", "0..12"], 12.0, 30.0, "");
    // Where the container tells all stamps, it is found while decoding.
    clips.make("-f lavfi -i testsrc2=s=64x64:r=30 -frames:v 12 -c:v libx264 -bf 0 a.h264", &[]);
    clips.make("-f lavfi -i testsrc2=s=48x64:r=30 -frames:v 12 -c:v libx264 -bf 0 b.h264", &[]);
    let bytes = ["a.h264", "b.h264"].map(|name| std::fs::read(clips.path(name)).unwrap()).concat();
    std::fs::write(clips.path("change.h264"), bytes).unwrap();
    clips.make("-r 30 -i change.h264 -c copy change.mkv", &[]);
    clips.refused("change.mkv", &[], &told);
    clips.gives("change.mkv", &["--frames", "3..12"], 9.0, 30.0, "");
}

#[test]
fn titles_and_names_mean_nothing() {
    let Some(clips) = Clips::new() else { return };
    let name = "Stream #0: Video: 9 fps, 9 tbr.mp4";
    let title = "title=displaymatrix: rotation of 90.00 degrees";
    let comment = "comment=Stream #0:0: Video: fake, 1x1, 7 fps, 7 tbr, Audio: focallength35mmequivalent: 20";
    clips.make(
        "-f lavfi -i testsrc2=s=64x64:r=30 -frames:v 24 -c:v mpeg4",
        &["-metadata", title, "-metadata", comment, &format!("file:{name}")],
    );
    clips.gives(name, &[], 24.0, 30.0, "");
    let output = clips.run(name, &[]);
    assert!(output.status.code() == Some(2) && one_line(&output.stderr).contains("the camera is not given"));
}

#[test]
fn sound_and_other_films_move_nothing() {
    let Some(clips) = Clips::new() else { return };
    clips.pattern("30", 24, "-c:v mpeg4", "film.mp4");
    for (film, sound, name) in [("0.5", "0", "late.mp4"), ("0", "0.5", "early.mp4")] {
        let inputs = format!("-itsoffset {film} -i film.mp4 -itsoffset {sound} -f lavfi -i anullsrc=d=1.3");
        clips.make(&inputs, &["-map", "0:v", "-map", "1:a", "-c:v", "copy", "-c:a", "aac", name]);
        clips.gives(name, &[], 24.0, 30.0, "");
    }
    let films = "-f lavfi -i testsrc2=s=96x96:r=10:d=0.4 -f lavfi -i testsrc2=s=64x64:r=30:d=0.4 -map 0:v \
                 -map 1:v -c:v mpeg4 -disposition:v:0 0 -disposition:v:1 default";
    clips.make(films, &["films.mkv"]);
    let imported = clips.gives("films.mkv", &[], 12.0, 30.0, "");
    assert_eq!(imported.number("width"), 64.0);
}

#[test]
fn a_gif_is_doubted() {
    let Some(clips) = Clips::new() else { return };
    clips.pattern("10", 5, "", "clip.gif");
    clips.gives("clip.gif", &[], 5.0, 10.0, "a GIF counts time in hundredths of a second");
    clips.gives("clip.gif", &["--rate", "100"], 5.0, 100.0, "");
}

#[cfg(unix)]
#[test]
fn what_is_no_file_is_refused_at_once() {
    let Some(clips) = Clips::new() else { return };
    let made = Command::new("mkfifo").arg(clips.path("pipe.mp4")).status();
    assert!(made.is_ok_and(|status| status.success()));
    clips.pattern("30", 4, "-c:v mpeg4", "clip.mp4");
    let told = ["pipe.mp4", "is a pipe", "save it as a file first"];
    clips.refused("pipe.mp4", &[], &told);
    clips.refused("clip.mp4", &["--masks", "pipe.mp4"], &told);
    clips.refused("clip.mp4", &["--template", "pipe.mp4"], &told);
    clips.refused("clip.mp4", &["--plate", "pipe.mp4"], &told);
    clips.refused("/dev/stdin", &[], &["/dev/stdin", "save it as a file first"]);
    // Without --fov the file is asked for its lens first.
    let output = clips.run("pipe.mp4", &[]);
    assert!(output.status.code() == Some(3) && one_line(&output.stderr).contains("is a pipe"));
    let mut frames = Command::new(env!("CARGO_BIN_EXE_tessuto"));
    let output = frames.arg("frames").arg(clips.path("pipe.mp4")).arg(clips.path("look")).output().unwrap();
    assert!(output.status.code() == Some(3) && one_line(&output.stderr).contains("is a pipe"));
}

#[test]
fn lists_of_other_files_open_nothing() {
    let Some(clips) = Clips::new() else { return };
    clips.pattern("30", 4, "-c:v mpeg2video -f mpegts", "part.ts");
    let list = |name: &str, text: &str| std::fs::write(clips.path(name), text).unwrap();
    list(
        "hls.mp4",
        "#EXTM3U\n#EXT-X-VERSION:3\n#EXT-X-TARGETDURATION:1\n#EXTINF:1.0,\npart.ts\n#EXT-X-ENDLIST\n",
    );
    list("concat.mp4", "ffconcat version 1.0\nfile part.ts\n");
    list("dash.mp4", "<?xml version=\"1.0\"?>\n<MPD/>\n");
    for name in ["hls.mp4", "concat.mp4", "dash.mp4"] {
        clips.refused(name, &[], &[name, "is no film", "other files are not opened"]);
    }
    // One whose first bytes do not tell: the programs are held to containers of films.
    list("late.mp4", &format!("{}#EXTM3U\n#EXTINF:1.0,\npart.ts\n", "\n".repeat(100)));
    clips.refused("late.mp4", &[], &["late.mp4"]);
    list("note.mp4", "just a text");
    clips.refused("note.mp4", &[], &["finds no film in it"]);
}

/// A PNG of one grey value that is small until it is decoded.
fn bomb(path: &Path, [width, height]: [u32; 2]) {
    use std::io::Write as _;
    let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    let row = vec![0; width as usize + 1];
    (0..height).for_each(|_| packed.write_all(&row).unwrap());
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    let header = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[8, 0, 0, 0, 0]].concat();
    for (kind, content) in [(b"IHDR", header), (b"IDAT", packed.finish().unwrap()), (b"IEND", Vec::new())] {
        let mut sum = flate2::Crc::new();
        sum.update(kind);
        sum.update(&content);
        png.extend((content.len() as u32).to_be_bytes());
        png.extend(kind);
        png.extend(content);
        png.extend(sum.sum().to_be_bytes());
    }
    std::fs::write(path, png).unwrap();
}

#[test]
fn frames_that_take_too_much_memory_are_refused_before_they_take_it() {
    let Some(clips) = Clips::new() else { return };
    bomb(&clips.path("bomb.png"), [12_000, 8000]);
    clips.make("-loop 1 -framerate 30 -i bomb.png -t 0.13 -c:v copy", &["bomb.mkv"]);
    let told = ["12000×8000 pixels take 288000000 bytes; at most 268435456 are read"];
    clips.refused("bomb.mkv", &[], &told);
    std::fs::write(clips.path("bomb.y4m"), "YUV4MPEG2 W12000 H8000 F30:1 C420jpeg\nFRAME\n").unwrap();
    clips.refused("bomb.y4m", &[], &told);
    std::fs::write(clips.path("wide.y4m"), "YUV4MPEG2 W20000 H80 F30:1 C420jpeg\nFRAME\n").unwrap();
    clips.refused("wide.y4m", &[], &["20000×80 pixels", "16384"]);
}
