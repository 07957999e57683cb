//! docs/formats.md has what every format is, and what it does with frames that are left out.

use std::path::Path;

use tessuto::export::Format;

#[test]
fn every_format_stands_in_the_documents() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/formats.md");
    let text = std::fs::read_to_string(file).unwrap();
    let rows_below = |head: &str| -> Vec<&str> {
        let lines = text.lines().skip_while(|line| *line != head).skip(2);
        lines.take_while(|line| line.starts_with('|')).filter_map(|line| line.split('|').nth(1)).collect()
    };
    for head in ["| format | content |", "| format | where frames are left out |"] {
        let rows = rows_below(head);
        for format in Format::KNOWN {
            let named = format!("`{}`", format.key());
            assert!(rows.iter().any(|cell| cell.contains(&named)), "{head} lacks {named}: {rows:?}");
        }
        // Nor is there what no build writes.
        let keys = rows.iter().flat_map(|cell| cell.split('`').skip(1).step_by(2));
        assert_eq!(keys.count(), Format::KNOWN.len(), "{head}: {rows:?}");
    }
    let example = text.lines().find(|line| line.starts_with("tessuto export results/curtain --to")).unwrap();
    assert!(Format::KNOWN.iter().all(|format| example.contains(format.key())), "{example}");
}
