//! Time of decoding against ffmpeg's one thread: `against_ffmpeg [SIZE] [SECONDS] [NOISE] [KIND,...]`.
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

/// Each is measured so often, and the shortest taken: what other programs do makes it longer.
const REPEATS: usize = 5;

/// Time by the clock, and of processors.
type Times = [Duration; 2];

/// The shortest of each of several.
fn shortest(mut measure: impl FnMut() -> Times) -> Times {
    let all: Vec<Times> = (0..REPEATS).map(|_| measure()).collect();
    [0, 1].map(|k| all.iter().map(|times| times[k]).min().unwrap_or_default())
}

/// Time that all threads of this program have had of processors, as Linux counts it, in hundredths of a second.
fn processors() -> Duration {
    let counted = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = counted.rsplit(')').next().unwrap_or_default().split_whitespace();
    // `utime` and `stime`, the fields 14 and 15; the name in parentheses is the second.
    Duration::from_millis(10 * fields.skip(11).take(2).filter_map(|n| n.parse::<u64>().ok()).sum::<u64>())
}

/// Time of ffmpeg's decoding with one thread, without its start.
fn theirs(path: &Path) -> Times {
    let run = |more: &[&str]| {
        let mut command = Command::new("ffmpeg");
        command.args(["-benchmark", "-nostdin", "-threads", "1", "-i"]).arg(path);
        let out = command.args(more).args(["-an", "-f", "null", "-"]).output().unwrap();
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        let seconds = |name: &str| -> f64 {
            let value = said.split(name).nth(1).unwrap().split('s').next().unwrap();
            value.parse().unwrap()
        };
        [seconds("rtime="), seconds("utime=") + seconds("stime=")].map(Duration::from_secs_f64)
    };
    let begin = shortest(|| run(&["-frames:v", "1"]));
    let whole = shortest(|| run(&["-fps_mode", "passthrough"]));
    [0, 1].map(|k| whole[k].saturating_sub(begin[k]))
}

/// Time of decoding here, frames, and whether all bytes are the same.
fn ours(path: &Path) -> (Times, usize, bool) {
    let mut frames = 0;
    let times = shortest(|| {
        let (start, before) = (Instant::now(), processors());
        frames = native::open(path).unwrap().inspect(|frame| assert!(frame.is_ok())).count();
        [start.elapsed(), processors() - before]
    });
    let mut at = 0;
    let expected = clips::raw(path, &[]);
    let same = native::open(path).unwrap().all(|frame| {
        let bytes = frame.unwrap().bytes();
        at += bytes.len();
        expected.get(at - bytes.len()..at) == Some(&bytes)
    });
    (times, frames, same && at == expected.len())
}

/// Mean and largest difference of the colours from ffmpeg's, in 1/255, and milliseconds per frame.
fn colours(path: &Path, filters: &str) -> (f64, u8, f64) {
    let expected = clips::raw(path, &["-vf", filters, "-pix_fmt", "rgb24"]);
    let mut film = native::open(path).unwrap();
    let (mut sum, mut largest, mut at, mut time, mut frames) = (0u64, 0, 0, Duration::ZERO, 0);
    while let Some(frame) = film.next() {
        let frame = frame.unwrap();
        let start = Instant::now();
        let rgb = film.colours().rgb(&frame);
        time += start.elapsed();
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
    let kinds = arguments.next().unwrap_or(TIMED.join(","));
    let folder = tempfile::tempdir().unwrap();
    println!(
        "Milliseconds a frame, by the clock and of processors, the shortest of {REPEATS}; ffmpeg has one thread.\n"
    );
    println!(
        "| clip ({size}, noise {noise}) | Mbit/s | frames | same bytes | here: clock | processors \
         | ffmpeg: clock | processor | clocks' ratio |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for kind in clips::KINDS.iter().filter(|k| kinds.split(',').any(|kind| kind == k.name)) {
        let path = clips::make_of(folder.path(), kind, &size, &seconds, noise);
        let bits = std::fs::metadata(&path).unwrap().len() as f64 * 8.0;
        let (here, frames, same) = ours(&path);
        let there = theirs(&path);
        let ratio = here[0].as_secs_f64() / there[0].as_secs_f64();
        let [a, b, c, d] =
            [here[0], here[1], there[0], there[1]].map(|t| t.as_secs_f64() * 1e3 / frames as f64);
        println!(
            "| {} | {:.0} | {frames} | {same} | {a:.2} | {b:.2} | {c:.2} | {d:.2} | {ratio:.2} |",
            kind.name,
            1e-6 * bits / (frames as f64 / 30.0)
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
