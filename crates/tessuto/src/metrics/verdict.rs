//! Whether a result can be trusted, without truth: a grade for every frame, and a sentence.
//!
//! A frame is graded by its worst quantity. The limits say where a reconstruction is no longer what the video shows or
//! what cloth does, and follow from that alone. That a high 99th percentile of strain is doubtful but not bad was decided
//! after seeing one recording whose coarse mesh folds between its vertices.
//!
//! | quantity | doubtful from | bad from | why |
//! |---|---|---|---|
//! | intersection over union of the silhouettes | 0.90 | 0.75 | a square moved by 5 % and by 14 % of its side |
//! | correlation of the prints | 0.50 | 0.25 | the print explains a quarter and a sixteenth of the local contrast; 0 is another print |
//! | \|strain\| of the 99th percentile of threads | 20 % | | woven cloth tears at 15 to 30 %; a hundredth of the threads is no more than a place |
//! | mean \|strain\| of the threads | 5 % | 10 % | the whole cloth, where woven cloth gives way by 1 to 3 % |
//! | creased inner edges | 5 % | 15 % | one sharp fold across n×n vertices is 1 / 3n of them |
//!
//! The PSNR of the colours is told but not judged: the recovered texture holds the first frame's light, and where the light on
//! the cloth changes, the true motion has a PSNR that falls by 30 dB.

use serde::{Deserialize, Serialize};

use super::agreement::FrameAgreement;

/// How far a result is to be trusted; the later, the worse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    /// It agrees with the video, and cloth can move so.
    Good,
    /// Some frames do not.
    Doubtful,
    /// Some frames are another cloth or another motion.
    Bad,
}

impl Grade {
    /// As a word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Doubtful => "doubtful",
            Self::Bad => "bad",
        }
    }
}

/// A quantity over the frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OverFrames {
    /// Mean over the frames that have it.
    pub mean: f64,
    /// Worst value.
    pub worst: f64,
    /// Number of the frame of the worst value, the first of them.
    pub frame: usize,
}

/// What the frames say together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// Grade of the worst frame.
    pub grade: Grade,
    /// The same in words, with the frames and the numbers that decided.
    pub sentence: String,
    /// Numbers of the frames that are not good, ascending.
    pub doubtful_frames: Vec<usize>,
    /// See [`FrameAgreement::silhouette`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub silhouette: Option<OverFrames>,
    /// PSNR `[dB]`, see [`FrameAgreement::psnr`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psnr: Option<OverFrames>,
    /// See [`FrameAgreement::correlation`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correlation: Option<OverFrames>,
    /// See [`FrameAgreement::strain_mean`].
    pub strain_mean: OverFrames,
    /// See [`FrameAgreement::strain_p99`].
    pub strain_p99: OverFrames,
    /// See [`FrameAgreement::strain_max`].
    pub strain_max: OverFrames,
    /// See [`FrameAgreement::creased`].
    pub creased: OverFrames,
}

/// One line of the table above.
struct Criterion {
    /// Doubtful and bad from here on.
    limits: [f64; 2],
    /// The larger, the worse.
    cost: fn(&FrameAgreement) -> Option<f64>,
    /// A cost in words.
    words: fn(f64) -> String,
}

const CRITERIA: [Criterion; 5] = [
    Criterion {
        limits: [0.10, 0.25],
        cost: |f| f.silhouette.map(|v| 1.0 - v),
        words: |cost| format!("silhouette {:.2}", 1.0 - cost),
    },
    Criterion {
        limits: [0.50, 0.75],
        cost: |f| f.correlation.map(|v| 1.0 - v),
        words: |cost| format!("texture displaced, correlation {:.2}", 1.0 - cost),
    },
    Criterion {
        limits: [0.20, f64::INFINITY],
        cost: |f| Some(f.strain_p99),
        words: |cost| format!("1 thread in 100 strained by {:.0} % or more", 100.0 * cost),
    },
    Criterion {
        limits: [0.05, 0.10],
        cost: |f| Some(f.strain_mean),
        words: |cost| format!("threads strained by {:.0} % on average", 100.0 * cost),
    },
    Criterion {
        limits: [0.05, 0.15],
        cost: |f| Some(f.creased),
        words: |cost| format!("{:.0} % of the edges creased", 100.0 * cost),
    },
];

