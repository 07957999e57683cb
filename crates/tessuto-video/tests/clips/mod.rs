//! Clips of the kinds that phones and cameras record, made by ffmpeg.

// Not every program that has this module uses all of it.
#![allow(dead_code)]

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// One kind: its name, with the ending of its file, and ffmpeg's arguments between the source and the file.
pub struct Kind {
    pub name: &'static str,
    pub arguments: &'static str,
}

const fn kind(name: &'static str, arguments: &'static str) -> Kind {
    Kind { name, arguments }
}

/// Kinds whose frames and times are compared.
pub const KINDS: [Kind; 45] = [
    kind("baseline.mp4", "-c:v libx264 -profile:v baseline"),
    kind("main.mp4", "-c:v libx264 -profile:v main -bf 2"),
    kind(
        "high_pyramid.mp4",
        "-c:v libx264 -profile:v high -bf 5 -x264-params b-pyramid=normal:ref=5:b-adapt=2",
    ),
    kind("open_group.mp4", "-c:v libx264 -bf 3 -g 12 -x264-params open-gop=1:keyint=12"),
    kind("cavlc_8x8.mov", "-c:v libx264 -profile:v high -x264-params cabac=0:8x8dct=1:bframes=3"),
    kind("cabac_no_8x8.mp4", "-c:v libx264 -x264-params cabac=1:8x8dct=0:bframes=3:direct=temporal"),
    kind("slices_cabac.mp4", "-c:v libx264 -bf 2 -x264-params slices=4"),
    kind("slices_cavlc.mp4", "-c:v libx264 -profile:v baseline -x264-params slices=5"),
    kind("cropped.mp4", "-vf scale=322:246 -c:v libx264 -bf 2"),
    kind("cropped_hevc.mp4", "-vf scale=322:246 -c:v libx265 -tag:v hvc1"),
    kind("high_rate.mp4", "-r 240 -c:v libx264 -bf 2"),
    kind("variable_rate.mp4", "-vf select=lt(mod(n\\,7)\\,5) -fps_mode vfr -c:v libx264 -bf 2"),
    kind("ntsc.mov", "-r 30000/1001 -c:v libx264 -bf 2"),
    kind("beside_sound.mp4", "-f lavfi -i sine=d=1.5 -c:a aac -c:v libx264 -bf 2 -shortest"),
    kind("moov_first.mp4", "-c:v libx264 -bf 2 -movflags faststart"),
    kind("negative_offsets.mp4", "-c:v libx264 -bf 2 -movflags negative_cts_offsets"),
    kind("no_edit_list.mp4", "-c:v libx264 -bf 2 -use_editlist 0"),
    kind("fragments.mp4", "-c:v libx264 -bf 2 -g 12 -movflags frag_keyframe+empty_moov"),
    kind(
        "fragments_of_moof.mp4",
        "-c:v libx264 -bf 2 -g 12 -movflags frag_keyframe+empty_moov+default_base_moof",
    ),
    kind("fragments_late.mp4", "-c:v libx264 -bf 2 -g 12 -movflags frag_keyframe+delay_moov"),
    kind("fragments_hybrid.mp4", "-c:v libx264 -bf 2 -g 12 -movflags frag_keyframe"),
    kind("matroska.mkv", "-c:v libx264 -bf 2"),
    kind("matroska_hevc.mkv", "-c:v libx265"),
    kind("matroska_sound.mkv", "-f lavfi -i sine=d=1.5 -c:a libvorbis -c:v libx264 -bf 2 -shortest"),
    kind("matroska_live.mkv", "-c:v libx264 -bf 2 -live 1"),
    kind("weighted.mp4", "-vf fade=in:0:20 -c:v libx264 -bf 3 -x264-params weightp=2:weightb=1"),
    kind("high10.mp4", "-pix_fmt yuv420p10le -c:v libx264 -bf 2"),
    kind("high422.mov", "-pix_fmt yuv422p10le -c:v libx264 -bf 2"),
    kind("full_range.mp4", "-vf scale=out_range=pc -pix_fmt yuvj420p -color_range pc -c:v libx264 -bf 2"),
    kind("tagged_709.mp4", "-color_primaries bt709 -color_trc bt709 -colorspace bt709 -c:v libx264 -bf 2"),
    kind("hevc_main.mp4", "-c:v libx265 -tag:v hvc1"),
    kind("hevc_hev1.mp4", "-c:v libx265 -tag:v hev1"),
    kind("hevc_main10.mov", "-pix_fmt yuv420p10le -c:v libx265 -tag:v hvc1"),
    kind(
        "hevc_hlg.mov",
        "-pix_fmt yuv420p10le -color_primaries bt2020 -color_trc arib-std-b67 -colorspace bt2020nc -c:v \
         libx265 -tag:v hvc1",
    ),
    kind(
        "hevc_open_group.mp4",
        "-c:v libx265 -tag:v hvc1 -x265-params open-gop=1:keyint=12:min-keyint=12:bframes=4",
    ),
    kind("hevc_weighted.mp4", "-vf fade=in:0:20 -c:v libx265 -tag:v hvc1 -x265-params weightp=1:weightb=1"),
    kind("hevc_slices.mp4", "-c:v libx265 -tag:v hvc1 -x265-params slices=3"),
    kind("hevc_full_range.mp4", "-vf scale=out_range=pc -color_range pc -c:v libx265 -tag:v hvc1"),
    kind("hevc_fragments.mp4", "-c:v libx265 -tag:v hvc1 -g 12 -movflags frag_keyframe+empty_moov"),
    kind("scaled.mp4", "-c:v libx264 -bf 2 -x264-params cqm=jvt"),
    kind("hevc_scaled.mp4", "-c:v libx265 -tag:v hvc1 -x265-params scaling-list=default:log-level=none"),
    kind(
        "hevc_layers.mp4",
        "-c:v libx265 -tag:v hvc1 -x265-params temporal-layers=2:bframes=4:log-level=none",
    ),
    kind("long_references.mkv", "-c:v libx264 -bf 8 -x264-params ref=16:b-pyramid=strict"),
    kind("stream.h264", "-c:v libx264 -bf 3 -g 15"),
    kind("stream.hevc", "-c:v libx265 -x265-params keyint=15:open-gop=1"),
];

