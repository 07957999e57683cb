//! `docs/constants.md` and the code say the same: decisions with their values, all other constants of the default
//! method with their class.

use std::collections::{BTreeMap, BTreeSet};

use super::code::code as code_of;
use super::{library, root};

/// Where the default method is, below this; its tests in files of their own.
const SOURCES: &str = "crates/tessuto-estimate/src/";
const METHOD: &str =
    "motion/spacetime/ motion/terms/ motion/observed/ motion/causes/ metrics/verdict/ metrics/agreement.rs";
const TESTS: [&str; 2] = ["/proof.rs", "/tests.rs"];
const CLASSES: [&str; 5] = ["physics", "statistics", "numerics", "continuation", "structure"];
/// Name of a number that has none: the code's own text stands for it.
const INLINE: &str = "inline";

/// The library's code without tests, by its path from the root of the repository.
fn code() -> BTreeMap<String, String> {
    library().into_iter().map(|(path, text)| (path, code_of(&text))).collect()
}

/// The rows of the table below the heading `title`, without backticks.
fn table<const N: usize>(title: &str) -> Vec<[String; N]> {
    let document = std::fs::read_to_string(root().join("docs/constants.md")).unwrap();
    let section = document.split("\n## ").find(|section| section.starts_with(title)).unwrap_or_default();
    let row = |line: &str| -> [String; N] {
        let cells = line.trim_matches('|').split(" | ").map(|cell| cell.replace('`', "").trim().to_owned());
        let cells: Vec<String> = cells.collect();
        cells.try_into().unwrap_or_else(|cells: Vec<String>| panic!("{title}: not {N} cells: {cells:?}"))
    };
    section.lines().filter(|line| line.starts_with("| ")).skip(1).map(row).collect()
}

/// Name or text, file and class of everything in the second list.
fn others() -> Vec<[String; 3]> {
    let mut out = Vec::new();
    for [names, file, class] in table::<3>("Not decisions") {
        // Texts have commas of their own.
        let several = names.split(if names.starts_with(INLINE) { "\n" } else { ", " });
        out.extend(several.map(|name| [name.to_owned(), file.clone(), class.clone()]));
    }
    out
}

/// Names of the constants that `code` declares, whatever their types.
fn declared(code: &str) -> impl Iterator<Item = &str> {
    code.lines().filter_map(|line| {
        let (before, after) = line.split_once("const ")?;
        let name = after.split_once(':')?.0;
        let starts = before.trim().is_empty() || before.trim().starts_with("pub");
        let capital = name.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_');
        (starts && capital).then_some(name)
    })
}

/// Whether `code` declares the constant `name` as `value`; of an inline number, whether it holds the text `value` once.
fn holds(code: &str, name: &str, value: &str) -> bool {
    let [code, value] = [code, value].map(|text| text.split_whitespace().collect::<String>());
    if name == INLINE {
        return code.matches(value.as_str()).count() == 1;
    }
    let typed = code.split_once(format!("const{name}:").as_str());
    let assigned = typed.and_then(|(_, rest)| rest.split_once('='));
    assigned.is_some_and(|(_, rest)| rest.starts_with(format!("{value};").as_str()))
}

#[test]
fn every_decision_stands_in_the_table_with_its_value() {
    let (code, rows) = (code(), table::<7>("Decisions"));
    assert!(rows.len() > 20, "only {} decisions", rows.len());
    for row in rows {
        let [name, value, file, ..] = &row;
        let there = code.get(file).is_some_and(|code| holds(code, name, value));
        assert!(there, "docs/constants.md has `{name}` with `{value}`, {file} has not");
        assert!(!row.iter().any(String::is_empty), "`{name}` of {file} has an empty cell");
    }
    // The same check sees what is wrong.
    let planted = "pub const LEAST: [f64; 2] =\n    [0.1, 0.5];\nlet far = x > 0.3;";
    assert!(holds(planted, "LEAST", "[0.1, 0.5]") && holds(planted, INLINE, "x > 0.3"));
    assert!(!holds(planted, "LEAST", "[0.1, 0.4]") && !holds(planted, INLINE, "x > 0.4"));
}

#[test]
fn every_constant_of_the_default_method_stands_in_one_list() {
    let code = code();
    let below = |path: &str| METHOD.split(' ').any(|part| path.starts_with(part));
    let found: BTreeSet<String> = (code.iter())
        .filter(|(file, _)| file.strip_prefix(SOURCES).is_some_and(below))
        .filter(|(file, _)| !TESTS.iter().any(|test| file.ends_with(*test)))
        .flat_map(|(file, code)| declared(code).map(move |name| format!("{name} of {file}")))
        .collect();
    let decisions = table::<7>("Decisions").into_iter().filter(|[name, ..]| name != INLINE);
    let mut listed: Vec<String> = decisions.map(|[name, _, file, ..]| format!("{name} of {file}")).collect();
    for [name, file, class] in others() {
        let place = format!("{name} of {file}");
        assert!(CLASSES.contains(&class.as_str()), "{place}: no class is `{class}`");
        let exists = match name.strip_prefix("inline ") {
            Some(text) => code.get(&file).is_some_and(|code| holds(code, INLINE, text)),
            None => found.contains(&place),
        };
        assert!(exists, "docs/constants.md lists {place}, which is not there");
        listed.push(place);
    }
    listed.sort();
    let twice: Vec<&[String]> = listed.windows(2).filter(|pair| pair[0] == pair[1]).collect();
    let unlisted: Vec<&String> = found.iter().filter(|place| !listed.contains(*place)).collect();
    assert!(twice.is_empty() && unlisted.is_empty(), "twice: {twice:#?}, in no list: {unlisted:#?}");
}

#[test]
fn as_many_constants_are_told_as_are_listed() {
    let others = others();
    for class in CLASSES.into_iter().chain(["decisions"]) {
        let of_class = others.iter().filter(|[.., of]| of == class).count();
        let listed = if class == "decisions" { table::<7>("Decisions").len() } else { of_class };
        let told = table::<3>("How many").into_iter().find(|[of, ..]| of == class).map(|[_, rows, _]| rows);
        assert_eq!(told, Some(listed.to_string()), "docs/constants.md, how many: {class}");
    }
}
