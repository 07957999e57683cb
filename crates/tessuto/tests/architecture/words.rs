//! The library's messages name causes and fields; the program's options and commands are the program's own.

/// What may name a command of the program, and why.
const ALLOWED: [(&str, &str); 6] = [
    // Marks in files, by which they are recognised again.
    ("tessuto-estimate/src/session/checkpoint.rs", "tessuto checkpoint 1"),
    ("tessuto-estimate/src/io/image.rs", "tEXtSoftware\\0tessuto check"),
    ("tessuto-estimate/src/import/mod.rs", "tessuto import"),
    ("tessuto-estimate/src/synth/write.rs", "tessuto synth"),
    // Commands of other programs.
    ("tessuto-estimate/src/import/colmap.rs", "--ImageReader."),
    ("tessuto-estimate/src/import/calibration_file.rs", "colmap model_converter --input_path"),
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
