//! What commands said, kept in a file each: `$ ` and the command, its words, `= ` and how it ended. Whoever reads
//! it knows what went on, whether the server that started it still lives or not.

use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;

use serde::Serialize;

/// This many bytes of a log's end are read.
const TAIL: u64 = 64 << 10;

/// What a log says.
#[derive(Debug, Default, PartialEq, Serialize)]
pub struct News {
    /// The latest command.
    pub command: String,
    /// What it and those before it said, progress lines left out.
    pub text: String,
    /// Its latest progress line.
    pub progress: Option<String>,
    /// Part of a long run that is done.
    pub fraction: Option<f64>,
    /// Address of its live page.
    pub live: Option<String>,
    /// How it ended, if it has: `ok`, `stopped` or `failed`.
    pub ended: Option<&'static str>,
    /// Its message, if it failed.
    pub error: Option<String>,
}

/// Reads the end of the log at `path`.
pub fn read(path: &Path) -> Option<News> {
    let mut file = std::fs::File::open(path).ok()?;
    let length = file.metadata().ok()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(TAIL))).ok()?;
    let mut bytes = Vec::new();
    file.take(TAIL).read_to_end(&mut bytes).ok()?;
    Some(parse(&String::from_utf8_lossy(&bytes)))
}

/// What a line of progress says: `stage 2 of 5, refine 3/9, about 4 min left (37 %)`, or `masks: 37 %`.
fn fraction(line: &str) -> Option<f64> {
    let percent = match line.strip_prefix("masks: ") {
        Some(masks) => masks.strip_suffix(" %")?,
        None => line.strip_suffix(" %)")?.rsplit_once('(')?.1,
    };
    percent.parse().ok().map(|p: f64| p / 100.0)
}

fn is_progress(line: &str) -> bool {
    line.starts_with("stage ") && line.contains(" of ") || line.starts_with("masks: ") && line.ends_with(" %")
}

fn parse(text: &str) -> News {
    let mut news = News::default();
    let mut error: Option<Vec<&str>> = None;
    for line in text.lines() {
        if let Some(command) = line.strip_prefix("$ ") {
            let text = std::mem::take(&mut news.text);
            news = News { command: command.to_owned(), text, ..News::default() };
            error = None;
        } else if let Some(end) = line.strip_prefix("= ") {
            news.ended = Some(match end {
                "ok" => "ok",
                "stopped" => "stopped",
                _ => "failed",
            });
            continue;
        } else if is_progress(line) {
            news.progress = Some(line.to_owned());
            news.fraction = fraction(line).or(news.fraction);
            continue;
        } else if let Some(address) = line.strip_prefix("live at ") {
            news.live = Some(address.trim().to_owned()).filter(|a| a.starts_with("http://127.0.0.1:"));
        } else if line.starts_with("error: ") {
            error = Some(vec![line.trim_start_matches("error: ")]);
        } else if let Some(lines) = &mut error {
            lines.push(line);
        }
        news.text.push_str(line);
        news.text.push('\n');
    }
    // A check that found errors says so in its table.
    news.error = error.map(|lines| lines.join("\n"));
    news
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_errors_and_ends_are_told_apart() {
        let text = "$ tessuto import a b\nnote: turned\n= ok\n$ tessuto reconstruct b\nlive at http://127.0.0.1:5/\n\
                    stage 2 of 5, refine 3/9, about 4 min left (37 %)\nwarning: dark\n";
        let news = parse(text);
        assert_eq!(news.command, "tessuto reconstruct b");
        assert_eq!(
            (news.fraction, news.live.as_deref(), news.ended),
            (Some(0.37), Some("http://127.0.0.1:5/"), None)
        );
        assert!(news.progress.unwrap().starts_with("stage 2 of 5") && !news.text.contains("stage 2"));
        assert!(news.text.contains("note: turned") && news.text.contains("warning: dark"));
        let news = parse(&format!("{text}error: a.obj: strange\n  hint: turn it\n= status 3\n"));
        assert_eq!(
            (news.error.as_deref(), news.ended),
            (Some("a.obj: strange\n  hint: turn it"), Some("failed"))
        );
        assert_eq!(parse("$ a\nmasks: 12 %\nmasks: 40 %\n").fraction, Some(0.4));
        assert_eq!(parse("$ a\n= stopped\n").ended, Some("stopped"));
        assert_eq!(parse("live at http://evil.example/\n").live, None);
    }
}
