//! What a film says beside its frames, and which films are refused.

mod clips;

use std::path::{Path, PathBuf};

use tessuto_video::native::{self, Chroma, Limits, Refused};
use tessuto_video::{Matrix, Stream, Transfer};

/// A folder, or nothing where ffmpeg is missing.
fn folder(test: &str) -> Option<tempfile::TempDir> {
    if clips::ffmpeg_is_there() {
        return Some(tempfile::tempdir().unwrap());
    }
    println!("NOT TESTED: {test}, ffmpeg is not installed");
    None
}

fn clip(folder: &Path, name: &'static str, arguments: &'static str) -> PathBuf {
    clips::make(folder, &clips::Kind { name, arguments }, "160x120", "0.4")
}

fn stream(path: &Path) -> Stream {
    native::open(path).unwrap().stream().clone()
}

fn not_handled(path: &Path) -> String {
    match native::open(path).map(|mut film| film.find_map(Result::err)) {
        Err(Refused::NotHandled(what)) | Ok(Some(Refused::NotHandled(what))) => what,
        other => panic!("{}: {:?}", path.display(), other.map_err(Some).unwrap_or_else(|e| e)),
    }
}

fn damaged(path: &Path) -> String {
    match native::open(path).map(|mut film| film.find_map(Result::err)) {
        Err(Refused::Damaged(what)) | Ok(Some(Refused::Damaged(what))) => what,
        other => panic!("{}: {:?}", path.display(), other.map_err(Some).unwrap_or_else(|e| e)),
    }
}

#[test]
fn turned_films_say_so() {
    let Some(folder) = folder("turned films") else { return };
    let plain = clip(folder.path(), "plain.mp4", "-c:v libx264");
    let mut turns = vec![stream(&plain).turn];
    for (name, rotate) in [("a.mp4", "rotate=90"), ("b.mov", "rotate=180"), ("c.mp4", "rotate=270")] {
        let path = folder.path().join(name);
        let [from, to] = [&plain, &path].map(|p| p.to_str().unwrap());
        clips::ffmpeg(&["-i", from, "-c", "copy", "-metadata:s:v:0", rotate, to]);
        let film = stream(&path);
        assert_eq!(film.size, [160, 120], "the frames themselves are not turned");
        // ffmpeg turns what it decodes, as players do: its first frame is ours, turned by as much.
        let frame = native::open(&path).unwrap().next().unwrap().unwrap();
        let ours = turned(&frame.bytes()[..160 * 120], film.turn);
        let theirs = clips::ffmpeg(&["-i", to, "-frames:v", "1", "-f", "rawvideo", "-"]);
        assert!(ours == theirs[..160 * 120], "{name}: {}", film.turn);
        turns.push(film.turn);
    }
    turns.sort_unstable();
    assert_eq!(turns, [0, 90, 180, 270]);
}

/// 160 by 120 values turned clockwise.
fn turned(values: &[u8], turn: u32) -> Vec<u8> {
    let (width, height) = (160, 120);
    let at = |x: usize, y: usize| values[y * width + x];
    match turn {
        0 => values.to_vec(),
        90 => (0..width * height).map(|k| at(k / height, height - 1 - k % height)).collect(),
        180 => values.iter().rev().copied().collect(),
        _ => (0..width * height).map(|k| at(width - 1 - k / height, k % height)).collect(),
    }
}

