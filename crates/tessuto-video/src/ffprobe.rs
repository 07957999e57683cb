//! What ffprobe says of a file as JSON.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use crate::capture;
use crate::ffmpeg::Programs;
use crate::film::Options;
use crate::frames::OTHER_PART;
use crate::refusal::Refusal;
use crate::stream::{Fields, Matrix, Stream, Transfer};

/// Elementary streams: what time stamps ffmpeg gives for them, it has made up.
const UNTIMED: &str = "h264 hevc vvc evc mjpeg mjpeg_2000 mpjpeg m4v mpegvideo h261 h263 vc1 obu av1 \
                       cavsvideo avs2 avs3 dirac dnxhd jpeg_pipe png_pipe";
/// Codecs in MP4, QuickTime and Matroska of which each packet is one frame that is shown.
const ONE_EACH: &str = "h264 hevc av1 vp9";
/// Codecs whose frames stand alone.
const INTRA: &str =
    "mjpeg prores ffv1 dnxhd rawvideo png huffyuv ffvhuff utvideo qtrle gif v210 jpeg2000 cfhd";
/// Codecs whose frames may say that they are turned, each for itself.
const TURNING: &str = "h264 hevc";
/// Most frames by which the order of display lags behind that of decoding.
const LAG: usize = 16;
/// This many packets show whether frames are interlaced.
const FIRST: usize = 8;
const WHAT_IS_READ: &str = "name a video file, or a folder of PNG or JPEG images";

/// What is asked of the file.
const ENTRIES: &str = "library_version=name,major,minor:format=format_name:format_tags:stream=index,codec_name,\
     width,height,pix_fmt,field_order,sample_aspect_ratio,color_range,color_space,color_transfer,time_base,\
     bits_per_raw_sample:stream_tags:\
     stream_disposition=default,attached_pic:stream_side_data=rotation:packet=stream_index,pts,dts,flags";
/// What is asked of decoded frames.
const FRAME_ENTRIES: &str = "frame=best_effort_timestamp,width,height,pix_fmt,interlaced_frame,\
     top_field_first:frame_side_data=rotation";

