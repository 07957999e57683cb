use super::*;

/// A sheet of 0.5 m × 0.5 m.
fn sheet() -> Mesh {
    tessuto_core::mesh::grid(3, 3, glam::DVec2::splat(0.5), 1.0)
}

fn good(frame: usize) -> FrameAgreement {
    FrameAgreement {
        frame,
        silhouette: Some(0.985 - 1e-4 * frame as f64),
        uncovered: Some(0.01),
        psnr: Some(30.0 - 0.1 * frame as f64),
        correlation: Some(0.9),
        strain_mean: 0.01,
        strain_p99: 0.04,
        strain_max: 0.3,
        creased: 0.01,
        flipped: 0.0,
        deviation: Some(0.003),
    }
}

/// Frames 10 to 29.
fn clip(spoil: impl Fn(&mut FrameAgreement)) -> (Verdict, Vec<FrameVerdict>) {
    let mut frames: Vec<FrameAgreement> = (10..30).map(good).collect();
    frames.iter_mut().for_each(spoil);
    (judge(&frames, &sheet()).unwrap(), judge_frames(&frames, &sheet()))
}

#[test]
fn a_good_clip_is_praised_with_its_worst_frames() {
    let (verdict, frames) = clip(|_| {});
    assert_eq!(verdict.state, State::Found);
    assert_eq!(verdict.counts, Counts { found: 20, doubtful: 0, lost: 0 });
    assert!(verdict.doubtful.is_empty() && verdict.lost.is_empty() && verdict.warning().is_none());
    assert_eq!(
        verdict.sentence,
        "found: silhouette overlap 98.3 % (worst 98.2 % in frame 29), colours by the texture 28.1 dB (worst \
         27.1 in frame 29), 99 of 100 threads strained by at most 4.0 % (frame 10)"
    );
    assert!(frames.iter().all(|f| f.state == State::Found && f.reason.is_empty()));
    assert_eq!(judge(&[], &sheet()), None);
}

#[test]
fn every_criterion_is_heard_and_names_its_frames() {
    type Spoil = fn(&mut FrameAgreement);
    let cases: [(Spoil, State, &str); 16] = [
        (|f| f.uncovered = Some(0.07), State::Doubtful, "7 % of the mask not covered"),
        (|f| f.uncovered = Some(1.0), State::Lost, "100 % of the mask not covered"),
        (|f| (f.correlation, f.silhouette) = (None, Some(0.89)), State::Doubtful, "silhouette overlap 89 %"),
        (|f| (f.correlation, f.silhouette) = (None, Some(0.0)), State::Lost, "silhouette overlap 0 %"),
        (|f| f.correlation = Some(0.55), State::Doubtful, "texture displaced, correlation 0.55"),
        (|f| f.correlation = Some(-0.1), State::Lost, "texture displaced, correlation -0.10"),
        (|f| f.strain_p99 = 0.51, State::Doubtful, "1 thread in 100 strained by 51 % or more"),
        (|f| f.strain_p99 = 9.0, State::Doubtful, "1 thread in 100 strained by 900 % or more"),
        (|f| f.strain_mean = 0.11, State::Lost, "threads strained by 11 % on average"),
        (|f| f.strain_mean = f64::NAN, State::Lost, "threads strained by NaN % on average"),
        (|f| f.creased = 0.07, State::Doubtful, "7 % of the edges creased"),
        (|f| f.creased = 0.2, State::Lost, "20 % of the edges creased"),
        (|f| f.flipped = 0.02, State::Doubtful, "2 % of the area in flipped triangles"),
        (|f| f.flipped = 0.06, State::Lost, "6 % of the area in flipped triangles"),
        (|f| f.deviation = Some(0.0188), State::Doubtful, "positions uncertain by 4 % of the sheet's size"),
        (|f| f.deviation = Some(0.0452), State::Lost, "positions uncertain by 10 % of the sheet's size"),
    ];
    for (spoil, state, words) in cases {
        let (verdict, frames) = clip(|f| {
            if f.frame >= 25 {
                spoil(f)
            }
        });
        let expected = format!("{} from frame 25 on: {words} (frame 25)", state.word());
        assert_eq!((verdict.state, verdict.sentence.as_str()), (state, expected.as_str()));
        for f in frames {
            let expected = if f.frame < 25 { (State::Found, "") } else { (state, words) };
            assert_eq!((f.state, f.reason.as_str()), expected);
        }
        let stretch = vec![[25, 30]];
        let expected = if state == State::Lost { (vec![], stretch) } else { (stretch, vec![]) };
        assert_eq!((verdict.doubtful, verdict.lost), expected);
    }
}

