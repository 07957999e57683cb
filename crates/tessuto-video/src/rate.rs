//! From time stamps to a constant rate.

/// Rates of cameras and screens `[1/s]`, most of which exist slowed by a thousandth for television as well.
const USUAL: [f64; 14] =
    [24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 90.0, 100.0, 120.0, 240.0, 15.0, 12.0, 12.5, 10.0];
/// Stamps so far from even ones, as a fraction of an interval, still mean that one frame follows the other.
const JITTER: f64 = 0.05;
/// Spreads that differ by less, in ticks, do not distinguish two rates.
const ALIKE: f64 = 0.05;
/// A grid on which at least every other place has a frame is that of the camera.
const SPARSEST: f64 = 2.0;

/// How the frames follow each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Pace {
    /// Frames per second.
    pub fps: f64,
    /// Whether they come evenly.
    pub course: Course,
}

/// Whether frames come evenly.
#[derive(Clone, Debug, PartialEq)]
pub enum Course {
    /// One after the other, as far as the stamps are exact.
    Constant,
    /// At even times, but some of these have none: the frames that come late.
    Late(Vec<Late>),
    /// At any times.
    Varying,
}

/// A frame that comes later than one interval after the frame before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Late {
    /// Its number.
    pub frame: usize,
    /// Number of intervals since the frame before.
    pub intervals: usize,
}

/// The pace of frames shown at `times` `[s]`, in order, which are rounded to multiples of `tick` `[s]`. A single
/// frame, or several at one time, have no pace; they get one frame a second.
pub fn pace(times: &[f64], tick: f64) -> Pace {
    let count = times.len();
    let span = times.last().unwrap_or(&0.0) - times.first().unwrap_or(&0.0);
    if count < 2 || span <= 0.0 {
        return Pace { fps: 1.0, course: if count < 2 { Course::Constant } else { Course::Varying } };
    }
    let mean = (count - 1) as f64 / span;
    let every: Vec<usize> = (0..count).collect();
    if let Some(fps) = constant(times, &every, mean, tick) {
        return Pace { fps, course: Course::Constant };
    }
    let intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = intervals.clone();
    sorted.sort_by(f64::total_cmp);
    // The middle interval is that of the camera where few frames are missing, a short one where many are.
    for base in [sorted[sorted.len() / 2], sorted[sorted.len() / 10]] {
        if let Some((fps, slots)) =
            grid(times, &intervals, base, tick).filter(|(fps, _)| *fps < SPARSEST * mean)
        {
            let late = slots.windows(2).enumerate().filter(|(_, pair)| pair[1] - pair[0] > 1);
            let late: Vec<Late> =
                late.map(|(k, pair)| Late { frame: k + 1, intervals: pair[1] - pair[0] }).collect();
            return Pace { fps, course: if late.is_empty() { Course::Constant } else { Course::Late(late) } };
        }
    }
    Pace { fps: mean.round().max(1.0), course: Course::Varying }
}

/// The rate of which `times` at the places `slots` are roundings, near `guess`.
fn constant(times: &[f64], slots: &[usize], guess: f64, tick: f64) -> Option<f64> {
    let last = (slots[slots.len() - 1] - slots[0]) as f64;
    // Rounding, of times and in this computation.
    let slack = tick * (1.0 + 1e-6) + 1e-9 * last / guess;
    let explains = |fps: f64| {
        let (range, spread) = deviation(times, slots, fps);
        (range <= slack).then_some((fps, spread))
    };
    let usual = usual().filter(|fps| (last / fps - last / guess).abs() <= 2.0 * slack);
    let usual: Vec<(f64, f64)> = usual.filter_map(explains).collect();
    let least = usual.iter().map(|(_, spread)| *spread).fold(f64::INFINITY, f64::min);
    // Few stamps cannot distinguish a whole rate from one that is slowed by a thousandth; the whole ones come first.
    if let Some((fps, _)) = usual.into_iter().find(|(_, spread)| *spread <= least + ALIKE * tick) {
        return Some(fps);
    }
    // Rates of any other camera: that which the stamps name exactly, a whole one, and their mean.
    let round = exact(guess);
    let even = deviation(times, slots, round).0 <= 1e-9 * last / guess;
    let whole = explains(guess.round()).filter(|_| !even && guess >= 1.0);
    whole.or_else(|| explains(round)).map(|(fps, _)| fps)
}

/// All usual rates, with those of television.
fn usual() -> impl Iterator<Item = f64> {
    USUAL.iter().copied().chain(USUAL.iter().map(|fps| fps * 1000.0 / 1001.0))
}

/// A rate that is a whole number, or a whole number less a thousandth, up to the last digits, is just that.
fn exact(fps: f64) -> f64 {
    let candidates = [fps.round(), (fps * 1.001).round() * 1000.0 / 1001.0];
    candidates.into_iter().find(|candidate| (candidate - fps).abs() <= 1e-9 * fps).unwrap_or(fps)
}