#[derive(Deserialize, Default)]
#[serde(default)]
struct Answer {
    streams: Vec<Track>,
    packets: Vec<Packet>,
    frames: Vec<Shown>,
    format: Format,
    library_versions: Vec<Library>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Format {
    format_name: String,
    tags: BTreeMap<String, String>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Library {
    name: String,
    major: u32,
    minor: u32,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Track {
    index: usize,
    codec_name: String,
    width: usize,
    height: usize,
    pix_fmt: String,
    field_order: String,
    sample_aspect_ratio: String,
    color_range: String,
    color_space: String,
    color_transfer: String,
    time_base: String,
    bits_per_raw_sample: String,
    tags: BTreeMap<String, String>,
    disposition: Disposition,
    side_data_list: Vec<SideData>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Disposition {
    default: u8,
    attached_pic: u8,
}

#[derive(Deserialize, Default, Debug)]
#[serde(default)]
struct SideData {
    rotation: Option<f64>,
}

#[derive(Deserialize)]
struct Packet {
    #[serde(default)]
    stream_index: usize,
    pts: Option<i64>,
    dts: Option<i64>,
    #[serde(default)]
    flags: Flags,
}

/// Of the letters only two are of use.
#[derive(Clone, Copy, Default, Deserialize)]
#[serde(from = "String")]
struct Flags {
    is_key: bool,
    is_discarded: bool,
}

impl From<String> for Flags {
    fn from(letters: String) -> Self {
        Self { is_key: letters.contains('K'), is_discarded: letters.contains('D') }
    }
}

/// A decoded frame.
#[derive(Deserialize, Default, Debug)]
#[serde(default)]
struct Shown {
    best_effort_timestamp: Option<i64>,
    width: usize,
    height: usize,
    pix_fmt: String,
    interlaced_frame: u8,
    top_field_first: u8,
    side_data_list: Vec<SideData>,
}

/// Names and values of the metadata of the file at `path` and of its tracks.
pub(crate) fn tags(path: &Path, programs: &Programs, options: &Options) -> Option<Vec<(String, String)>> {
    let asked = ["-show_entries", "format_tags:stream_tags"];
    let answer = programs.probe::<Answer>(path, &asked, options).ok()?.0?;
    Some(answer.streams.into_iter().map(|track| track.tags).chain([answer.format.tags]).flatten().collect())
}

/// A file, looked at.
pub(crate) struct Look {
    pub stream: Stream,
    pub stored: usize,
    pub programs: Programs,
    pub notes: Vec<String>,
}

/// What the container at `path` says of the film that a player shows.
pub(crate) fn look(path: &Path, mut programs: Programs, options: &Options) -> Result<Look, Refusal> {
    let most = format!("%+#{}", options.max_frames.saturating_add(1));
    let asked = ["-select_streams", "v", "-show_entries", ENTRIES, "-read_intervals", &most];
    let (answer, last) = programs.probe::<Answer>(path, &asked, options)?;
    let nothing =
        |said: &str| Refusal::new(format!("ffprobe, of ffmpeg, finds no film in it: {said}"), WHAT_IS_READ);
    let Some(answer) = answer else {
        // A decoder that may not have such frames may end the program.
        expect_declared_size(path, "v:0", &programs, options)?;
        return Err(nothing(&last));
    };
    let track = shown(&answer.streams).ok_or_else(|| nothing("no stream of images"))?;
    programs.index = track.index;
    programs.knows_fps_mode = (answer.library_versions.iter())
        .any(|library| library.name == "libavutil" && (library.major, library.minor) >= (57, 28));
    expect_size(path, track, &programs, options)?;
    let all: Vec<&Packet> =
        answer.packets.iter().filter(|packet| packet.stream_index == track.index).collect();
    let packets: Vec<&Packet> = all.iter().copied().filter(|packet| !packet.flags.is_discarded).collect();
    if answer.packets.len() > options.max_frames && options.end.is_none_or(|end| end > options.max_frames) {
        let mut refusal = Refusal::new(
            format!("has more than {} frames", options.max_frames),
            "take a part of it, or cut it first",
        );
        refusal.part = Some(0..options.max_frames.min(1000));
        return Err(refusal);
    }
    let in_packets = stamps_of_packets(&answer.format.format_name, &track.codec_name, &all);
    // Packets that are decoded only for those behind them stand in front.
    let hidden = all.iter().position(|packet| !packet.flags.is_discarded).unwrap_or(0);
    let first = match &in_packets {
        None => options.max_frames,
        // One that is turned otherwise than those before may stand anywhere.
        Some(_) if TURNING.split(' ').any(|name| name == track.codec_name) => {
            let wanted = options.end.map_or(options.max_frames, |end| hidden + end + LAG);
            wanted.max(hidden + FIRST).min(options.max_frames)
        }
        Some(_) => hidden + FIRST,
    };
    let mut frames = decoded(path, &programs, first, options)?;
    if let Some(change) = change(&frames) {
        if options.end.is_none_or(|end| end > change.0) {
            return Err(change.1);
        }
        frames.truncate(change.0);
    }
    let Some(head) = frames.first() else {
        return Err(Refusal::new(
            "holds no frame that ffmpeg can decode",
            "play it to see whether it is whole; copy it again",
        ));
    };
    let size = [head.width, head.height];
    options.expect_size(size)?;
    let is_untimed =
        (answer.format.format_name.split(',')).any(|name| UNTIMED.split(' ').any(|raw| raw == name));
    let of_frames = || frames.iter().map(|f| f.best_effort_timestamp).collect();
    let stamps: Option<Vec<i64>> =
        in_packets.or_else(of_frames).or_else(|| stamps_of_decoding(&packets, frames.len()));
    let stored = stamps.as_ref().map_or(frames.len(), Vec::len);
    let (numerator, denominator) = fraction(&track.time_base, '/').unwrap_or((0, 1));
    let begin = stamps.as_ref().and_then(|s| s.first().copied()).unwrap_or(0);
    let time = |stamp: i64| (stamp - begin) as f64 * f64::from(numerator) / f64::from(denominator);
    let times =
        stamps.filter(|_| !is_untimed && numerator > 0).unwrap_or_default().into_iter().map(time).collect();
    let tags = [&answer.format.tags, &track.tags];
    let stream = Stream {
        codec: track.codec_name.clone(),
        times,
        size,
        pixel_aspect: fraction(&track.sample_aspect_ratio, ':').map_or([1, 1], |(a, b)| [a, b]),
        fields: fields(&track.field_order, &frames[..frames.len().min(FIRST)]),
        turn: turn(track, head),
        full_range: track.color_range == "pc" || head.pix_fmt.starts_with("yuvj"),
        matrix: matrix(&track.color_space),
        transfer: match track.color_transfer.as_str() {
            "smpte2084" => Transfer::Pq,
            "arib-std-b67" => Transfer::Hlg,
            _ => Transfer::Standard,
        },
        bits: track.bits_per_raw_sample.parse().ok().filter(|bits| *bits > 0).unwrap_or(8),
        capture_rate: capture::rate(tags.into_iter(), path),
        tick: f64::from(numerator) / f64::from(denominator),
    };
    Ok(Look { stream, stored, programs, notes: notes(&answer.format.format_name) })
}

fn notes(container: &str) -> Vec<String> {
    let gif = "a GIF counts time in hundredths of a second, and players show delays below 0.02 s as 0.1 s: \
               its rate may not be that of the recording; if another is known, give it (rate)";
    (container == "gif").then(|| gif.to_owned()).into_iter().collect()
}

/// The film that a player shows: the one marked as such, then the largest; no covers.
fn shown(tracks: &[Track]) -> Option<&Track> {
    let films = tracks.iter().filter(|track| track.disposition.attached_pic == 0);
    films.rev().max_by_key(|track| (track.disposition.default, track.width * track.height))
}

/// Refuses frames that are too large by what the container says, before any is decoded.
fn expect_size(path: &Path, track: &Track, programs: &Programs, options: &Options) -> Result<(), Refusal> {
    if track.width > 0 && track.height > 0 {
        return options.expect_size([track.width, track.height]);
    }
    // A decoder that refused such frames has taken the size back; the container's is still there.
    expect_declared_size(path, &track.index.to_string(), programs, options)?;
    Err(Refusal::new(
        format!(
            "does not state the size of its frames, or they take more than {} bytes each",
            options.max_bytes
        ),
        "play it to see whether it is whole; make it smaller, e.g. ffmpeg -i IN -vf scale=1920:-2 OUT.mp4",
    ))
}

/// Refuses frames that are too large by what the head of the container says; nothing is refused where it says nothing.
fn expect_declared_size(
    path: &Path,
    index: &str,
    programs: &Programs,
    options: &Options,
) -> Result<(), Refusal> {
    let asked = ["-nofind_stream_info", "-select_streams", index, "-show_entries", "stream=width,height"];
    // Nothing is decoded here, and decoders that are bounded would not even be asked.
    let unbounded = Options { max_bytes: u64::MAX, ..*options };
    let declared = programs.probe::<Answer>(path, &asked, &unbounded)?.0.unwrap_or_default();
    let told = declared.streams.first().filter(|track| track.width > 0 && track.height > 0);
    told.map_or(Ok(()), |track| options.expect_size([track.width, track.height]))
}

/// The stamps in the order of display of what is shown, where each packet is known to be one frame.
fn stamps_of_packets(container: &str, codec: &str, packets: &[&Packet]) -> Option<Vec<i64>> {
    let is_in = |list: &str| list.split(' ').any(|name| name == codec);
    let is_indexed = ["mov", "matroska"].iter().any(|name| container.split(',').any(|part| part == *name));
    if !(is_in(INTRA) || is_indexed && is_in(ONE_EACH)) {
        return None;
    }
    let shown = packets.iter().filter(|packet| !packet.flags.is_discarded);
    let mut stamps = shown.map(|packet| packet.pts).collect::<Option<Vec<i64>>>()?;
    let first = packets.first().filter(|packet| packet.flags.is_key)?.pts?;
    // Frames before the first key frame may not be decoded, and a clock that jumps back gives no order.
    let dts: Vec<i64> = packets.iter().filter_map(|packet| packet.dts).collect();
    if stamps.iter().any(|stamp| *stamp < first) || dts.windows(2).any(|pair| pair[1] < pair[0]) {
        return None;
    }
    stamps.sort_unstable();
    Some(stamps)
}

/// AVI and what is stored as in AVI has no time of display, but one of decoding, at the same rate.
fn stamps_of_decoding(packets: &[&Packet], frames: usize) -> Option<Vec<i64>> {
    let stamps = packets.iter().map(|packet| packet.dts).collect::<Option<Vec<i64>>>()?;
    (stamps.len() >= frames && stamps.is_sorted()).then(|| stamps[..frames].to_vec())
}

/// What is said of the frames in the first `count` packets, in the order of display.
fn decoded(path: &Path, programs: &Programs, count: usize, options: &Options) -> Result<Vec<Shown>, Refusal> {
    let (index, most) = (programs.index.to_string(), format!("%+#{count}"));
    let asked = ["-select_streams", &index, "-show_entries", FRAME_ENTRIES, "-read_intervals", &most];
    Ok(programs.probe::<Answer>(path, &asked, options)?.0.unwrap_or_default().frames)
}

/// Where frames change their size or pixel format: the number of the first other one, and the refusal.
fn change(frames: &[Shown]) -> Option<(usize, Refusal)> {
    let head = frames.first()?;
    let turn = |f: &Shown| f.side_data_list.iter().find_map(|data| data.rotation).unwrap_or(0.0);
    let kind = |f: &Shown| (f.width, f.height, f.pix_fmt.clone(), turn(f).to_bits());
    let at = frames.iter().position(|frame| kind(frame) != kind(head))?;
    let other = &frames[at];
    let what = if turn(head) != turn(other) {
        format!("changes its rotation at frame {at}: {}° before, {}° from there on", turn(head), turn(other))
    } else if (head.width, head.height) == (other.width, other.height) {
        format!(
            "changes its pixel format at frame {at}: {} before, {} from there on",
            head.pix_fmt, other.pix_fmt
        )
    } else {
        format!(
            "changes its size at frame {at}: {}×{} pixels before, {}×{} from there on",
            head.width, head.height, other.width, other.height
        )
    };
    let part = Some(0..at);
    Some((at, Refusal { part, ..Refusal::new(what, OTHER_PART) }))
}

/// Whether the film changes its size, by decoding all of it.
pub(crate) fn change_of_size(path: &Path, programs: &Programs, options: &Options) -> Option<Refusal> {
    let frames = decoded(path, programs, options.max_frames, options).ok()?;
    change(&frames).map(|(_, refusal)| refusal)
}

/// Frames know better than the container, which may say nothing; of its two letters the second is the order of display.
fn fields(said: &str, frames: &[Shown]) -> Fields {
    let flagged: Vec<&Shown> = frames.iter().filter(|frame| frame.interlaced_frame == 1).collect();
    let top = match flagged.first() {
        Some(frame) => frame.top_field_first == 1,
        None if ["tt", "bt"].contains(&said) => true,
        None if ["bb", "tb"].contains(&said) => false,
        None => return Fields::Progressive,
    };
    if top { Fields::TopFirst } else { Fields::BottomFirst }
}

/// By how much frames are turned clockwise, 0 to 359 degrees.
fn turn(track: &Track, head: &Shown) -> u32 {
    // What frames say of themselves goes before what the container says, as in ffmpeg.
    let said = head.side_data_list.iter().chain(&track.side_data_list);
    let counterclockwise = said.into_iter().find_map(|data| data.rotation);
    // Before it was data of its own, it was a tag.
    let tag = || track.tags.get("rotate").and_then(|turn| turn.parse::<f64>().ok());
    let degrees =
        counterclockwise.map(|turn| -turn).or_else(tag).filter(|turn| turn.is_finite()).unwrap_or(0.0);
    (degrees.rem_euclid(360.0).round() as u32) % 360
}

fn matrix(name: &str) -> Matrix {
    match name {
        "gbr" => Matrix::Rgb,
        "bt709" => Matrix::Bt709,
        "smpte170m" | "bt470bg" => Matrix::Bt601,
        "bt2020nc" => Matrix::Bt2020,
        "fcc" => Matrix::Other(4),
        "smpte240m" => Matrix::Other(7),
        "ycgco" => Matrix::Other(8),
        "bt2020c" => Matrix::Other(10),
        _ => Matrix::Unspecified,
    }
}

/// Two whole numbers above 0.
fn fraction(text: &str, between: char) -> Option<(u32, u32)> {
    let (a, b) = text.split_once(between)?;
    let (a, b) = (a.parse().ok()?, b.parse().ok()?);
    (a > 0 && b > 0).then_some((a, b))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As ffprobe 5.1 writes it, shortened.
    const SAID: &str = r#"{
        "library_versions": [{"name": "libavutil", "major": 57, "minor": 28}],
        "packets": [
            {"stream_index": 1, "pts": 0, "dts": -1024, "flags": "K_"},
            {"stream_index": 1, "pts": 1024, "dts": -512, "flags": "__"},
            {"stream_index": 1, "pts": 512, "dts": 0, "flags": "___"},
            {"stream_index": 1, "pts": -512, "dts": 0, "flags": "_D"}
        ],
        "programs": [],
        "streams": [
            {"index": 0, "codec_name": "mjpeg", "width": 4000, "height": 3000,
                "disposition": {"default": 1, "attached_pic": 1}},
            {"index": 1, "codec_name": "h264", "width": 320, "height": 240, "field_order": "tt",
                "sample_aspect_ratio": "4:3",
             "time_base": "1/15360", "disposition": {"default": 0, "attached_pic": 0}, "color_space": "bt709",
             "side_data_list": [{}, {"side_data_type": "Display Matrix", "rotation": -90}]},
            {"index": 2, "codec_name": "h264", "width": 160, "height": 120,
                "disposition": {"default": 0, "attached_pic": 0}}
        ],
        "format": {"format_name": "mov,mp4,m4a,3gp,3g2,mj2", "tags": {"comment": "Stream #0:0: Video: 7 fps, 7 tbr"}}
    }"#;

    #[test]
    fn what_ffprobe_says_is_read_as_data() {
        let answer: Answer = serde_json::from_str(SAID).unwrap();
        let track = shown(&answer.streams).unwrap();
        assert_eq!(
            (track.index, turn(track, &Shown::default()), matrix(&track.color_space)),
            (1, 90, Matrix::Bt709)
        );
        assert_eq!(fraction(&track.sample_aspect_ratio, ':'), Some((4, 3)));
        assert_eq!((fraction("0:1", ':'), fraction("N/A", ':'), fraction("", '/')), (None, None, None));
        let packets: Vec<&Packet> = answer.packets.iter().collect();
        let container = &answer.format.format_name;
        assert_eq!(stamps_of_packets(container, "h264", &packets), Some(vec![0, 512, 1024]));
        // A packet may be no frame, or none that is shown.
        assert_eq!(stamps_of_packets("mpegts", "h264", &packets), None);
        assert_eq!(stamps_of_packets("matroska,webm", "vp8", &packets), None);
        assert_eq!(stamps_of_packets(container, "h264", &packets[1..]), None, "no key frame first");
        let early = Packet { stream_index: 1, pts: Some(-1), dts: None, flags: Flags::default() };
        let early: Vec<&Packet> = packets.iter().copied().chain([&early]).collect();
        assert_eq!(stamps_of_packets(container, "h264", &early), None, "before the first key frame");
        assert_eq!(stamps_of_decoding(&packets, 3), Some(vec![-1024, -512, 0]));
        assert_eq!(stamps_of_decoding(&packets, 5), None);
    }

    #[test]
    fn the_film_is_the_one_marked_and_then_the_largest() {
        let track = |index, default, width| Track {
            index,
            width,
            height: 100,
            disposition: Disposition { default, attached_pic: 0 },
            ..Track::default()
        };
        let index = |tracks: &[Track]| shown(tracks).map(|track| track.index);
        assert_eq!(index(&[track(0, 0, 900), track(1, 1, 100)]), Some(1));
        assert_eq!(index(&[track(0, 0, 100), track(1, 0, 900), track(2, 0, 900)]), Some(1));
        assert_eq!(index(&[]), None);
    }

    #[test]
    fn frames_tell_their_fields() {
        let frame = |interlaced_frame, top_field_first| Shown {
            interlaced_frame,
            top_field_first,
            ..Shown::default()
        };
        assert_eq!(fields("progressive", &[frame(0, 0)]), Fields::Progressive);
        assert_eq!(fields("", &[frame(0, 0), frame(1, 0)]), Fields::BottomFirst);
        assert_eq!(fields("bb", &[frame(1, 1)]), Fields::TopFirst);
        assert_eq!((fields("bt", &[]), fields("tb", &[])), (Fields::TopFirst, Fields::BottomFirst));
    }

    #[test]
    fn a_change_is_named_with_its_frame() {
        let frame =
            |width, format: &str| Shown { width, height: 320, pix_fmt: format.into(), ..Shown::default() };
        assert!(change(&[frame(320, "yuv420p"), frame(320, "yuv420p")]).is_none());
        let (at, refusal) = change(&[frame(320, "yuv420p"), frame(240, "yuv420p")]).unwrap();
        assert!(at == 1 && refusal.what.contains("at frame 1: 320×320 pixels before, 240×320"), "{refusal}");
        let turned =
            Shown { side_data_list: vec![SideData { rotation: Some(-90.0) }], ..frame(320, "yuv420p") };
        let (_, refusal) = change(&[frame(320, "yuv420p"), turned]).unwrap();
        assert!(refusal.what.contains("rotation at frame 1: 0° before, -90°"), "{refusal}");
        assert!(
            change(&[frame(8, "yuv420p"), frame(8, "yuv422p")])
                .unwrap()
                .1
                .what
                .contains("pixel format at frame 1")
        );
    }
}
