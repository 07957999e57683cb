//! A verdict in words.

use super::criteria::CRITERIA;
use super::{State, Verdict};
use crate::metrics::agreement::FrameAgreement;
use crate::metrics::names::{SILHOUETTE, TEXTURED};

/// Most stretches of frames that a sentence names.
const NAMED: usize = 8;

/// Of a clip whose frames are all found.
pub(super) fn praise(v: &Verdict) -> String {
    let mut parts = Vec::new();
    if let Some(s) = v.silhouette {
        parts.push(format!(
            "{SILHOUETTE} {:.1} % (worst {:.1} % in frame {})",
            100.0 * s.mean,
            100.0 * s.worst,
            s.frame
        ));
    }
    if let Some(p) = v.psnr {
        parts.push(format!("{TEXTURED} {:.1} dB (worst {:.1} in frame {})", p.mean, p.worst, p.frame));
    }
    let s = v.strain_p99;
    parts.push(format!("99 of 100 threads strained by at most {:.1} % (frame {})", 100.0 * s.worst, s.frame));
    format!("found: {}", parts.join(", "))
}

/// Where frames are lost and doubtful, and of each quantity that says so the worst value with its frame.
pub(super) fn complaint(verdict: &Verdict, frames: &[FrameAgreement], size: f64) -> String {
    let range = [frames[0].frame, frames[frames.len() - 1].frame + 1];
    let places: Vec<String> = [(State::Lost, &verdict.lost), (State::Doubtful, &verdict.doubtful)]
        .into_iter()
        .filter(|(_, stretches)| !stretches.is_empty())
        .map(|(state, stretches)| format!("{} {}", state.word(), place(stretches, range)))
        .collect();
    let reasons: Vec<String> = CRITERIA
        .iter()
        .filter_map(|c| {
            let costs = frames.iter().filter(|f| c.state(f, size) > State::Found);
            let costs = costs.map(|f| (f.frame, (c.cost)(f, size).unwrap_or(f64::NAN)));
            let (frame, cost) = costs.reduce(|a, b| if b.1 > a.1 { b } else { a })?;
            Some(format!("{} (frame {frame})", (c.words)(cost)))
        })
        .collect();
    format!("{}: {}", places.join(", "), reasons.join(", "))
}

/// Where the frames of `stretches` are: `from frame 31 on`, `in frames 4–6 and 9`; `clip` is [first, one past the
/// last] of all frames.
pub(super) fn place(stretches: &[[usize; 2]], clip: [usize; 2]) -> String {
    let count: usize = stretches.iter().map(|[first, end]| end - first).sum();
    if let [[first, end]] = stretches
        && *end == clip[1]
        && count > 1
    {
        return if *first == clip[0] { "in all frames".to_owned() } else { format!("from frame {first} on") };
    }
    let name = |[first, end]: &[usize; 2]| {
        if first + 1 == *end { first.to_string() } else { format!("{first}–{}", end - 1) }
    };
    let names: Vec<String> = stretches.iter().map(name).collect();
    let word = if count == 1 { "frame" } else { "frames" };
    match &names[..] {
        [one] => format!("in {word} {one}"),
        // A line is to be read: of many stretches the first ones and how many frames there are.
        many if many.len() > NAMED => format!("in {count} frames, {} and others", many[..NAMED].join(", ")),
        [rest @ .., end] => format!("in {word} {} and {end}", rest.join(", ")),
        [] => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::place;

    #[test]
    fn places_read_well() {
        let clip = [0, 40];
        let told = |stretches: &[[usize; 2]]| place(stretches, clip);
        assert_eq!(told(&[[3, 4]]), "in frame 3");
        assert_eq!(told(&[[39, 40]]), "in frame 39");
        assert_eq!(told(&[[7, 40]]), "from frame 7 on");
        assert_eq!(told(&[[0, 40]]), "in all frames");
        assert_eq!(told(&[[2, 4], [7, 8]]), "in frames 2–3 and 7");
        assert_eq!(told(&[[1, 2], [3, 5], [39, 40]]), "in frames 1, 3–4 and 39");
        let many: Vec<[usize; 2]> = (0..10).map(|k| [3 * k, 3 * k + 2]).collect();
        assert_eq!(told(&many), "in 20 frames, 0–1, 3–4, 6–7, 9–10, 12–13, 15–16, 18–19, 21–22 and others");
    }
}
