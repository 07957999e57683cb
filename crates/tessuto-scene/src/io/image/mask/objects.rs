//! The objects of a mask: their list, and the one that is asked for.

use super::choice::Object;
use tessuto_core::error::{Error, Hint, Remedy, Result};

/// Objects that a message names at most.
const LISTED: usize = 8;
/// A colour is the one asked for within so much in every channel.
const SAME: u8 = 8;

/// What may be the fabric.
#[derive(Debug, Clone)]
pub(super) struct Candidate {
    pub key: u32,
    /// Index in the palette, or grey value; none of plain colours.
    pub label: Option<u32>,
    pub colour: [u8; 3],
    /// Fraction of the image, where it is.
    pub share: f64,
    /// Files that it is in.
    pub files: usize,
}

impl Candidate {
    /// Label and colour.
    pub fn named(&self) -> String {
        let [r, g, b] = self.colour;
        match self.label {
            Some(label) if r == g && g == b => format!("label {label}"),
            Some(label) => format!("label {label} (colour {r},{g},{b})"),
            None => format!("colour {r},{g},{b}"),
        }
    }
}

/// The key of the only one of `candidates`, or of the `object` that was asked for. The list is ordered by labels,
/// where all have some, else as they come.
///
/// # Errors
/// [`Error::Input`] with the list.
pub(super) fn chosen(
    place: &str,
    mut candidates: Vec<Candidate>,
    files: usize,
    object: Option<&Object>,
) -> Result<u32> {
    let by_label = candidates.iter().all(|c| c.label.is_some());
    if by_label {
        candidates.sort_by_key(|c| c.label);
    }
    let found = match object {
        None if candidates.len() == 1 => candidates.first(),
        None => None,
        Some(Object::Number(n)) => candidates
            .iter()
            .enumerate()
            .find(|(k, c)| c.label.unwrap_or(*k as u32 + 1) == *n)
            .map(|(_, c)| c),
        Some(Object::Colour(colour)) => {
            let near = |c: &&Candidate| c.colour.iter().zip(colour).all(|(a, b)| a.abs_diff(*b) <= SAME);
            candidates.iter().find(near)
        }
    };
    if let Some(found) = found {
        return Ok(found.key);
    }
    let row = |(k, c): (usize, &Candidate)| {
        let number = if by_label { String::new() } else { format!("{}: ", k + 1) };
        let masks = if files > 1 { format!(" in {} of {files} masks", c.files) } else { String::new() };
        format!("{number}{}, {:.1} % of the image{masks}", c.named(), 100.0 * c.share)
    };
    let mut rows: Vec<String> = candidates.iter().enumerate().take(LISTED).map(row).collect();
    if candidates.len() > LISTED {
        rows.push("…".into());
    }
    let count = candidates.len();
    let objects = if count == 1 { "object" } else { "objects" };
    let problem = match object {
        None => format!("holds {count} {objects}: {}", rows.join("; ")),
        Some(object) => format!("has no object {object}; it holds {count} {objects}: {}", rows.join("; ")),
    };
    let hint = match by_label {
        true => "choose the one that is the fabric, by its label or its colour",
        false => "choose the one that is the fabric, by its number in this list or its colour",
    };
    Err(Error::input(place, problem, Hint::from(hint).with(Remedy::Object)))
}