#[test]
fn aspect_colour_and_bits_are_those_of_the_file() {
    let Some(folder) = folder("aspect, colour and bits") else { return };
    for (name, codec) in
        [("a.mp4", "-c:v libx264"), ("b.mkv", "-c:v libx264"), ("c.mov", "-c:v libx265 -tag:v hvc1")]
    {
        let arguments: &'static str = format!("-vf setsar=4/3 {codec}").leak();
        assert_eq!(stream(&clip(folder.path(), name, arguments)).pixel_aspect, [4, 3], "{name}");
    }
    let hlg = stream(&clip(
        folder.path(),
        "hlg.mov",
        "-pix_fmt yuv420p10le -color_primaries bt2020 -color_trc arib-std-b67 -colorspace bt2020nc -c:v \
         libx265 -tag:v hvc1",
    ));
    assert_eq!(
        (hlg.transfer, hlg.matrix, hlg.bits, hlg.full_range),
        (Transfer::Hlg, Matrix::Bt2020, 10, false)
    );
    assert_eq!((hlg.codec.as_str(), hlg.pixel_aspect), ("hevc", [1, 1]));
    let pq = stream(&clip(
        folder.path(),
        "pq.mp4",
        "-pix_fmt yuv420p10le -color_trc smpte2084 -c:v libx265 -tag:v hvc1",
    ));
    assert_eq!((pq.transfer, pq.matrix), (Transfer::Pq, Matrix::Unspecified));
    let full =
        stream(&clip(folder.path(), "full.mp4", "-pix_fmt yuvj420p -colorspace smpte170m -c:v libx264"));
    assert_eq!((full.full_range, full.matrix, full.bits), (true, Matrix::Bt601, 8));
    assert_eq!((full.codec.as_str(), full.tick), ("h264", 1.0 / 15360.0));
    assert_eq!(stream(&folder.path().join("b.mkv")).tick, 1e-3);
    // Where the stream is silent, the container's word counts.
    let plain = clip(folder.path(), "plain.mp4", "-c:v libx264");
    assert_eq!(stream(&plain).matrix, Matrix::Unspecified);
    let said = folder.path().join("said.mp4");
    let [from, to] = [&plain, &said].map(|p| p.to_str().unwrap());
    clips::ffmpeg(&["-i", from, "-c", "copy", "-colorspace", "bt709", "-movflags", "write_colr", to]);
    assert_eq!(stream(&said).matrix, Matrix::Bt709);
    let frame = native::open(&clip(folder.path(), "wide.mov", "-pix_fmt yuv422p10le -c:v libx264"))
        .unwrap()
        .next()
        .unwrap()
        .unwrap();
    assert_eq!((frame.chroma, frame.bits, frame.size), (Chroma::Yuv422, 10, [160, 120]));
}

#[test]
fn slow_motion_says_its_rate() {
    let Some(folder) = folder("slow motion") else { return };
    let slow = clip(
        folder.path(),
        "slow.mp4",
        "-movflags use_metadata_tags -metadata com.android.capture.fps=240.0 -c:v libx264 -bf 0",
    );
    assert_eq!(stream(&slow).capture_rate, Some(240.0));
    assert_eq!(stream(&clip(folder.path(), "plain.mp4", "-c:v libx264")).capture_rate, None);
    // Android writes a number of 4 bytes (type 23), ffmpeg text (type 1).
    let mut bytes = std::fs::read(&slow).unwrap();
    let at = bytes.windows(4).position(|w| w == b"data").unwrap();
    assert_eq!(&bytes[at + 12..at + 17], b"240.0");
    bytes[at + 7] = 23;
    bytes[at + 12..at + 16].copy_from_slice(&120f32.to_be_bytes());
    // The fifth byte is cut off the box by its size, and left over behind it.
    let size = at - 4;
    bytes[size + 3] -= 1;
    std::fs::write(&slow, bytes).unwrap();
    assert_eq!(stream(&slow).capture_rate, Some(120.0));
}

#[test]
fn the_track_is_the_one_that_ffmpeg_shows() {
    let Some(folder) = folder("tracks") else { return };
    let small = clip(folder.path(), "small.mp4", "-vf scale=80:60 -c:v libx264");
    let large = clip(folder.path(), "large.mp4", "-c:v libx264");
    for (name, first, second, marks, wanted) in [
        ("larger.mp4", &small, &large, ["default", "default"], [160, 120]),
        ("larger_first.mp4", &large, &small, ["default", "default"], [160, 120]),
        ("enabled.mp4", &small, &large, ["default", "0"], [80, 60]),
        ("default.mkv", &large, &small, ["0", "default"], [80, 60]),
    ] {
        let path = folder.path().join(name);
        let [a, b, to] = [first, second, &path].map(|p| p.to_str().unwrap());
        let [x, y] = marks;
        clips::ffmpeg(&[
            "-i",
            a,
            "-i",
            b,
            "-map",
            "0",
            "-map",
            "1",
            "-c",
            "copy",
            "-disposition:v:0",
            x,
            "-disposition:v:1",
            y,
            to,
        ]);
        assert_eq!(stream(&path).size, wanted, "{name}");
        let theirs = clips::ffmpeg(&["-i", to, "-frames:v", "1", "-f", "rawvideo", "-"]);
        assert_eq!(theirs.len(), wanted[0] * wanted[1] * 3 / 2, "{name}: what ffmpeg shows");
    }
}