#[test]
fn a_frame_tells_what_decided_and_a_clip_where_which() {
    let (verdict, frames) = clip(|f| match f.frame {
        12 => (f.correlation, f.creased) = (Some(0.55), 0.3),
        13 | 20 => f.correlation = Some(0.5),
        14 => (f.correlation, f.flipped) = (Some(0.1), 0.1),
        _ => {}
    });
    assert_eq!(frames[2].reason, "30 % of the edges creased", "what is merely doubtful did not decide");
    assert_eq!(
        frames[4].reason,
        "texture displaced, correlation 0.10, 10 % of the area in flipped triangles"
    );
    assert_eq!(verdict.counts, Counts { found: 16, doubtful: 2, lost: 2 });
    assert_eq!(
        (verdict.doubtful.as_slice(), verdict.lost.as_slice()),
        (&[[13, 14], [20, 21]][..], &[[12, 13], [14, 15]][..])
    );
    assert_eq!(
        verdict.sentence,
        "lost in frames 12 and 14, doubtful in frames 13 and 20: texture displaced, correlation 0.10 (frame 14), \
         30 % of the edges creased (frame 12), 10 % of the area in flipped triangles (frame 14)"
    );
    let warning = verdict.warning().unwrap();
    assert_eq!(warning.hint.unwrap().remedies, [Remedy::Check, Remedy::WithoutLost]);
}

#[test]
fn doubt_alone_needs_no_remedy() {
    let (verdict, _) = clip(|f| f.correlation = Some(0.55));
    assert_eq!(verdict.sentence, "doubtful in all frames: texture displaced, correlation 0.55 (frame 10)");
    assert_eq!(verdict.warning().unwrap().hint, None);
}

#[test]
fn plain_cloth_changed_light_and_things_in_front_are_no_fault() {
    let dimmed = |f: &mut FrameAgreement| {
        (f.correlation, f.psnr) = (None, Some(if f.frame > 15 { 12.0 } else { 50.0 }));
    };
    let hidden = |f: &mut FrameAgreement| f.silhouette = Some(0.7);
    for (verdict, _) in [clip(dimmed), clip(hidden)] {
        assert_eq!(verdict.state, State::Found, "{}", verdict.sentence);
    }
}

#[test]
fn uncertainty_is_measured_against_the_size_of_the_sheet() {
    let frame = [FrameAgreement { deviation: Some(0.02), ..good(0) }];
    let large = tessuto_core::mesh::grid(3, 3, glam::DVec2::splat(2.0), 1.0);
    let state = |mesh: &Mesh| judge_frames(&frame, mesh)[0].state;
    assert_eq!((state(&sheet()), state(&large)), (State::Doubtful, State::Found));
}

#[test]
fn a_sheet_that_covers_all_of_the_mask_is_surer() {
    let state = |uncovered: Option<f64>| {
        let frame = FrameAgreement { uncovered, deviation: Some(0.01), ..good(0) };
        judge_frames(&[frame], &sheet())[0].state
    };
    let states = [Some(0.0), Some(0.003), Some(0.01), Some(0.05), None].map(state);
    assert_eq!(states, [State::Found, State::Found, State::Doubtful, State::Doubtful, State::Doubtful]);
}
