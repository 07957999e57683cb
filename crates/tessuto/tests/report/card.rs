//! The card of a fabric, of made-up clips.

use tessuto::card::{self, Card, Clip, combine};
use tessuto::motion::causes::Constraint;
use tessuto::result::Measured;
use tessuto::run::fabric::{Fabric, bending_length};
use tessuto::sim::per_width::PerWidth;
use tessuto::sim::textile::elastica;

fn clip(name: &str, bending: [f64; 2]) -> Clip {
    let per_width = PerWidth { bending, shear: 20.0, membrane: [300.0, 250.0], bent: 0.2, area_density: 0.1 };
    let constraints = [Constraint::AtLeast { factor: 0.5 }, Constraint::Constrained, Constraint::Constrained];
    let measured = Measured { per_width, sd_of_ln: [0.9, 0.3, 0.5], constraints };
    Clip { name: name.to_owned(), measured }
}

#[test]
fn the_page_is_alone_and_says_what_the_clips_say() {
    let clips = [clip("<one>", [6e-6, 3e-6]), clip("other", [6e-5, 3e-5])];
    let answer = combine(&clips).weighing(0.142);
    let tested = card::simulate(&answer).unwrap();
    // The strip is the elastica's.
    let gamma = elastica::gamma_of(41.5f64.to_radians().tan());
    let w = &answer.per_width;
    for (bending, overhang) in w.bending.iter().zip(tested.overhangs) {
        let expected = gamma.cbrt() * bending_length(*bending, w.area_density);
        assert!((overhang[1] / expected - 1.0).abs() < 0.03, "{overhang:?} {expected}");
        assert!(overhang[0] < overhang[1] && overhang[1] < overhang[2]);
    }
    let [softer, mean, stiffer] = tested.drapes.each_ref().map(|d| d.coefficient);
    assert!(0.0 < softer && softer < mean && mean < stiffer && stiffer < 1.0, "{softer} {mean} {stiffer}");
    let fabric = Fabric { row: 7, density: 0.2, bending: [1e-5, 2e-5] };
    let alike = [(&fabric, 0.1)];
    let card =
        Card { clips: &clips, answer: &answer, weighed: true, tested: &tested, alike: &alike, among: 9 };
    let page = card::render(&card);
    for lone in ["http:", "https:", "src=", "href=", "url(", "@import", "<script", "<one>"] {
        assert!(!page.contains(lone), "{lone}");
    }
    let named = "contradiction: other is 10.00 times as stiff as &#60;one&#62;";
    // 300 N/m at 0.1 kg/m², at 0.142.
    for part in [
        named,
        "no clip constrains it",
        "142 g/m², as weighed",
        "row 7",
        "of 9",
        "at least 213</td>",
        "gives a lower bound only",
    ] {
        assert!(page.contains(part), "{part}");
    }
    // The same numbers in other programs' terms: ρ is 142 g/m², and h 0.5 mm.
    for part in [
        "MuJoCo",
        "Omniverse, PhysX",
        "ZOZO&#39;s solver",
        "physics:surfaceBendStiffness",
        "bend_weft",
        "284",
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert_eq!(page.matches("<svg").count(), 2);
    assert_eq!(page.matches("<polygon").count(), 3);
    assert!(page.len() < 100_000, "{}", page.len());
}
