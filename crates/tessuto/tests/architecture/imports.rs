//! Which module a source file refers to: in `use` lines and in paths anywhere in the code, through `crate::`, `super::`
//! and re-exports.

use std::collections::{BTreeMap, BTreeSet};

/// A module, from the root of the crate.
pub type Module = Vec<String>;

/// The sources of one crate by module, and what they refer to.
pub struct Crate {
    sources: BTreeMap<Module, String>,
    /// The path that a module's `use` gives a short name.
    names: BTreeMap<Module, BTreeMap<String, Module>>,
}

impl Crate {
    /// From pairs of a path below `src/` and the file's text.
    pub fn new<'a>(files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Self {
        let mut out = Self { sources: BTreeMap::new(), names: BTreeMap::new() };
        for (path, text) in files {
            let mut module: Module = path.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
            if module.last().is_some_and(|last| last == "mod") || module == ["lib"] {
                module.pop();
            }
            out.sources.insert(module, code(text));
        }
        for (module, text) in &out.sources {
            let tokens = tokens(text);
            let mut names = BTreeMap::new();
            for k in (0..tokens.len()).filter(|&k| tokens[k] == "use") {
                let mut found = Vec::new();
                expand(&tokens, k + 1, &mut Vec::new(), &mut found);
                for path in found {
                    // `use x::y` in a module with a child x is a path from here.
                    let absolute = out.absolute(module, &path).or_else(|| {
                        let child = [module.as_slice(), path.get(..1)?].concat();
                        out.sources.contains_key(&child).then(|| [module.as_slice(), &path].concat())
                    });
                    if let (Some(absolute), Some(name)) = (absolute, path.last()) {
                        names.insert(name.clone(), absolute);
                    }
                }
            }
            out.names.insert(module.clone(), names);
        }
        out
    }

    /// Pairs of a file's module and a path that it refers to, from the root, re-exports resolved.
    pub fn references(&self) -> BTreeSet<(Module, Module)> {
        let mut out = BTreeSet::new();
        for (module, text) in &self.sources {
            let tokens = tokens(text);
            let starts = |k: &usize| {
                ["crate", "super", "self"].contains(&tokens[*k])
                    && tokens.get(k + 1) == Some(&"::")
                    && (*k == 0 || tokens[*k - 1] != "::")
            };
            for k in (0..tokens.len()).filter(starts) {
                let mut found = Vec::new();
                expand(&tokens, k, &mut Vec::new(), &mut found);
                for path in found {
                    if let Some(target) = self.absolute(module, &path) {
                        out.insert((module.clone(), self.resolved(target)));
                    }
                }
            }
        }
        out
    }

    /// Circles among the modules of one folder, each as `folder: a → b → a`.
    pub fn circles(&self) -> Vec<String> {
        let mut edges: BTreeMap<Module, BTreeMap<String, BTreeSet<String>>> = BTreeMap::new();
        for (from, to) in self.references() {
            let level = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
            if level == 0 || level >= from.len() || level >= to.len() {
                // Modules at the root have layers; parents and children may know each other.
                continue;
            }
            let child = [&to[..level], &to[level..=level]].concat();
            if self.sources.contains_key(&child) {
                let folder = edges.entry(from[..level].to_vec()).or_default();
                folder.entry(from[level].clone()).or_default().insert(to[level].clone());
            }
        }
        let mut out = Vec::new();
        for (folder, graph) in edges {
            for start in graph.keys() {
                let mut ways = vec![vec![start.clone()]];
                let mut seen = BTreeSet::new();
                while let Some(way) = ways.pop() {
                    for next in graph.get(&way[way.len() - 1]).into_iter().flatten() {
                        let longer = [way.as_slice(), std::slice::from_ref(next)].concat();
                        if next == start {
                            // Each circle once, from its first module.
                            if longer.iter().all(|m| m >= start) {
                                out.push(format!("{}: {}", folder.join("/"), longer.join(" → ")));
                            }
                        } else if seen.insert(next.clone()) {
                            ways.push(longer);
                        }
                    }
                }
            }
        }
        out
    }

    /// `path` as seen from the root, if it starts with `crate`, `super` or `self`.
    fn absolute(&self, module: &Module, path: &[String]) -> Option<Module> {
        let mut out = match path.first()?.as_str() {
            "crate" => Vec::new(),
            "super" | "self" => module.clone(),
            _ => return None,
        };
        for segment in path {
            match segment.as_str() {
                "crate" | "self" => {}
                "super" => {
                    out.pop()?;
                }
                name => out.push(name.to_owned()),
            }
        }
        Some(out)
    }

    /// The path behind re-exports.
    fn resolved(&self, mut path: Module) -> Module {
        // A circle of re-exports does not compile; the bound is for the tests of this file.
        for _ in 0..8 {
            let inside = (0..=path.len()).rev().find(|&n| self.sources.contains_key(&path[..n]));
            let Some(inside) = inside.filter(|n| *n < path.len()) else { break };
            match self.names.get(&path[..inside]).and_then(|names| names.get(&path[inside])) {
                Some(behind) => path = [behind.as_slice(), &path[inside + 1..]].concat(),
                None => break,
            }
        }
        path
    }
}