#[test]
fn what_is_not_decoded_here_is_said() {
    let Some(folder) = folder("what is not decoded") else { return };
    let folder = folder.path();
    for (name, arguments, wanted) in [
        ("interlaced.mp4", "-flags +ildct+ilme -c:v libx264", "interlaced coding"),
        ("fields.mkv", "-flags +ildct+ilme -x264-params tff=1 -c:v libx264", "interlaced"),
        ("vp9.webm", "-c:v libvpx-vp9 -cpu-used 8", "V_VP9"),
        ("mpeg4.mp4", "-c:v mpeg4", "mp4v"),
        ("mjpeg.mov", "-c:v mjpeg", "the codec jpeg"),
        ("444.mp4", "-pix_fmt yuv444p -c:v libx264", "4:4:4"),
        ("lossless.mp4", "-qp 0 -c:v libx264", "lossless"),
        ("422.mp4", "-pix_fmt yuv422p -c:v libx265", "4:2:2"),
        ("12.mp4", "-pix_fmt yuv420p12le -c:v libx265", "12 bits"),
        ("avi.avi", "-c:v mpeg4", "neither MP4"),
        (
            "locked.mp4",
            "-c:v libx264 -encryption_scheme cenc-aes-ctr -encryption_key 76a6c65c5ea762046bd749a2e632ccbb \
             -encryption_kid a7e61c373e219033c21091fa607bf3b8",
            "encrypted",
        ),
    ] {
        let what = not_handled(&clip(folder, name, arguments));
        assert!(what.contains(wanted), "{name}: {what}");
    }
    let [plain, askew] = [clip(folder, "plain.mp4", "-c:v libx264"), folder.join("askew.mp4")];
    let [from, to] = [&plain, &askew].map(|p| p.to_str().unwrap());
    clips::ffmpeg(&["-i", from, "-c", "copy", "-metadata:s:v:0", "rotate=30", to]);
    assert!(not_handled(&askew).contains("turned by no multiple"));
    // Without its first frame, a film begins with one that refers to it.
    let whole = clip(folder, "whole.h264", "-c:v libx264 -bf 0");
    let bytes = std::fs::read(&whole).unwrap();
    let starts: Vec<usize> = (0..bytes.len() - 3).filter(|&k| bytes[k..k + 3] == [0, 0, 1]).collect();
    let kind = |at: &usize| bytes[at + 3] & 31;
    let key = starts.iter().position(|at| kind(at) == 5).unwrap();
    let rest = starts.iter().skip(key).find(|at| kind(at) == 1).unwrap();
    let raw = folder.join("amid.h264");
    std::fs::write(&raw, [&bytes[..starts[key]], &bytes[*rest..]].concat()).unwrap();
    assert!(not_handled(&raw).contains("begins amid"));
    // So does one that begins with its fourth frame, by its edit list, where every frame is said to be a beginning.
    let amid = clip(folder, "amid.mp4", "-c:v libx264 -bf 0");
    let mut bytes = std::fs::read(&amid).unwrap();
    let place = |bytes: &[u8], kind: &[u8]| bytes.windows(4).position(|w| w == kind).unwrap();
    let at = place(&bytes, b"elst") + 16;
    assert_eq!(bytes[at..at + 4], [0; 4]);
    bytes[at..at + 4].copy_from_slice(&(3u32 * 512).to_be_bytes());
    std::fs::write(&amid, &bytes).unwrap();
    let frames = native::open(&amid).unwrap().filter(|frame| frame.is_ok()).count();
    assert_eq!((frames, clips::raw(&amid, &[]).len()), (9, 9 * 160 * 120 * 3 / 2));
    let at = place(&bytes, b"stss");
    bytes[at..at + 4].copy_from_slice(b"free");
    std::fs::write(&amid, &bytes).unwrap();
    assert!(not_handled(&amid).contains("begins amid"));
    // Two streams of different sizes, one behind the other.
    let [a, b] = [("s.h264", "-vf scale=96:64 -c:v libx264"), ("l.h264", "-c:v libx264")]
        .map(|(n, k)| clip(folder, n, k));
    let both = folder.join("both.h264");
    std::fs::write(&both, [std::fs::read(a).unwrap(), std::fs::read(b).unwrap()].concat()).unwrap();
    let what = not_handled(&both);
    assert!(what.contains("96×64 px, then 160×120"), "{what}");
    assert!(not_handled(folder).contains("no ordinary file"));
    std::fs::write(folder.join("text"), "a text").unwrap();
    assert!(not_handled(&folder.join("text")).contains("neither MP4"));
    std::fs::write(folder.join("empty"), "").unwrap();
    assert!(not_handled(&folder.join("empty")).contains("neither MP4"));
    assert!(matches!(native::open(&folder.join("missing")), Err(Refused::Unreadable(_))));
}