/// Of the differences of `times` from even ones: their range, and their root mean square `[s]`.
fn deviation(times: &[f64], slots: &[usize], fps: f64) -> (f64, f64) {
    let apart = || times.iter().zip(slots).map(|(time, slot)| time - *slot as f64 / fps);
    let (low, high) = apart().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let mean = apart().sum::<f64>() / times.len() as f64;
    (high - low, (apart().map(|v| (v - mean).powi(2)).sum::<f64>() / times.len() as f64).sqrt())
}

/// The rate and the places of the frames if they come at multiples of an interval near `base`.
fn grid(times: &[f64], intervals: &[f64], base: f64, tick: f64) -> Option<(f64, Vec<usize>)> {
    if base <= 0.0 {
        return None;
    }
    let mut slots = vec![0];
    for interval in intervals {
        let steps = (interval / base).round();
        if !(1.0..1e6).contains(&steps) {
            return None;
        }
        slots.push(slots[slots.len() - 1] + steps as usize);
    }
    // The slope of the line through times over places is the interval.
    let count = times.len() as f64;
    let (mean_slot, mean_time) =
        (slots.iter().sum::<usize>() as f64 / count, times.iter().sum::<f64>() / count);
    let away = || slots.iter().map(|slot| *slot as f64 - mean_slot);
    let covariance: f64 = away().zip(times).map(|(slot, time)| slot * (time - mean_time)).sum();
    let fps = away().map(|slot| slot * slot).sum::<f64>() / covariance;
    if let Some(fps) = constant(times, &slots, fps, tick) {
        return Some((fps, slots));
    }
    let (range, spread) = deviation(times, &slots, fps);
    if range > 2.0 * tick.max(JITTER / fps) {
        return None;
    }
    // A usual rate is meant where the stamps are as even with it.
    let usual = usual().filter(|usual| deviation(times, &slots, *usual).1 <= 1.05 * spread + 0.3 * tick);
    let fps = usual.min_by(|a, b| (a - fps).abs().total_cmp(&(b - fps).abs())).unwrap_or(fps);
    Some((fps, slots))
}

