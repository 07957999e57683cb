//! Time of decoding against ffmpeg's one thread: `against_ffmpeg [SIZE] [SECONDS] [NOISE]`.
//!
//! Clips of many kinds are made by ffmpeg (1280×720, 3 s and noise of strength 12 by default) and decoded by both,
//! planes compared byte by byte; then the colours of some against those of ffmpeg.

#[path = "../tests/clips/mod.rs"]
mod clips;

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use tessuto_video::native;

/// Kinds whose time is taken.
const TIMED: [&str; 14] = [
    "baseline.mp4",
    "main.mp4",
    "high_pyramid.mp4",
    "open_group.mp4",
    "cavlc_8x8.mov",
    "slices_cabac.mp4",
    "weighted.mp4",
    "matroska.mkv",
    "high10.mp4",
    "hevc_main.mp4",
    "hevc_main10.mov",
    "hevc_open_group.mp4",
    "hevc_weighted.mp4",
    "stream.hevc",
];
/// ffmpeg's colours in two steps, with 16 bits between, as exact as they can be had; and in one, as it has them if
/// not told otherwise.
const EXACT: &str = "scale=flags=accurate_rnd+full_chroma_int+full_chroma_inp+bilinear:\
                     in_h_chr_pos=0:in_v_chr_pos=128,format=yuv444p16,\
                     scale=flags=accurate_rnd+full_chroma_int,format=rgb24";
const PLAIN: &str = "scale";

/// Time that this thread has had of a processor, as Linux counts it, so that other programs do not count; else the
/// clock's.
fn processor() -> Duration {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    let counted = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let counted = counted.split(' ').next().and_then(|n| n.parse().ok());
    counted.map_or_else(|| START.get_or_init(Instant::now).elapsed(), Duration::from_nanos)
}

/// Time of a processor that ffmpeg's decoding with one thread takes, without its start.
fn theirs(path: &Path) -> Duration {
    let run = |more: &[&str]| {
        let mut command = Command::new("ffmpeg");
        command.args(["-benchmark", "-nostdin", "-threads", "1", "-i"]).arg(path);
        let out = command.args(more).args(["-an", "-f", "null", "-"]).output().unwrap();
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        let seconds = |name: &str| -> f64 {
            let value = said.split(name).nth(1).unwrap().split('s').next().unwrap();
            value.parse().unwrap()
        };
        Duration::from_secs_f64(seconds("utime=") + seconds("stime="))
    };
    let begin = run(&["-frames:v", "1"]);
    run(&["-fps_mode", "passthrough"]).saturating_sub(begin)
}

/// Time of decoding here, frames, and whether all bytes are the same.
fn ours(path: &Path) -> (Duration, usize, bool) {
    let start = processor();
    let frames = native::open(path)
        .unwrap()
        .map(|frame| frame.map(|f| f.size))
        .collect::<Result<Vec<_>, _>>()
        .unwrap();
    let time = processor() - start;
    let mut at = 0;
    let expected = clips::raw(path, &[]);
    let same = native::open(path).unwrap().all(|frame| {
        let bytes = frame.unwrap().bytes();
        at += bytes.len();
        expected.get(at - bytes.len()..at) == Some(&bytes)
    });
    (time, frames.len(), same && at == expected.len())
}

/// Mean and largest difference of the colours from ffmpeg's, in 1/255, and milliseconds per frame.
fn colours(path: &Path, filters: &str) -> (f64, u8, f64) {
    let expected = clips::raw(path, &["-vf", filters, "-pix_fmt", "rgb24"]);
    let mut film = native::open(path).unwrap();
    let (mut sum, mut largest, mut at, mut time, mut frames) = (0u64, 0, 0, Duration::ZERO, 0);
    while let Some(frame) = film.next() {
        let frame = frame.unwrap();
        let start = processor();
        let rgb = film.colours().rgb(&frame);
        time += processor() - start;
        frames += 1;
        for (a, b) in rgb.iter().zip(&expected[at..]) {
            sum += u64::from(a.abs_diff(*b));
            largest = largest.max(a.abs_diff(*b));
        }
        at += rgb.len();
    }
    (sum as f64 / at as f64, largest, time.as_secs_f64() * 1e3 / f64::from(frames))
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let size = arguments.next().unwrap_or("1280x720".into());
    let seconds = arguments.next().unwrap_or("3".into());
    let noise: u8 =
        arguments.next().map_or(clips::MUCH_NOISE, |n| n.parse().expect("the strength of the noise"));
    let folder = tempfile::tempdir().unwrap();
    println!(
        "| clip ({size}, noise {noise}) | Mbit/s | frames | same bytes | here [ms/frame] | ffmpeg, one thread \
         [ms/frame] | ratio |"
    );
    println!("|---|---|---|---|---|---|---|");
    for kind in clips::KINDS.iter().filter(|k| TIMED.contains(&k.name)) {
        let path = clips::make_of(folder.path(), kind, &size, &seconds, noise);
        let bits = std::fs::metadata(&path).unwrap().len() as f64 * 8.0;
        let (here, frames, same) = ours(&path);
        let there = theirs(&path);
        let each = |time: Duration| time.as_secs_f64() * 1e3 / frames as f64;
        let ratio = here.as_secs_f64() / there.as_secs_f64();
        println!(
            "| {} | {:.0} | {frames} | {same} | {:.2} | {:.2} | {ratio:.2} |",
            kind.name,
            1e-6 * bits / (frames as f64 / 30.0),
            each(here),
            each(there)
        );
    }
    println!(
        "\n| colours of | mean difference | largest | of ffmpeg's own way, mean | largest | [ms/frame] |"
    );
    println!("|---|---|---|---|---|---|");
    for name in ["main.mp4", "tagged_709.mp4", "full_range.mp4", "hevc_hlg.mov"] {
        let kind = clips::KINDS.iter().find(|k| k.name == name).expect("listed");
        let path = clips::make(folder.path(), kind, "640x360", "0.5");
        let (mean, largest, time) = colours(&path, EXACT);
        let (plain, most, _) = colours(&path, PLAIN);
        println!("| {name} | {mean:.3} | {largest} | {plain:.3} | {most} | {time:.2} |");
    }
}
