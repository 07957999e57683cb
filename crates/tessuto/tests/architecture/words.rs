//! The library's messages name causes and fields; the program's options and commands are the program's own.
//! Documents, help and messages keep to the words of CONTRIBUTING.md.

/// What may name a command of the program, and why.
const ALLOWED: [(&str, &str); 6] = [
    // Marks in files, by which they are recognised again.
    ("tessuto-estimate/src/session/checkpoint.rs", "tessuto checkpoint 2"),
    ("tessuto-scene/src/io/image.rs", "tEXtSoftware\\0tessuto check"),
    ("tessuto-scene/src/import/mod.rs", "tessuto import"),
    ("tessuto-scene/src/synth/write.rs", "tessuto synth"),
    // Commands of other programs.
    ("tessuto-scene/src/import/colmap.rs", "--ImageReader."),
    ("tessuto-scene/src/import/calibration_file.rs", "colmap model_converter --input_path"),
];

/// The text of every string in Rust source, without its tests.
fn strings(source: &str) -> Vec<String> {
    let source = source.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    let (mut out, mut rest) = (Vec::new(), source);
    while let Some(at) = rest.find(['"', '/', '\'']) {
        let from = &rest[at..];
        if from.starts_with("//") {
            rest = from.split_once('\n').map_or("", |(_, after)| after);
        } else if from.starts_with("'\"'") || from.starts_with("'\\\"'") {
            rest = &from[from[1..].find('\'').unwrap() + 2..];
        } else if let Some(text) = from.strip_prefix('"') {
            let hashes = rest[..at].len() - rest[..at].trim_end_matches('#').len();
            let raw = rest[..at - hashes].ends_with('r');
            let end = match raw {
                true => text.find(&format!("\"{}", "#".repeat(hashes))).unwrap(),
                false => {
                    let mut escaped = false;
                    let closes = |c: char| {
                        let closing = c == '"' && !escaped;
                        escaped = c == '\\' && !escaped;
                        closing
                    };
                    text.find(closes).unwrap()
                }
            };
            out.push(text[..end].to_owned());
            rest = &text[end + 1..];
        } else {
            rest = &from[1..];
        }
    }
    out
}

/// Whether `text` holds an option, `--word`, or one of the program's `commands`, `tessuto word`.
fn names_the_program(text: &str, commands: &[String]) -> bool {
    let letter = |rest: &str| rest.starts_with(|c: char| c.is_ascii_alphabetic());
    let command = |rest: &str| commands.iter().any(|c| rest.starts_with(c.as_str()));
    text.split("--").skip(1).any(letter) || text.split("tessuto ").skip(1).any(command)
}

#[test]
fn the_library_knows_no_options_or_commands() {
    let mut files = Vec::new();
    super::sources(&super::root().join("crates/tessuto-cli/src"), &mut files);
    let stem = |path: &std::path::PathBuf| match path.file_stem().unwrap().to_str().unwrap() {
        "mod" => path.parent().unwrap().file_name().unwrap().to_str().unwrap().to_owned(),
        stem => stem.to_owned(),
    };
    let commands: Vec<String> = files.iter().map(stem).collect();
    assert!(commands.contains(&"reconstruct".to_owned()) && commands.contains(&"template".to_owned()));

    let mut wrong = Vec::new();
    let mut used = vec![false; ALLOWED.len()];
    for (path, text) in super::library() {
        for string in strings(&text).into_iter().filter(|s| names_the_program(s, &commands)) {
            match ALLOWED
                .iter()
                .position(|(file, part)| path.strip_prefix("crates/") == Some(*file) && string.contains(part))
            {
                Some(k) => used[k] = true,
                None => wrong.push(format!("{path}: {string}")),
            }
        }
    }
    assert!(wrong.is_empty(), "a `Remedy` says it in the library's terms: {wrong:#?}");
    assert!(used.iter().all(|used| *used), "no longer needed: {used:?}");
}

#[test]
fn strings_are_found_as_they_stand() {
    let source = "let a = '\"'; // \"--no\"\n f(\"--yes\", r#\"a\"b\"#, \"c\\\"d\", 'x', \"/\");";
    assert_eq!(strings(source), ["--yes", "a\"b", "c\\\"d", "/"]);
    let commands = ["check".to_owned()];
    assert!(names_the_program("use --fps", &commands) && names_the_program("`tessuto check`", &commands));
    assert!(!names_the_program("a -- b, of tessuto's", &commands));
}