/// The frame, of those shown at `times` `[s]`, that is nearest to each moment of a constant rate; the earlier of
/// two that are equally near. The last frame lasts as long as most do.
///
/// `None` if that would be more than `most` moments.
pub fn nearest(times: &[f64], fps: f64, tick: f64, most: usize) -> Option<Vec<usize>> {
    let mut intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    intervals.sort_by(f64::total_cmp);
    let begin = times.first()?;
    let end = times.last()? - begin + intervals.get(intervals.len() / 2).copied().unwrap_or(1.0 / fps);
    let count = (end * fps).round().max(1.0);
    if count > most as f64 {
        return None;
    }
    let mut frame = 0;
    let choose = |slot: usize| {
        let moment = begin + slot as f64 / fps;
        while let Some(next) = times.get(frame + 1) {
            if (next - moment).abs() + tick.max(1e-9) >= (times[frame] - moment).abs() {
                break;
            }
            frame += 1;
        }
        frame
    };
    Some((0..count as usize).map(choose).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times of `count` frames at `fps`, rounded to `tick`.
    fn rounded(count: usize, fps: f64, tick: f64) -> Vec<f64> {
        (0..count).map(|k| (k as f64 / fps / tick).round() * tick).collect()
    }

    fn steady(times: &[f64], tick: f64) -> f64 {
        let pace = pace(times, tick);
        assert_eq!(pace.course, Course::Constant, "{pace:?}");
        pace.fps
    }

    const NTSC: f64 = 30_000.0 / 1001.0;

    #[test]
    fn rates_are_exact_whatever_the_tick() {
        for fps in
            [24.0, 25.0, 30.0, 60.0, NTSC, 24_000.0 / 1001.0, 60_000.0 / 1001.0, 7.0, 37.0, 240.0, 1000.0]
        {
            for count in [100, 300, 2000] {
                for tick in [1e-3, 1.0 / 90_000.0, 1.0 / 15_360.0, 1e-9] {
                    if fps * tick > 0.5 {
                        continue;
                    }
                    assert_eq!(steady(&rounded(count, fps, tick), tick), fps, "{count} frames, tick {tick}");
                }
            }
        }
        assert_eq!(steady(&rounded(24, NTSC, 1.0 / 30_000.0), 1.0 / 30_000.0), NTSC);
        // Delays of a GIF.
        assert!((steady(&rounded(24, 100.0 / 3.0, 0.01), 0.01) - 100.0 / 3.0).abs() < 1e-9);
        assert_eq!(steady(&rounded(24, 0.5, 0.01), 0.01), 0.5);
    }

    #[test]
    fn milliseconds_of_few_frames() {
        for count in [2, 3, 5, 24] {
            assert_eq!(steady(&rounded(count, 30.0, 1e-3), 1e-3), 30.0, "{count} frames");
            assert_eq!(steady(&rounded(count, 25.0, 1e-3), 1e-3), 25.0, "{count} frames");
        }
        // Cut off instead of rounded.
        let cut: Vec<f64> = (0..50).map(|k| (f64::from(k) / 30.0 * 1000.0).floor() / 1000.0).collect();
        assert_eq!(steady(&cut, 1e-3), 30.0);
    }

    #[test]
    fn one_frame_has_no_rate_and_equal_stamps_neither() {
        assert_eq!(pace(&[], 0.0), Pace { fps: 1.0, course: Course::Constant });
        assert_eq!(pace(&[5.0], 0.0), Pace { fps: 1.0, course: Course::Constant });
        assert_eq!(steady(&[0.0, 0.04], 1.0 / 90_000.0), 25.0);
        assert_eq!(pace(&[1.0, 1.0, 1.0], 0.0).course, Course::Varying);
        let mut twice = rounded(30, 30.0, 1e-3);
        twice[7] = twice[6];
        assert_eq!(pace(&twice, 1e-3).course, Course::Varying);
    }

    #[test]
    fn a_dropped_frame_is_found_among_many() {
        let tick = 1.0 / 15_360.0;
        let mut times = rounded(145, 30.0, tick);
        times.remove(60);
        let found = pace(&times, tick);
        assert_eq!(found, Pace { fps: 30.0, course: Course::Late(vec![Late { frame: 60, intervals: 2 }]) });
        let frames = nearest(&times, 30.0, tick, 1000).unwrap();
        let expected: Vec<usize> = (0..145).map(|k| if k < 60 { k } else { k - 1 }).collect();
        assert_eq!(frames, expected);
        // In milliseconds, at a rate of television, several.
        let mut times = rounded(500, NTSC, 1e-3);
        for k in [400, 401, 20] {
            times.remove(k);
        }
        let found = pace(&times, 1e-3);
        let late = [20, 399, 400].map(|frame| Late { frame, intervals: 2 });
        assert_eq!(found, Pace { fps: NTSC, course: Course::Late(late.to_vec()) });
        // Every third place empty.
        let sparse: Vec<f64> = (0..90).filter(|k| k % 3 != 2).map(|k| f64::from(k) / 60.0).collect();
        assert!(
            matches!(pace(&sparse, 1e-6), Pace { fps: 60.0, course: Course::Late(_) }),
            "{:?}",
            pace(&sparse, 1e-6)
        );
    }

    #[test]
    fn jitter_of_a_camera_is_no_variable_rate() {
        // Up to 1 ms early or late.
        let times: Vec<f64> =
            (0..100).map(|k| f64::from(k) / 30.0 + 1e-3 * f64::from(k * 7919 % 201 - 100) / 100.0).collect();
        assert_eq!(steady(&times, 1e-6), 30.0);
        // A clock of its own is believed.
        let slow: Vec<f64> = (0..1000)
            .map(|k| f64::from(k) / 29.83 + 1e-3 * f64::from(k * 7919 % 201 - 100) / 100.0)
            .collect();
        assert!((steady(&slow, 1e-6) - 29.83).abs() < 1e-3);
    }

    #[test]
    fn a_browser_records_at_any_times() {
        let stamps = [
            0, 35, 70, 106, 141, 176, 212, 234, 269, 305, 340, 376, 411, 433, 469, 504, 539, 575, 610, 645,
            668, 703, 739, 774,
        ];
        let times = stamps.map(|ms| f64::from(ms) / 1000.0);
        assert_eq!(pace(&times, 1e-3), Pace { fps: 30.0, course: Course::Varying });
        let frames = nearest(&times, 30.0, 1e-3, 1000).unwrap();
        assert!(frames.len() == 24 && frames.is_sorted() && frames[0] == 0, "{frames:?}");
        for (slot, frame) in frames.iter().enumerate() {
            assert!((times[*frame] - slot as f64 / 30.0).abs() < 0.018, "{frames:?}");
        }
    }

    #[test]
    fn other_rates_take_the_nearest_frame() {
        let times = rounded(24, 30.0, 1e-3);
        assert_eq!(nearest(&times, 10.0, 1e-3, 1000).unwrap(), [0, 3, 6, 9, 12, 15, 18, 21]);
        let doubled = nearest(&times, 60.0, 1e-3, 1000).unwrap();
        assert_eq!(doubled, (0..48).map(|k| k / 2).collect::<Vec<_>>());
        assert_eq!(nearest(&times, 60.0, 1e-3, 47), None);
        // A frame an age later is no reason for an age of copies.
        assert_eq!(nearest(&[0.0, 1e12], 30.0, 1e-3, 1000), None);
        assert_eq!(nearest(&[0.0], 30.0, 1e-3, 1000), Some(vec![0]));
        assert_eq!(nearest(&[], 30.0, 1e-3, 1000), None);
    }
}
