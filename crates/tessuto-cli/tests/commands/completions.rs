//! `tessuto completions`.

use std::process::Command;

fn said(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_tessuto")).args(arguments).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Names in the list of commands of `--help`.
fn commands() -> Vec<String> {
    let help = said(&["--help"]);
    let lines =
        help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    // Continued lines are indented further.
    lines
        .filter_map(|line| line.strip_prefix("  ")?.split(' ').next())
        .filter(|s| !s.is_empty())
        .map(Into::into)
        .collect()
}

#[test]
fn every_shell_gets_every_command() {
    let commands = commands();
    assert!(commands.len() >= 15 && commands.contains(&"completions".to_owned()), "{commands:?}");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = said(&["completions", shell]);
        for word in commands.iter().map(String::as_str).chain(["resume", "without-lost"]) {
            assert!(script.contains(word), "{shell} knows no {word}");
        }
    }
    let wrong = Command::new(env!("CARGO_BIN_EXE_tessuto")).args(["completions", "tcsh"]).output().unwrap();
    assert_eq!(wrong.status.code(), Some(2));
}

#[test]
fn bash_completes_a_command_and_an_option() {
    if Command::new("bash").arg("--version").output().is_err() {
        eprintln!("NOT TESTED: bash_completes_a_command_and_an_option (no bash)");
        return;
    }
    for (words, completed) in [("tessuto rec", "reconstruct"), ("tessuto reconstruct --res", "--resume")] {
        let last = words.split(' ').count() - 1;
        let line = r#"source /dev/stdin; COMP_WORDS=($1); COMP_CWORD=$2
            _tessuto tessuto "${COMP_WORDS[$2]}" "${COMP_WORDS[$2 - 1]}"; echo "${COMPREPLY[*]}""#;
        let mut bash = Command::new("bash");
        bash.args(["-c", line, "bash", words, &last.to_string()]);
        bash.stdin(std::process::Stdio::piped()).stdout(std::process::Stdio::piped());
        let mut bash = bash.spawn().unwrap();
        let script = said(&["completions", "bash"]);
        std::io::Write::write_all(&mut bash.stdin.take().unwrap(), script.as_bytes()).unwrap();
        let output = bash.wait_with_output().unwrap();
        assert_eq!(String::from_utf8_lossy(&output.stdout).trim(), completed, "{words}");
    }
}
