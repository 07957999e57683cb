//! `tessuto man`.

use std::process::Command;

#[test]
fn every_command_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    let run = |folder: &std::path::Path| {
        Command::new(env!("CARGO_BIN_EXE_tessuto")).arg("man").arg(folder).output().unwrap().status.code()
    };
    assert_eq!(run(folder.path()), Some(0));
    for (name, word) in [
        ("tessuto.1", "reconstruct"),
        ("tessuto-reconstruct.1", ".SH NOTES\n.nf\nExamples:\n"),
        ("tessuto-man.1", ""),
    ] {
        let page = std::fs::read_to_string(folder.path().join(name)).unwrap();
        assert!(page.contains(".TH tessuto") && page.contains(word), "{name}: {page}");
    }
    assert_eq!(run(&folder.path().join("missing")), Some(5));
}