/// `text` without comments, strings and the test module at its end.
pub fn code(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let skipped = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").map_or(rest.len(), |end| end + 2)
        } else if let Some(raw) = rest.strip_prefix("r\"") {
            raw.find('"').map_or(rest.len(), |end| end + 3)
        } else if rest.starts_with("r#\"") {
            rest.find("\"#").map_or(rest.len(), |end| end + 2)
        } else if first == '"' {
            string_length(rest)
        } else if rest.starts_with("'\"'") || rest.starts_with("b'\"'") {
            rest.find("\"'").map_or(rest.len(), |end| end + 2)
        } else {
            0
        };
        if skipped == 0 {
            out.push(first);
            rest = &rest[first.len_utf8()..];
        } else {
            rest = &rest[skipped..];
        }
    }
    let tests = out.match_indices("#[cfg(test)]").find(|(at, mark)| {
        let next = out[at + mark.len()..].trim_start().lines().next().unwrap_or_default();
        next.contains("mod ") && next.contains('{')
    });
    if let Some((at, _)) = tests {
        out.truncate(at);
    }
    out
}

/// Bytes of the string literal that `text` starts with.
fn string_length(text: &str) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => return at + 1,
            _ => {}
        }
    }
    text.len()
}

/// Words, `::`, and every other visible character.
fn tokens(text: &str) -> Vec<&str> {
    let mut out = Vec::new();
    let mut rest = text.trim_start();
    while let Some(first) = rest.chars().next() {
        let word = |c: char| c.is_alphanumeric() || c == '_';
        let length = if word(first) {
            rest.find(|c| !word(c)).unwrap_or(rest.len())
        } else if rest.starts_with("::") {
            2
        } else {
            first.len_utf8()
        };
        out.push(&rest[..length]);
        rest = rest[length..].trim_start();
    }
    out
}

/// Adds every path of the tree `a::{b, c::d}` that starts at token `at`; returns the token behind it.
fn expand(tokens: &[&str], mut at: usize, prefix: &mut Vec<String>, out: &mut Vec<Vec<String>>) -> usize {
    let depth = prefix.len();
    loop {
        match tokens.get(at) {
            Some(&"{") => {
                at += 1;
                while tokens.get(at).is_some_and(|t| *t != "}") {
                    let next = expand(tokens, at, prefix, out);
                    at = next.max(at + 1);
                    if tokens.get(at) == Some(&",") {
                        at += 1;
                    }
                }
                at += 1;
                break;
            }
            Some(word) if word.starts_with(|c: char| c.is_alphabetic() || c == '_') => {
                prefix.push((*word).to_owned());
                at += 1;
                if tokens.get(at) != Some(&"::") {
                    out.push(prefix.clone());
                    break;
                }
                at += 1;
            }
            // `*`, or the generic arguments of `Vec::<…>`.
            _ => {
                out.push(prefix.clone());
                break;
            }
        }
    }
    prefix.truncate(depth);
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target(files: &[(&str, &str)], from: &str) -> Vec<String> {
        let found = Crate::new(files.iter().copied()).references();
        found.into_iter().filter(|(m, _)| m.join("/") == from).map(|(_, to)| to.join("::")).collect()
    }

    #[test]
    fn paths_are_seen_wherever_they_stand() {
        let text =
            "use crate::scene::{Scene, io::{self, read}};\nfn f() { let x = crate::result::write(1); }";
        let found = target(&[("sim/step.rs", text)], "sim/step");
        assert_eq!(found, ["result::write", "scene::Scene", "scene::io", "scene::io::read"]);
    }

    #[test]
    fn comments_strings_and_tests_do_not_count() {
        let text = "//! crate::a\n/// [`crate::b`]\nconst S: &str = \"crate::c \\\" crate::d\"; // crate::e\n\
                    const Q: char = '\"'; fn f() { crate::g() }\n#[cfg(test)]\nmod tests { use crate::h; }";
        assert_eq!(target(&[("x.rs", text)], "x"), ["g"]);
    }

    #[test]
    fn re_exports_lead_to_their_module() {
        let files = [
            ("lib.rs", "pub use error::{Error, Result};\npub use config::Config;"),
            ("error.rs", ""),
            ("config.rs", ""),
            ("sim/mod.rs", "mod state;\npub use state::State;"),
            ("sim/state.rs", ""),
            ("sim/step.rs", "use super::State;\nfn f() -> crate::Result<crate::Config> {}"),
        ];
        assert_eq!(target(&files, "sim/step"), ["config::Config", "error::Result", "sim::state::State"]);
    }

    #[test]
    fn circles_between_siblings_are_found() {
        let mut files = vec![
            ("report/mod.rs", "mod legend; mod pictures; mod page;\npub use legend::Legend;"),
            ("report/legend.rs", "fn f() -> super::pictures::Kind {}"),
            ("report/pictures.rs", "use super::Legend;"),
            ("report/page.rs", "use super::{legend::Legend, pictures};"),
        ];
        assert_eq!(Crate::new(files.clone()).circles(), ["report: legend → pictures → legend"]);
        files[1].1 = "";
        assert!(Crate::new(files).circles().is_empty());
    }
}
