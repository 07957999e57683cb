//! The documents name only what exists, with the values that it has; files are short. That crates know only those
//! below them is Cargo's to hold.

mod code;
mod constants;
mod words;

use std::path::{Path, PathBuf};

/// The crates of the library, from the bottom up.
const LIBRARY: [&str; 6] =
    ["tessuto-core", "tessuto-sim", "tessuto-render", "tessuto-scene", "tessuto-estimate", "tessuto"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Every Rust file below `folder`.
fn sources(folder: &Path, out: &mut Vec<PathBuf>) {
    files(folder, &["rs"], out);
}

/// Every file with one of `endings` below `folder`, except what others wrote (`vendor`) and what a program made.
fn files(folder: &Path, endings: &[&str], out: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let left_out = name.starts_with('.') || ["vendor", "target", "node_modules"].contains(&name);
        if path.is_dir() && !left_out {
            files(&path, endings, out);
        } else if path.extension().and_then(|e| e.to_str()).is_some_and(|e| endings.contains(&e)) {
            out.push(path);
        }
    }
}

fn all_sources() -> Vec<PathBuf> {
    let mut out = Vec::new();
    for name in LIBRARY.into_iter().chain(["tessuto-cli", "tessuto-video"]) {
        sources(&root().join("crates").join(name).join("src"), &mut out);
    }
    assert!(out.len() > 400, "found only {} files", out.len());
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

/// The library's sources: paths from the root of the repository, and texts.
fn library() -> Vec<(String, String)> {
    let root = root();
    let mut files = Vec::new();
    for name in LIBRARY {
        let before = files.len();
        sources(&root.join("crates").join(name).join("src"), &mut files);
        assert!(files.len() > before, "{name} has no sources");
    }
    let inside = |path: &PathBuf| path.strip_prefix(&root).unwrap().to_str().unwrap().replace('\\', "/");
    files.iter().map(|path| (inside(path), std::fs::read_to_string(path).unwrap())).collect()
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

/// The widest line of a source, in characters.
const COLUMNS: usize = 120;

/// Whether `line` is too wide. A row of a table in a comment cannot be broken, nor can what holds no space, such as an
/// address.
fn is_wide(line: &str) -> bool {
    let text = line.trim_start().trim_start_matches(['/', '!', '#', '*']).trim();
    line.chars().count() > COLUMNS && !text.starts_with('|') && text.contains(' ')
}

#[test]
fn lines_are_narrow() {
    let mut paths = Vec::new();
    for folder in ["crates", "fuzz", "tools", "workflow"] {
        files(&root().join(folder), &["rs", "py", "js", "mjs", "css", "html", "sh"], &mut paths);
    }
    assert!(paths.len() > 600, "found only {} files", paths.len());
    let mut wrong = Vec::new();
    for path in paths {
        let text = std::fs::read_to_string(&path).unwrap();
        for (k, line) in text.lines().enumerate().filter(|(_, line)| is_wide(line)) {
            wrong.push(format!("{}:{}: {} characters", path.display(), k + 1, line.chars().count()));
        }
    }
    assert!(wrong.is_empty(), "more than {COLUMNS}: {wrong:#?}");
}

#[test]
fn wide_lines_are_found() {
    let words = "ä ".repeat(60);
    assert!(is_wide(&format!("{words}b")) && !is_wide(words.trim_end()));
    assert!(!is_wide(&format!("//! | {words} | b |")) && !is_wide(&format!("/// <{}>", "a".repeat(120))));
    assert!(is_wide(&format!("//! a | {words} | b |")));
}