#[test]
fn files_that_are_cut_off_are_damaged() {
    let Some(folder) = folder("files that are cut off") else { return };
    let folder = folder.path();
    for (name, arguments) in [
        ("last.mp4", "-c:v libx264"),
        ("first.mp4", "-c:v libx264 -movflags faststart"),
        ("a.mkv", "-c:v libx264"),
        ("fragments.mp4", "-c:v libx264 -g 4 -movflags frag_keyframe+empty_moov"),
    ] {
        let path = clip(folder, name, arguments);
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(native::open(&path).unwrap().filter(Result::is_ok).count(), 12);
        std::fs::write(&path, &bytes[..bytes.len() * 7 / 10]).unwrap();
        damaged(&path);
    }
}

#[test]
fn holes_of_zeros_are_damage() {
    let Some(folder) = folder("holes of zeros") else { return };
    for (name, arguments) in [
        ("a.mp4", "-c:v libx264"),
        ("b.mkv", "-c:v libx264 -x264-params slices=4"),
        ("c.mov", "-c:v libx265 -tag:v hvc1"),
    ] {
        let path = clip(folder.path(), name, arguments);
        let mut bytes = std::fs::read(&path).unwrap();
        // Amid a frame: what is said of the film stands before and behind.
        let at = bytes.len() / 4;
        bytes[at..at + 32].fill(0);
        std::fs::write(&path, &bytes).unwrap();
        let what = damaged(&path);
        assert!(what.contains("frame ") && what.contains("hole"), "{name}: {what}");
    }
}

#[test]
fn asking_for_too_much_is_refused_before_it_is_taken() {
    let Some(folder) = folder("bounds") else { return };
    let path = clip(folder.path(), "a.mp4", "-c:v libx264");
    let within = |limits| native::open_within(&path, limits).map(|_| ()).unwrap_err().to_string();
    let default = Limits::default();
    let sides = within(Limits { side: 128, ..default });
    assert!(sides.contains("160×120 px; sides of 1 to 128"), "{sides}");
    let bytes = within(Limits { frame_bytes: 1000, ..default });
    assert!(bytes.contains("up to 1000"), "{bytes}");
    let frames = within(Limits { frames: 11, ..default });
    assert!(frames.contains("12 frames; up to 11"), "{frames}");
}

#[test]
fn parameter_sets_may_be_in_the_frames_alone() {
    let Some(folder) = folder("parameter sets in the frames") else { return };
    for (name, arguments, kinds, configuration, count) in [
        ("avc.mp4", "-c:v libx264 -bsf:v dump_extra", [b"avc1", b"avc3"], b"avcC", 4 + 5),
        (
            "hevc.mp4",
            "-c:v libx265 -tag:v hvc1 -x265-params repeat-headers=1:log-level=none",
            [b"hvc1", b"hev1"],
            b"hvcC",
            4 + 22,
        ),
    ] {
        let path = clip(folder.path(), name, arguments);
        let frames =
            |path: &Path| native::open(path).unwrap().map(|f| f.unwrap().bytes()).collect::<Vec<_>>();
        let whole = frames(&path);
        let mut bytes = std::fs::read(&path).unwrap();
        let place = |bytes: &[u8], kind: &[u8; 4]| bytes.windows(4).position(|w| w == kind).unwrap();
        let at = place(&bytes, kinds[0]);
        bytes[at..at + 4].copy_from_slice(kinds[1]);
        // No sets follow: what is left of the box is never read.
        let at = place(&bytes, configuration) + count;
        bytes[at] &= 0xE0;
        std::fs::write(&path, &bytes).unwrap();
        assert!(frames(&path) == whole && whole.len() == 12, "{name}");
    }
}
