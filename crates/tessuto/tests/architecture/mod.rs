//! The documents name only what exists, with the values that it has, the modules keep to their layers, and siblings stand in no circle.

mod constants;
mod imports;
mod words;

use std::path::{Path, PathBuf};

use imports::Crate;

/// From the bottom up; a module imports from lower layers and its own module only.
const LAYERS: [&[&str]; 19] = [
    &["math", "error", "processor", "text"],
    &["camera", "image", "mesh", "settings"],
    &["video"],
    &["scene"],
    &["raster"],
    &["io"],
    &["output", "session"],
    &["sim", "optim", "metrics", "decoder", "template"],
    &["pbr", "training"],
    &["motion"],
    &["appearance"],
    &["config"],
    &["reconstruct"],
    &["report"],
    &["result"],
    &["masks"],
    &["check", "export", "import", "view"],
    &["run", "synth", "compare"],
    &["lib"],
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Every Rust file below `folder`.
fn sources(folder: &Path, out: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            sources(&path, out);
        } else if path.extension().is_some_and(|e| e == "rs") {
            out.push(path);
        }
    }
}

fn all_sources() -> Vec<PathBuf> {
    let mut out = Vec::new();
    sources(&root().join("crates/tessuto/src"), &mut out);
    sources(&root().join("crates/tessuto-cli/src"), &mut out);
    assert!(out.len() > 50, "found only {} files", out.len());
    out
}

#[test]
fn every_path_in_the_documents_exists() {
    let mut missing = Vec::new();
    let mut found = 0;
    for document in ["README.md", "ARCHITECTURE.md"] {
        let text = std::fs::read_to_string(root().join(document)).unwrap();
        // Code spans, and the targets of links.
        let spans = text.split('`').skip(1).step_by(2);
        let links = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        for path in spans.chain(links).filter(|s| s.starts_with("crates/") || s.starts_with("docs/")) {
            found += 1;
            if !root().join(path).exists() {
                missing.push(format!("{document}: {path}"));
            }
        }
    }
    assert!(found > 10, "only {found} paths are named");
    assert!(missing.is_empty(), "named but missing: {missing:#?}");
}

fn layer(module: &str) -> Option<usize> {
    LAYERS.iter().position(|modules| modules.contains(&module))
}

/// The library's sources: paths below `src/` and texts.
fn library() -> Vec<(String, String)> {
    let folder = root().join("crates/tessuto/src");
    let mut files = Vec::new();
    sources(&folder, &mut files);
    let inside = |path: &PathBuf| path.strip_prefix(&folder).unwrap().to_str().unwrap().replace('\\', "/");
    files.iter().map(|path| (inside(path), std::fs::read_to_string(path).unwrap())).collect()
}

/// References from a module at the root to one that is not in a lower layer.
fn upward(files: &[(String, String)]) -> Vec<String> {
    let mut wrong = Vec::new();
    for (from, to) in Crate::new(files.iter().map(|(path, text)| (path.as_str(), text.as_str()))).references()
    {
        let (Some(module), Some(other)) = (from.first(), to.first()) else { continue };
        let layer = |module: &str| {
            layer(module)
                .unwrap_or_else(|| panic!("{} refers to {module}, which has no layer", from.join("/")))
        };
        if module != other && layer(other) >= layer(module) {
            wrong.push(format!("{}: {}", from.join("/"), to.join("::")));
        }
    }
    wrong
}

#[test]
fn no_module_imports_upwards() {
    let mut files = library();
    let wrong = upward(&files);
    assert!(wrong.is_empty(), "upward or sideways imports: {wrong:#?}");
    // The same check sees what breaks the rule.
    files.push((
        "sim/planted.rs".into(),
        "fn f() { crate::result::read(); crate::Config::default(); }".into(),
    ));
    assert_eq!(upward(&files), ["sim/planted: config::Config::default", "sim/planted: result::read"]);
}

#[test]
fn no_siblings_import_each_other() {
    let files = library();
    let circles = Crate::new(files.iter().map(|(path, text)| (path.as_str(), text.as_str()))).circles();
    assert!(circles.is_empty(), "modules that need each other: {circles:#?}");
}

#[test]
fn files_are_short_and_finished() {
    let mut wrong = Vec::new();
    for path in all_sources() {
        let text = std::fs::read_to_string(&path).unwrap();
        let lines = text.lines().count();
        if lines > 600 {
            wrong.push(format!("{}: {lines} lines", path.display()));
        }
        for gap in ["todo!", "unimplemented!"] {
            if text.contains(&format!("{gap}(")) {
                wrong.push(format!("{}: {gap}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