/// Words and phrases that CONTRIBUTING.md retires, in small letters.
const RETIRED: [&str; 19] = [
    "heed",
    "heeds",
    "heeded",
    "told",
    "foretold",
    "foretell",
    "meanwhile",
    "so many",
    "what is left of",
    "taken for",
    "but for",
    "of before",
    "as the last time",
    "trajectory",
    "picture",
    "pictures",
    "share of",
    "shares of",
    "contour",
];
/// Documents of today. The lists of sources, crates, thresholds and figures have rows in their own style; the logs
/// stay as they were written.
const DOCUMENTS: [&str; 18] = [
    "README.md",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "SECURITY.md",
    "llms.txt",
    "docs/exit-codes.md",
    "docs/formats.md",
    "docs/gallery.md",
    "docs/limits.md",
    "docs/reliability.md",
    "docs/result-folder.md",
    "docs/settings.md",
    "docs/studio.md",
    "docs/tutorial.md",
    "workflow/README.md",
    "crates/tessuto-py/README.md",
    "docs/experiments/methods.md",
];

/// The retired words in `text`; those in code spans, options, placeholders and paths do not count.
fn retired(text: &str) -> Vec<&'static str> {
    let mut prose = String::from(" ");
    for (k, part) in text.split('`').enumerate() {
        prose.push_str(if k % 2 == 0 { part } else { "code" });
    }
    let outside = |word: &str| !word.contains(['/', '{', '_']) && !word.starts_with("--");
    let words = prose.split_whitespace().filter(|word| outside(word));
    let bare = |word: &str| word.trim_matches(|c: char| !c.is_alphanumeric()).to_lowercase();
    let line = format!(" {} ", words.map(bare).collect::<Vec<_>>().join(" "));
    RETIRED.into_iter().filter(|word| line.contains(&format!(" {word} "))).collect()
}

/// A document without its blocks of code, its table of words and its examples of style.
fn prose(document: &str) -> String {
    let outside_of_code = document.split("```").step_by(2).collect::<String>();
    match outside_of_code.split_once("\n## Words\n") {
        Some((before, _)) => before.to_owned(),
        None => outside_of_code,
    }
}

#[test]
fn documents_keep_to_the_words() {
    let mut wrong = Vec::new();
    for document in DOCUMENTS {
        let text = std::fs::read_to_string(super::root().join(document)).unwrap();
        for paragraph in prose(&text).split("\n\n").flat_map(|p| p.split("\n|")) {
            let found = retired(paragraph);
            if !found.is_empty() {
                wrong.push(format!("{document}: {found:?} in: {paragraph}"));
            }
        }
    }
    assert!(wrong.is_empty(), "see the words and rules of CONTRIBUTING.md: {wrong:#?}");
}

#[test]
fn messages_and_help_keep_to_the_words() {
    let mut files = Vec::new();
    super::sources(&super::root().join("crates/tessuto-cli/src"), &mut files);
    let program =
        files.iter().map(|path| (path.display().to_string(), std::fs::read_to_string(path).unwrap()));
    let mut wrong = Vec::new();
    for (path, text) in
        super::library().into_iter().chain(program).filter(|(path, _)| !path.ends_with("tests.rs"))
    {
        let mut said = strings(&text);
        // The program's documentation is its help.
        let comments = text.lines().filter_map(|line| line.trim_start().strip_prefix("/// "));
        said.extend(comments.filter(|_| path.contains("tessuto-cli")).map(str::to_owned));
        for text in said.iter().filter(|text| text.contains(' ')) {
            let found = retired(text);
            if !found.is_empty() {
                wrong.push(format!("{path}: {found:?} in: {text}"));
            }
        }
    }
    assert!(wrong.is_empty(), "see the words and rules of CONTRIBUTING.md: {wrong:#?}");
}

#[test]
fn retired_words_are_found_in_prose_alone() {
    assert_eq!(retired("It is told,\nbut for\n  one."), ["told", "but for"]);
    assert_eq!(retired("Pictures: a share of each"), ["pictures", "share of"]);
    assert!(
        retired("`told` --picture pictures/a.png {told}: they share a lot; in so far as many").is_empty()
    );
    assert_eq!(prose("a\n```\ntold\n```\nb\n## Words\ntold"), "a\n\nb");
}