/// Whether ffmpeg and ffprobe with the encoders are there.
pub fn ffmpeg_is_there() -> bool {
    let runs = |program: &str| {
        Command::new(program).arg("-version").stdout(Stdio::null()).status().is_ok_and(|s| s.success())
    };
    runs("ffmpeg") && runs("ffprobe")
}

/// Runs ffmpeg with what is printed to its output.
pub fn ffmpeg(arguments: &[&str]) -> Vec<u8> {
    let out =
        Command::new("ffmpeg").args(["-v", "error", "-nostdin", "-y"]).args(arguments).output().unwrap();
    assert!(out.status.success(), "ffmpeg {arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
    out.stdout
}

/// Strength of the noise of a camera in bad light, for which most bits of a clip are spent then.
pub const MUCH_NOISE: u8 = 12;

/// Makes the clip of a kind, `seconds` long and of `size` before its own filters, with much noise.
pub fn make(folder: &Path, kind: &Kind, size: &str, seconds: &str) -> PathBuf {
    make_of(folder, kind, size, seconds, MUCH_NOISE)
}

/// The same with noise of a strength of its own.
pub fn make_of(folder: &Path, kind: &Kind, size: &str, seconds: &str, noise: u8) -> PathBuf {
    let path = folder.join(kind.name);
    let source = format!("testsrc2=s={size}:r=30:d={seconds},noise=alls={noise}:allf=t,format=yuv420p");
    let mut arguments = vec!["-f", "lavfi", "-i", &source];
    let own: Vec<&str> = kind.arguments.split(' ').collect();
    arguments.extend(&own);
    if !own.contains(&"-preset") {
        arguments.extend(["-preset", if kind.arguments.contains("libx265") { "superfast" } else { "fast" }]);
    }
    if kind.arguments.contains("libx265") && !kind.arguments.contains("-x265-params") {
        arguments.extend(["-x265-params", "log-level=none"]);
    }
    arguments.push(path.to_str().unwrap());
    ffmpeg(&arguments);
    path
}

/// The frames as ffmpeg decodes them, as bytes.
pub fn raw(path: &Path, more: &[&str]) -> Vec<u8> {
    let mut arguments = vec!["-threads", "1", "-noautorotate", "-i", path.to_str().unwrap(), "-map", "0:v:0"];
    arguments.extend(more);
    arguments.extend(["-fps_mode", "passthrough", "-f", "rawvideo", "-"]);
    ffmpeg(&arguments)
}

/// What ffprobe says of every frame: `field` as text.
pub fn probe(path: &Path, field: &str) -> Vec<String> {
    let out = Command::new("ffprobe")
        .args(["-v", "error", "-select_streams", "v:0", "-show_entries", field, "-of", "csv=p=0"])
        .arg(path)
        .output()
        .unwrap();
    let text = String::from_utf8(out.stdout).unwrap();
    text.lines().map(|l| l.trim_end_matches(',').to_owned()).filter(|l| !l.is_empty()).collect()
}