impl Criterion {
    fn grade(&self, frame: &FrameAgreement) -> Grade {
        let [doubtful, bad] = self.limits;
        match (self.cost)(frame) {
            Some(cost) if cost >= bad || cost.is_nan() => Grade::Bad,
            Some(cost) if cost >= doubtful => Grade::Doubtful,
            _ => Grade::Good,
        }
    }
}

/// Judges a result by the agreement of its frames; None without frames.
pub fn judge(frames: &[FrameAgreement]) -> Option<Verdict> {
    let grade_of = |f: &FrameAgreement| CRITERIA.iter().map(|c| c.grade(f)).max();
    let over = |value: fn(&FrameAgreement) -> Option<f64>, larger_is_worse: bool| {
        let values: Vec<(usize, f64)> = frames.iter().filter_map(|f| Some((f.frame, value(f)?))).collect();
        let cost = |v: f64| if larger_is_worse { v } else { -v };
        let worst = values.iter().copied().reduce(|a, b| if cost(b.1) > cost(a.1) { b } else { a })?;
        let mean = values.iter().map(|(_, v)| v).sum::<f64>() / values.len() as f64;
        Some(OverFrames { mean, worst: worst.1, frame: worst.0 })
    };
    let mut verdict = Verdict {
        grade: frames.iter().filter_map(grade_of).max()?,
        sentence: String::new(),
        doubtful_frames: Vec::new(),
        silhouette: over(|f| f.silhouette, false),
        psnr: over(|f| f.psnr, false),
        correlation: over(|f| f.correlation, false),
        strain_mean: over(|f| Some(f.strain_mean), true)?,
        strain_p99: over(|f| Some(f.strain_p99), true)?,
        strain_max: over(|f| Some(f.strain_max), true)?,
        creased: over(|f| Some(f.creased), true)?,
    };
    if verdict.grade == Grade::Good {
        verdict.sentence = praise(&verdict);
        return Some(verdict);
    }
    let wrong = frames.iter().filter(|f| grade_of(f) > Some(Grade::Good));
    verdict.doubtful_frames = wrong.map(|f| f.frame).collect();
    let reasons: Vec<String> = CRITERIA
        .iter()
        .filter_map(|c| {
            let costs = frames.iter().filter(|f| c.grade(f) > Grade::Good);
            let costs = costs.map(|f| (f.frame, (c.cost)(f).unwrap_or(f64::NAN)));
            let (frame, cost) = costs.reduce(|a, b| if b.1 > a.1 { b } else { a })?;
            Some(format!("{} (frame {frame})", (c.words)(cost)))
        })
        .collect();
    let last = frames.last()?.frame;
    let place = if verdict.doubtful_frames.len() == frames.len() {
        "in all frames".to_owned()
    } else {
        place(&verdict.doubtful_frames, last)
    };
    verdict.sentence = format!("{} {place}: {}", verdict.grade.word(), reasons.join(", "));
    Some(verdict)
}

fn praise(v: &Verdict) -> String {
    let mut parts = Vec::new();
    if let Some(s) = v.silhouette {
        parts.push(format!("silhouette {:.3} (worst {:.3} in frame {})", s.mean, s.worst, s.frame));
    }
    if let Some(p) = v.psnr {
        parts.push(format!("colours {:.1} dB (worst {:.1} in frame {})", p.mean, p.worst, p.frame));
    }
    let s = v.strain_p99;
    parts.push(format!("99 of 100 threads strained by at most {:.1} % (frame {})", 100.0 * s.worst, s.frame));
    format!("good: {}", parts.join(", "))
}

