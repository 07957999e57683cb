//! Clips of many kinds: planes have the bytes, frames the number and the times that ffmpeg gives them.

mod clips;

use std::path::Path;

use tessuto_video::native;

/// Times of the frames as ffprobe has them `[s]`, the first at 0.
fn times(path: &Path) -> Vec<f64> {
    let times = clips::probe(path, "frame=best_effort_timestamp_time");
    let times: Vec<f64> = times.iter().map(|t| t.parse().unwrap()).collect();
    times.iter().map(|t| t - times[0]).collect()
}

/// What differs between what is decoded here and by ffmpeg.
fn differences(path: &Path) -> Result<usize, String> {
    let mut film = native::open(path).map_err(|e| format!("{e:?}"))?;
    let stream = film.stream().clone();
    let expected = clips::raw(path, &[]);
    let mut at = 0;
    let mut count = 0;
    for frame in film.by_ref() {
        let bytes = frame.map_err(|e| format!("frame {count}: {e:?}"))?.bytes();
        let Some(wanted) = expected.get(at..at + bytes.len()) else {
            return Err(format!("more than {count} frames"));
        };
        if bytes != wanted {
            let different = bytes.iter().zip(wanted).filter(|(a, b)| a != b).count();
            return Err(format!("frame {count}: {different} of {} bytes differ", bytes.len()));
        }
        at += bytes.len();
        count += 1;
    }
    if at != expected.len() {
        return Err(format!("{count} frames, {} bytes of more are missing", expected.len() - at));
    }
    if path.extension().is_some_and(|e| e == "h264" || e == "hevc") {
        return if stream.times.is_empty() { Ok(count) } else { Err("a stream has times".into()) };
    }
    let wanted = times(path);
    if stream.times.len() != wanted.len() {
        return Err(format!("{} times instead of {}", stream.times.len(), wanted.len()));
    }
    // ffprobe prints millionths.
    match stream.times.iter().zip(&wanted).position(|(a, b)| (a - b).abs() > 1.1e-6) {
        Some(k) => Err(format!("frame {k} at {} instead of {}", stream.times[k], wanted[k])),
        None => Ok(count),
    }
}

#[test]
fn clips_of_many_kinds_have_ffmpegs_bytes_and_times() {
    if !clips::ffmpeg_is_there() {
        println!("NOT TESTED: clips of many kinds, ffmpeg is not installed");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut failures = Vec::new();
    for kind in &clips::KINDS {
        let path = clips::make(folder.path(), kind, "176x144", "1");
        match differences(&path) {
            Ok(frames) if frames < 20 => failures.push(format!("{}: {frames} frames", kind.name)),
            Ok(_) => {}
            Err(what) => failures.push(format!("{}: {what}", kind.name)),
        }
    }
    assert!(failures.is_empty(), "{} of {}: {failures:#?}", failures.len(), clips::KINDS.len());
}

#[test]
fn cut_clips_show_what_ffmpeg_shows() {
    if !clips::ffmpeg_is_there() {
        println!("NOT TESTED: cut clips, ffmpeg is not installed");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut failures = Vec::new();
    for codec in [
        "-c:v libx264 -bf 3 -g 20",
        "-c:v libx265 -tag:v hvc1 -x265-params keyint=20:open-gop=1:log-level=none",
    ] {
        let kind = clips::Kind { name: "whole.mp4", arguments: codec };
        let whole = clips::make(folder.path(), &kind, "176x144", "2");
        for (name, from, to) in
            [("a.mp4", "0.5", "9"), ("b.mov", "0.9", "0.5"), ("c.mkv", "0.9", "0.5"), ("d.mp4", "1.4", "9")]
        {
            let path = folder.path().join(name);
            let [input, output] = [&whole, &path].map(|p| p.to_str().unwrap());
            clips::ffmpeg(&["-ss", from, "-i", input, "-t", to, "-c", "copy", output]);
            match differences(&path) {
                Ok(frames) if (10..50).contains(&frames) => {}
                other => failures.push(format!("{codec}, {name} from {from}: {other:?}")),
            }
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

/// ffmpeg's colours as exact as they can be had: it brings colours to every pixel in one step and mixes them in
/// another, with 16 bits between; in one step, it takes the nearer of two rows.
const EXACT: &str = "flags=accurate_rnd+full_chroma_int+full_chroma_inp+bilinear";

#[test]
fn colours_are_ffmpegs_to_one_of_255() {
    if !clips::ffmpeg_is_there() {
        println!("NOT TESTED: colours, ffmpeg is not installed");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, rows) in [
        ("main.mp4", ":in_v_chr_pos=128"),
        ("tagged_709.mp4", ":in_v_chr_pos=128"),
        ("full_range.mp4", ":in_v_chr_pos=128"),
        ("hevc_hlg.mov", ":in_v_chr_pos=128"),
        ("high422.mov", ""),
    ] {
        let kind = clips::KINDS.iter().find(|k| k.name == name).unwrap();
        let path = clips::make(folder.path(), kind, "176x144", "0.2");
        let filters =
            format!("scale={EXACT}:in_h_chr_pos=0{rows},format=yuv444p16,scale={EXACT},format=rgb24");
        let expected = clips::raw(&path, &["-vf", &filters]);
        let mut film = native::open(&path).unwrap();
        let mut ours = Vec::new();
        while let Some(rgb) = film.next_rgb() {
            ours.extend(rgb.unwrap());
        }
        assert_eq!(ours.len(), expected.len(), "{name}");
        let differences = || ours.iter().zip(&expected).map(|(a, b)| a.abs_diff(*b));
        let mean = differences().map(f64::from).sum::<f64>() / ours.len() as f64;
        println!("{name}: mean {mean:.4}, largest {:?}", differences().max());
        assert!(
            differences().max() <= Some(1) && mean < 0.03,
            "{name}: mean {mean}, largest {:?}",
            differences().max()
        );
    }
}
