//! Causes of a motion against the truth, what they foretell, and what fabric they are of.

use std::path::Path;

use super::run::{fail, succeed, text};

#[test]
fn causes_are_compared_with_the_truth_and_foretell() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (scene, out) = (at("scene"), at("out"));
    let size = ["--frames", "8", "--size", "96", "--grid", "7x7", "--air", "--seed", "5"];
    succeed(&[&["synth", text(&scene)], &size[..]].concat());
    for name in ["physics.json", "calm.npy", "stiffer.npy"] {
        assert!(scene.join("gt").join(name).is_file(), "{name}");
    }
    // The first five of eight frames; the other three are foretold.
    let forecast = ["--fit", "0.6", "--set", "texture.size=32", "--set", "causes.iterations=2"];
    let table = succeed(&[&["forecast", text(&scene), "--out", text(&out)], &forecast[..]].concat());
    for way in
        ["found causes", "stiffnesses as assumed", "last residual goes on", "held still", "straight on"]
    {
        assert!(table.contains(way), "{way}: {table}");
    }
    let written = |name: &str| std::fs::read_to_string(out.join("forecast").join(name)).unwrap();
    assert_eq!(written("forecast.csv").lines().count(), 1 + 3);
    assert_eq!(written("forecast.svg").matches("<polyline").count(), 5);
    assert!(written("forecast.json").contains("\"first\": 5"));
    assert!(table.starts_with(&written("forecast.txt")));
    // What is there is taken; of other settings it is not.
    succeed(&[&["forecast", text(&scene), "--out", text(&out)], &forecast[..]].concat());
    assert!(fail(3, &["forecast", text(&scene), "--out", text(&out)]).contains("other settings"));
    assert!(
        fail(2, &["forecast", text(&scene), "--out", text(&out), "--fit", "1.5"]).contains("between 0 and 1")
    );

    let (fit, whole) = (out.join("fit"), at("whole"));
    let quick = ["--no-appearance", "--set", "texture.size=32", "--set", "causes.iterations=2"];
    succeed(&[&["reconstruct", text(&scene), "--out", text(&whole)], &quick[..]].concat());
    // What the page lets one play is what a simulation gives.
    let held = ["--continue", "20", "--air", "still", "--hold", "still"];
    let page = std::fs::read_to_string(whole.join("report.html")).unwrap();
    for (key, how) in [("still_air", &held[..]), ("stiffer", &["--scale", "bend=10"])] {
        let simulated = at(&format!("{key}.npy"));
        succeed(&[&["simulate", text(&whole), "--out", text(&simulated)], how].concat());
        let of = |path: &Path| std::fs::read(path).unwrap();
        assert!(of(&simulated) == of(&whole.join("changed").join(format!("{key}.npy"))), "{key}");
    }
    for part in [
        r#"{"key":"let_go""#,
        r#"{"key":"residual""#,
        "What moved it",
        "Forces as fractions",
        r#""stacked":true"#,
    ] {
        assert!(page.contains(part), "{part} is missing");
    }
    succeed(&["verify", text(&whole)]);
    let table = succeed(&["evaluate", text(&scene), text(&whole)]);
    for word in ["bend  ", "shear  ", "drag  ", "gravity  ", "held  ", "unexplained", "calm  ", "stiffer  "] {
        assert!(table.contains(word), "{word}: {table}");
    }
    let json = succeed(&["evaluate", text(&scene), text(&whole), "--json"]);
    assert!(json.contains("\"causes\"") && json.contains("\"log10\"") && json.contains("\"baseline\""));
    // A part of the clip has the causes, too, but not what comes after the whole.
    assert!(!succeed(&["evaluate", text(&scene), text(&fit)]).contains("stiffer  "));

    let csv = at("fabrics.csv");
    std::fs::write(
        &csv,
        "density[kg.m-2],linear warp[SI*1e9],linear weft[SI*1e9]\n0.1,1000,2000\n0.3,8000,4000\n",
    )
    .unwrap();
    let named = succeed(&["fabric", text(&fit), "--table", text(&csv)]);
    assert!(named.contains("bending length") && named.contains("Of 2 fabrics"), "{named}");
    std::fs::write(&csv, "a,b\n1,2\n").unwrap();
    assert!(fail(3, &["fabric", text(&fit), "--table", text(&csv)]).contains("density[kg.m-2]"));
    the_card_of(&fit, &whole, &folder.path().join("card.html"));
    let plain = at("plain");
    let few = ["--preset", "motion", "--no-appearance", "--frames", "0..3", "--set", "texture.size=32"];
    succeed(&[&["reconstruct", text(&scene), "--out", text(&plain)], &few[..]].concat());
    assert!(fail(3, &["fabric", text(&plain)]).contains("preset default"));
    assert!(Path::new(&plain).is_dir());
}

/// Two results of one made-up fabric: one card of each weight, and of both together.
fn the_card_of(one: &Path, other: &Path, card: &Path) {
    let of = |arguments: &[&str]| succeed(&[&["fabric", text(one)], arguments].concat());
    let number = |said: &str, line: &str| -> f64 {
        let line = said.lines().find(|l| l.starts_with(line)).unwrap();
        line.split_whitespace().find_map(|word| word.parse().ok()).unwrap()
    };
    // Stiffness follows the weight, lengths do not.
    let (assumed, weighed) = (of(&[]), of(&["--weight", "200g/m2", "--out", text(card)]));
    for (name, factor) in [("bending, warp", 2.0), ("shear", 2.0), ("membrane", 2.0), ("bending length", 1.0)]
    {
        let ratio = number(&weighed, name) / number(&assumed, name);
        assert!((ratio / factor - 1.0).abs() < 2e-3, "{name}: {ratio}");
    }
    assert!(assumed.contains("0.1 kg/m², which is assumed") && weighed.contains("0.2 kg/m², as weighed"));
    assert!(weighed.contains("A further clip should show"), "{weighed}");
    let page = std::fs::read_to_string(card).unwrap();
    for part in [
        "200 g/m², as weighed",
        "drape coefficient",
        "polygon class=\"mean\"",
        "polyline class=\"weft\"",
        "ruler",
    ] {
        assert!(page.contains(part), "{part} is missing");
    }
    assert!(fail(2, &["fabric", text(one), "--weight", "200"]).contains("142g/m2"));
    // An earlier card is replaced where that is allowed, by the same bytes for any number of threads. A user's page
    // never is.
    assert!(fail(3, &["fabric", text(one), "--out", text(card)]).contains("--force"));
    of(&["--weight", "200g/m2", "--out", text(card), "--force", "--threads", "1"]);
    assert!(page == std::fs::read_to_string(card).unwrap());
    let own = card.with_file_name("own.html");
    std::fs::write(&own, "<p>mine").unwrap();
    fail(3, &["fabric", text(one), "--out", text(&own), "--force"]);
    assert_eq!(std::fs::read_to_string(&own).unwrap(), "<p>mine");
    // Together.
    let said = succeed(&["fabric", text(one), text(other)]);
    assert!(
        said.contains("From 2 clips, treated as one fabric") && said.contains("bending stiffness"),
        "{said}"
    );
    assert!(fail(2, &["fabric", text(one), text(one)]).contains("given twice"));
}
