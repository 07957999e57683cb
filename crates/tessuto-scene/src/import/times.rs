//! Names that are times: seconds, nanoseconds as robots and headsets write them, date and time of day.

use std::path::{Path, PathBuf};

use super::names::{Parts, alike, changing, gap};
use tessuto_core::error::Result;

/// A pause of this many usual ones is a gap.
const GAP: f64 = 1.6;
/// A rate is a whole number except for its clock, as a fraction of it.
const CLOCK: f64 = 2e-3;
/// A given rate and that of the names differ by more than this fraction of it: it is said.
const OTHER_RATE: f64 = 0.05;
/// Digits of a time since 1970 in milliseconds, microseconds, nanoseconds, and of the second in each.
const SINCE_1970: [(usize, i32); 3] = [(13, 3), (16, 6), (19, 9)];
/// Seconds since 1970 that can be the time of a recording: 2001 to 2096.
const RECORDED: (f64, f64) = (1e9, 4e9);

/// When every image was taken.
#[derive(Debug, PartialEq)]
pub(super) struct Times {
    /// Seconds after the first of them.
    seconds: Vec<f64>,
    /// What the names distinguish `[s]`.
    resolution: f64,
}

/// Orders `images` by the times in their names, if that is what their numbers are, and returns the frame rate.
///
/// # Errors
/// [`Error::Input`](tessuto_core::Error::Input) of a gap, unless `allow_gaps`.
pub(super) fn order(
    images: &mut [PathBuf],
    folder: &Path,
    allow_gaps: bool,
    given: Option<f64>,
    notes: &mut Vec<String>,
) -> Result<Option<f64>> {
    let Some(Times { seconds, resolution }) = of(images) else { return Ok(None) };
    let mut order: Vec<usize> = (0..images.len()).collect();
    order.sort_by(|a, b| seconds[*a].total_cmp(&seconds[*b]));
    images.clone_from_slice(&order.iter().map(|k| images[*k].clone()).collect::<Vec<_>>());
    let seconds: Vec<f64> = order.iter().map(|k| seconds[*k]).collect();
    let pauses: Vec<f64> = seconds.windows(2).map(|p| p[1] - p[0]).collect();
    let mut sorted = pauses.clone();
    sorted.sort_by(f64::total_cmp);
    let (least, usual, most) = (sorted[0], sorted[sorted.len() / 2], sorted[sorted.len() - 1]);
    if let Some(k) = pauses.iter().position(|pause| *pause > GAP * usual).filter(|_| !allow_gaps) {
        return Err(gap(images, folder, k));
    }
    let span: f64 = pauses.iter().sum();
    let mut rate = if allow_gaps { 1.0 / usual } else { pauses.len() as f64 / span };
    let unsure = CLOCK.max(2.0 * resolution / span);
    if (rate - rate.round()).abs() <= unsure * rate && rate.round() >= 1.0 {
        rate = rate.round();
    }
    let place = folder.display();
    let shown = (rate * 1e3).round() / 1e3;
    match given {
        Some(fps) if (fps - rate).abs() > OTHER_RATE * fps => {
            notes.push(format!("{place}: the names give {shown} images per second, but {fps} were given"));
        }
        Some(_) => {}
        None => notes.push(format!(
            "{place}: the names are times: {shown} images per second, {:.1} to {:.1} ms apart, taken as evenly spaced",
            1e3 * least,
            1e3 * most
        )),
    }
    Ok(Some(rate))
}

/// The times in the names; `None` if they are none, or not all different.
pub(super) fn of(images: &[PathBuf]) -> Option<Times> {
    let parts = alike(images).filter(|parts| parts.len() > 1)?;
    let changing = changing(&parts);
    let (found, resolution) = since_1970(&parts, &changing)
        .or_else(|| decimal(&parts, &changing))
        .or_else(|| date(&parts, &changing))?;
    let first = found.iter().copied().min()?;
    let mut sorted = found.clone();
    sorted.sort_unstable();
    let different = sorted.windows(2).all(|p| p[1] > p[0]);
    let seconds = found.iter().map(|t| (t - first) as f64 * 1e-9).collect();
    different.then_some(Times { seconds, resolution })
}

/// Nanoseconds of every name, and the resolution `[s]`.
type Found = Option<(Vec<i128>, f64)>;

/// One long number: 1403636579763555584.
fn since_1970(parts: &[Parts], changing: &[usize]) -> Found {
    let [column] = changing[..] else { return None };
    let digits = parts[0].numbers[column].len();
    let (_, decimals) = SINCE_1970.into_iter().find(|(n, _)| *n == digits)?;
    let all: Option<Vec<i128>> = parts.iter().map(|p| p.numbers[column].parse().ok()).collect();
    let unit = 10_i128.pow((9 - decimals) as u32);
    let all: Vec<i128> = all?.into_iter().map(|v| v * unit).collect();
    let recorded = |t: &i128| (RECORDED.0..RECORDED.1).contains(&(*t as f64 * 1e-9));
    all.iter().all(recorded).then_some((all, 10_f64.powi(-decimals)))
}

/// Seconds with a fraction: 1305031102.175304.
fn decimal(parts: &[Parts], changing: &[usize]) -> Found {
    let last = *changing.last()?;
    let point = last.checked_sub(1)?;
    // What is between the two numbers; the first text is before the first number.
    let is_point = parts[0].texts[last] == "." && changing.iter().all(|k| [point, last].contains(k));
    let long = |p: &Parts| p.numbers[point].len() >= 7 || p.numbers[last].len() >= 3;
    if !is_point || !parts.iter().all(long) {
        return None;
    }
    let all = parts.iter().map(|p| {
        let whole: i128 = p.numbers[point].parse().ok()?;
        Some(whole * 1_000_000_000 + fraction(&p.numbers[last])?)
    });
    let decimals = parts.iter().map(|p| p.numbers[last].len()).max()?;
    Some((all.collect::<Option<_>>()?, 10_f64.powi(-(decimals.min(9) as i32))))
}

