//! The documents name only what exists, and the modules keep to their layers.

use std::path::{Path, PathBuf};

/// From the bottom up; a module imports from lower layers and its own module only.
const LAYERS: [&[&str]; 18] = [
    &["math", "error", "text"],
    &["camera", "image", "mesh"],
    &["video"],
    &["scene"],
    &["raster"],
    &["io"],
    &["output", "session"],
    &["sim", "optim", "metrics", "decoder", "template"],
    &["pbr"],
    &["motion"],
    &["appearance"],
    &["config"],
    &["reconstruct"],
    &["report"],
    &["result"],
    &["check", "export", "import", "view"],
    &["run", "synth"],
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

#[test]
fn no_module_imports_upwards() {
    let folder = root().join("crates/tessuto/src");
    let mut wrong = Vec::new();
    let mut files = Vec::new();
    sources(&folder, &mut files);
    for path in files {
        let inside = path.strip_prefix(&folder).unwrap();
        let module = inside.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs");
        let own = layer(module).unwrap_or_else(|| panic!("module {module} has no layer: add it to LAYERS"));
        let text = std::fs::read_to_string(&path).unwrap();
        for line in text.lines().take_while(|line| !line.contains("#[cfg(test)]")) {
            let Some(rest) = line.trim_start().strip_prefix("use crate::") else { continue };
            let imported: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            // Names without a module of their own are re-exports of `lib.rs`, all from low layers.
            let Some(other) = layer(&imported) else { continue };
            if imported != module && other >= own {
                wrong.push(format!("{}: {}", inside.display(), line.trim()));
            }
        }
    }
    assert!(wrong.is_empty(), "upward or sideways imports: {wrong:#?}");
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
