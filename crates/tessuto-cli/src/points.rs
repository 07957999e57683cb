//! Lists of points, typed as words or as one string: `--corners 1,2 3,4 5,6 7,8` and `--corners "1,2 3,4 5,6 7,8"`.

use std::ffi::OsString;

/// Options that take points, and places in frames.
const OPTIONS: [&str; 6] =
    ["--outline", "--corners", "--inside", "--outside", "--paper-corners", "--between"];

/// The arguments with the points that follow such an option joined to one value. A word ends the list where it is
/// none: the next option, or the name of a scene.
pub fn joined(arguments: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let mut out: Vec<OsString> = Vec::new();
    // How many words of a list the last one is made of; a lone option has none yet.
    let mut list: Option<usize> = None;
    for word in arguments {
        let text = word.to_str().unwrap_or_default();
        match list {
            Some(0) => {
                out.push(word);
                list = Some(1);
            }
            Some(_) if is_point(text) => {
                let last = out.last_mut().expect("a list has begun");
                last.push(" ");
                last.push(&word);
            }
            _ => {
                list = if OPTIONS.contains(&text) {
                    Some(0)
                } else {
                    OPTIONS
                        .iter()
                        .any(|o| text.strip_prefix(o).is_some_and(|rest| rest.starts_with('=')))
                        .then_some(1)
                };
                out.push(word);
            }
        }
    }
    out
}

/// `X,Y` or `FRAME:X,Y`.
fn is_point(text: &str) -> bool {
    let at =
        text.split_once(':').map_or(text, |(frame, at)| if frame.parse::<usize>().is_ok() { at } else { "" });
    at.split_once(',').is_some_and(|(x, y)| [x, y].iter().all(|v| v.parse::<f64>().is_ok()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_joined_and_nothing_else() {
        let joined = |line: &[&str]| -> Vec<String> {
            joined(line.iter().map(OsString::from)).iter().map(|w| w.to_string_lossy().into_owned()).collect()
        };
        assert_eq!(
            joined(&["template", "--corners", "1,2", "3,4", "-5,6.5", "7,8", "scene", "9,9"]),
            ["template", "--corners", "1,2 3,4 -5,6.5 7,8", "scene", "9,9"]
        );
        assert_eq!(joined(&["--outline=1,2", "3,4", "--force"]), ["--outline=1,2 3,4", "--force"]);
        assert_eq!(
            joined(&["--inside", "3:1,2", "4:5,6", "--outside", "0:1,1"]),
            ["--inside", "3:1,2 4:5,6", "--outside", "0:1,1"]
        );
        assert_eq!(joined(&["--outline", "1,2 3,4", "5,6"]), ["--outline", "1,2 3,4 5,6"]);
        // What is no point stays what it is.
        assert_eq!(joined(&["--flat", "1,2", "3,4"]), ["--flat", "1,2", "3,4"]);
        assert_eq!(joined(&["--outline", "a", "b,c"]), ["--outline", "a", "b,c"]);
    }
}