/// Where frames are: `from frame 31 on`, `in frames 4–6 and 9`; `last` is that of the clip.
fn place(frames: &[usize], last: usize) -> String {
    let runs: Vec<&[usize]> = frames.chunk_by(|a, b| a + 1 == *b).collect();
    if let [run] = runs[..]
        && run.len() > 1
        && run[run.len() - 1] == last
    {
        return format!("from frame {} on", run[0]);
    }
    let names: Vec<String> = runs
        .iter()
        .map(|run| match run {
            [one] => one.to_string(),
            run => format!("{}–{}", run[0], run[run.len() - 1]),
        })
        .collect();
    let word = if frames.len() == 1 { "frame" } else { "frames" };
    match &names[..] {
        [one] => format!("in {word} {one}"),
        // A line is to be read: of many runs the first few and how many frames there are.
        [first, second, third, _, ..] => {
            format!("in {} frames, {first}, {second}, {third} and others", frames.len())
        }
        [rest @ .., end] => format!("in {word} {} and {end}", rest.join(", ")),
        [] => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn good(frame: usize) -> FrameAgreement {
        FrameAgreement {
            frame,
            silhouette: Some(0.985 - 1e-4 * frame as f64),
            psnr: Some(30.0 - 0.1 * frame as f64),
            correlation: Some(0.9),
            strain_mean: 0.01,
            strain_p99: 0.04,
            strain_max: 0.3,
            creased: 0.01,
            deviation: None,
        }
    }

    fn clip(spoil: impl Fn(&mut FrameAgreement)) -> Verdict {
        let mut frames: Vec<FrameAgreement> = (10..30).map(good).collect();
        frames.iter_mut().for_each(spoil);
        judge(&frames).unwrap()
    }

    #[test]
    fn a_good_clip_is_praised_with_its_worst_frames() {
        let verdict = clip(|_| {});
        assert_eq!(verdict.grade, Grade::Good);
        assert!(verdict.doubtful_frames.is_empty());
        assert_eq!(
            verdict.sentence,
            "good: silhouette 0.983 (worst 0.982 in frame 29), colours 28.1 dB (worst 27.1 in frame 29), \
             99 of 100 threads strained by at most 4.0 % (frame 10)"
        );
        assert_eq!(judge(&[]), None);
    }

    #[test]
    fn every_criterion_is_heard_and_names_its_frames() {
        type Spoil = fn(&mut FrameAgreement);
        let cases: [(Spoil, Grade, &str); 9] = [
            (|f| f.silhouette = Some(0.89), Grade::Doubtful, "doubtful from frame 25 on: silhouette 0.89"),
            (|f| f.silhouette = Some(0.0), Grade::Bad, "bad from frame 25 on: silhouette 0.00 (frame 25)"),
            (|f| f.correlation = Some(0.45), Grade::Doubtful, "texture displaced, correlation 0.45"),
            (|f| f.correlation = Some(-0.1), Grade::Bad, "correlation -0.10 (frame 25)"),
            (|f| f.strain_p99 = 0.31, Grade::Doubtful, "1 thread in 100 strained by 31 % or more"),
            (|f| f.strain_mean = 0.11, Grade::Bad, "strained by 11 % on average"),
            (|f| f.strain_mean = f64::NAN, Grade::Bad, "strained by NaN %"),
            (|f| f.creased = 0.07, Grade::Doubtful, "7 % of the edges creased"),
            (|f| f.creased = 0.2, Grade::Bad, "20 % of the edges creased"),
        ];
        for (spoil, grade, words) in cases {
            let verdict = clip(|f| {
                if f.frame >= 25 {
                    spoil(f)
                }
            });
            assert_eq!(verdict.grade, grade, "{}", verdict.sentence);
            assert!(verdict.sentence.contains(words), "{}", verdict.sentence);
            assert_eq!(verdict.doubtful_frames, (25..30).collect::<Vec<_>>());
        }
    }

    #[test]
    fn plain_cloth_and_changed_light_are_no_fault() {
        let verdict =
            clip(|f| (f.correlation, f.psnr) = (None, Some(if f.frame > 15 { 12.0 } else { 50.0 })));
        assert_eq!((verdict.grade, verdict.correlation), (Grade::Good, None), "{}", verdict.sentence);
    }

    #[test]
    fn a_clip_that_is_wrong_throughout_is_said_to_be() {
        let verdict = clip(|f| f.silhouette = Some(0.8));
        assert_eq!(verdict.sentence, "doubtful in all frames: silhouette 0.80 (frame 10)");
    }

    #[test]
    fn places_read_well() {
        assert_eq!(place(&[3], 9), "in frame 3");
        assert_eq!(place(&[9], 9), "in frame 9");
        assert_eq!(place(&[7, 8, 9], 9), "from frame 7 on");
        assert_eq!(place(&[2, 3, 7], 9), "in frames 2–3 and 7");
        assert_eq!(place(&[1, 3, 4, 9], 9), "in frames 1, 3–4 and 9");
        assert_eq!(place(&[1, 3, 5, 7], 9), "in 4 frames, 1, 3, 5 and others");
    }
}