/// Digits behind the point, in nanoseconds.
fn fraction(digits: &str) -> Option<i128> {
    let nine: String = digits.chars().chain(std::iter::repeat('0')).take(9).collect();
    nine.parse().ok()
}

/// Date and time of day: 2024-05-01_12-00-00.033, 20240501_120000_033.
fn date(parts: &[Parts], changing: &[usize]) -> Found {
    let count = parts[0].numbers.len();
    let lengths = |p: &Parts, at: usize| p.numbers[at..].iter().map(String::len).collect::<Vec<_>>();
    let (start, length) = (0..count).find_map(|start| {
        let forms: [&[usize]; 4] = [&[4, 2, 2, 2, 2, 2], &[8, 6], &[8, 2, 2, 2], &[4, 2, 2, 6]];
        let form =
            forms.into_iter().find(|form| parts.iter().all(|p| lengths(p, start).starts_with(form)))?;
        Some((start, form.len()))
    })?;
    let end = start + length;
    // A fraction of the second may follow.
    let fractional = changing.contains(&end);
    if !changing.iter().all(|k| (start..end + usize::from(fractional)).contains(k)) {
        return None;
    }
    let all = parts.iter().map(|p| {
        let digits: String = p.numbers[start..end].concat();
        let number = |range: std::ops::Range<usize>| digits[range].parse::<i128>().ok();
        let (year, month, day) = (number(0..4)?, number(4..6)?, number(6..8)?);
        let (hour, minute, second) = (number(8..10)?, number(10..12)?, number(12..14)?);
        let sane = (1970..=2100).contains(&year)
            && (1..=12).contains(&month)
            && (1..=31).contains(&day)
            && hour < 24
            && minute < 60
            && second < 61;
        let seconds = ((days(year, month, day) * 24 + hour) * 60 + minute) * 60 + second;
        let part = if fractional { fraction(&p.numbers[end])? } else { 0 };
        sane.then_some(seconds * 1_000_000_000 + part)
    });
    let decimals = if fractional { parts[0].numbers[end].len().min(9) as i32 } else { 0 };
    Some((all.collect::<Option<_>>()?, 10_f64.powi(-decimals)))
}

/// Days since a fixed one, of the Gregorian calendar; years begin with March.
fn days(year: i128, month: i128, day: i128) -> i128 {
    let (y, m) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    365 * y + y / 4 - y / 100 + y / 400 + (153 * m + 2) / 5 + day
}

/// Whether the names are times.
pub(super) fn are_times(images: &[PathBuf]) -> bool {
    of(images).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rate(names: &[&str]) -> (Option<f64>, Vec<String>, Vec<String>) {
        let mut images: Vec<PathBuf> = names.iter().map(PathBuf::from).collect();
        let mut notes = Vec::new();
        let rate = order(&mut images, Path::new("in"), false, None, &mut notes).unwrap();
        let order = images.iter().map(|path| path.display().to_string()).collect();
        (rate, order, notes)
    }

    #[test]
    fn seconds_count_by_value_and_tell_the_rate() {
        // As text, .2 comes before .175; as numbers, .5 before .033.
        let (found, order, notes) =
            rate(&["f_1699999.2.png", "f_1699999.175.png", "f_1699999.225.png", "f_1699999.25.png"]);
        assert_eq!(found, Some(40.0));
        assert_eq!(order[0], "f_1699999.175.png");
        assert!(notes[0].contains("40 images per second, 25.0 to 25.0 ms apart"), "{notes:?}");
    }

    #[test]
    fn dates_across_midnight_and_nanoseconds() {
        let (found, ..) = rate(&[
            "2024-02-29_23-59-59.933.jpg",
            "2024-02-29_23-59-59.966.jpg",
            "2024-03-01_00-00-00.000.jpg",
            "2024-03-01_00-00-00.033.jpg",
        ]);
        assert_eq!(found, Some(30.0));
        let (found, ..) = rate(&["cam1_20240501_120000_000.png", "cam1_20240501_120000_040.png"]);
        assert_eq!(found, Some(25.0));
        let (found, ..) =
            rate(&["1403636579763555584.png", "1403636579813555456.png", "1403636579863555584.png"]);
        assert_eq!(found, Some(20.0));
    }

    #[test]
    fn a_pause_is_a_gap() {
        let mut images: Vec<PathBuf> =
            ["1.000.png", "1.033.png", "1.066.png", "1.200.png"].map(PathBuf::from).to_vec();
        let told = order(&mut images, Path::new("in"), false, None, &mut Vec::new()).unwrap_err().to_string();
        assert!(told.contains("gap: 1.066.png is followed by 1.200.png"), "{told}");
        let mut notes = Vec::new();
        let found = order(&mut images, Path::new("in"), true, Some(10.0), &mut notes).unwrap();
        assert!((found.unwrap() - 1.0 / 0.033).abs() < 1.0);
        assert!(notes[0].contains("but 10 were given"), "{notes:?}");
    }

    #[test]
    fn counters_are_no_times() {
        for names in [
            &["frame0001.png", "frame0002.png"][..],
            &["take1.2_0001.png", "take1.2_0002.png"],
            &["page1.1.png", "page1.2.png"],
            &["1234567890123.png", "1234567890124_x.png"],
            &["20240501_120000_1.png", "20240501_120000_2_b.png"],
            &["00000001.png", "00000002.png"],
        ] {
            let images: Vec<PathBuf> = names.iter().map(PathBuf::from).collect();
            assert_eq!(of(&images), None, "{names:?}");
        }
    }
}
