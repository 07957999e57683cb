//! The list of tracks.

use super::ebml::{elements, float, number};
use crate::format::Colour;
use crate::refused::{Refused, damaged, not_handled};
use crate::track::{Configuration, avc, hevc};

/// A video track.
pub(super) struct TrackEntry {
    pub(super) number: Option<u64>,
    enabled: bool,
    default: bool,
    /// Width and height `[px]`.
    size: [u64; 2],
    /// How to decode it, or why it is not decoded here.
    pub(super) configuration: Result<Configuration, Refused>,
    /// What stands before every frame, or why it is not read here.
    pub(super) prefix: Result<Vec<u8>, Refused>,
    pub(super) pixel_aspect: Option<[u32; 2]>,
    pub(super) colour: Colour,
}

/// The track that a player shows.
pub(super) fn choose(tracks: &[u8]) -> Result<Option<TrackEntry>, Refused> {
    let mut chosen: Option<TrackEntry> = None;
    for (id, content) in elements(tracks)? {
        if id == 0xAE
            && let Some(found) = track(content)?
            && chosen.as_ref().is_none_or(|c| found.score() > c.score())
        {
            chosen = Some(found);
        }
    }
    Ok(chosen)
}

impl TrackEntry {
    fn score(&self) -> (bool, bool, u64) {
        (self.enabled, self.default, self.size[0].saturating_mul(self.size[1]))
    }
}

/// An element `TrackEntry`, if it is of a film.
fn track(content: &[u8]) -> Result<Option<TrackEntry>, Refused> {
    let mut found = TrackEntry {
        number: None,
        enabled: true,
        default: true,
        size: [0; 2],
        configuration: damaged("the track does not say how it is coded"),
        prefix: Ok(Vec::new()),
        pixel_aspect: None,
        colour: Colour::default(),
    };
    let (mut kind, mut codec, mut private) = (0, String::new(), None);
    let mut problem = None;
    for (id, value) in elements(content)? {
        match id {
            0xD7 => found.number = Some(number(value)?),
            0x83 => kind = number(value)?,
            0xB9 => found.enabled = number(value)? != 0,
            0x88 => found.default = number(value)? != 0,
            0x86 => codec = String::from_utf8_lossy(value).trim_end_matches('\0').to_owned(),
            0x63A2 => private = Some(value),
            0x23_314F if float(value)? != 1.0 => problem = Some("a track with its own scale of time"),
            0x6D80 => found.prefix = encodings(value)?,
            0xE0 => problem = problem.or(video(value, &mut found)?),
            _ => {}
        }
    }
    found.configuration = match (codec.as_str(), private) {
        _ if problem.is_some() => not_handled(problem.unwrap_or_default()),
        ("V_MPEG4/ISO/AVC", Some(private)) => avc(private),
        ("V_MPEGH/ISO/HEVC", Some(private)) => hevc(private),
        _ => not_handled(format!("the codec {codec}")),
    };
    Ok(Some(found).filter(|_| kind == 1))
}

/// An element `Video`; returns what is not handled.
fn video(content: &[u8], found: &mut TrackEntry) -> Result<Option<&'static str>, Refused> {
    let (mut shown, mut unit) = ([None; 2], 0);
    let mut problem = None;
    for (id, value) in elements(content)? {
        match id {
            0xB0 => found.size[0] = number(value)?,
            0xBA => found.size[1] = number(value)?,
            0x54B0 => shown[0] = Some(number(value)?),
            0x54BA => shown[1] = Some(number(value)?),
            0x54B2 => unit = number(value)?,
            0x9A if number(value)? == 1 => problem = Some("interlaced frames"),
            0x54AA | 0x54BB | 0x54CC | 0x54DD if number(value)? != 0 => {
                problem = Some("frames that the container crops")
            }
            0x55B0 => found.colour = colour(value)?,
            0x7670 => {
                for (id, value) in elements(value)? {
                    if id == 0x7675 && float(value)? != 0.0 {
                        problem = Some("a film that the container turns");
                    }
                }
            }
            _ => {}
        }
    }
    let [width, height] = found.size;
    if let [Some(shown_width), Some(shown_height)] = shown
        && (unit == 0 || unit == 3)
    {
        found.pixel_aspect = reduced(
            u128::from(height) * u128::from(shown_width),
            u128::from(width) * u128::from(shown_height),
        );
    }
    Ok(problem)
}

/// A ratio by its smallest numbers.
fn reduced(a: u128, b: u128) -> Option<[u32; 2]> {
    let mut divisor = [a, b];
    while divisor[1] > 0 {
        divisor = [divisor[1], divisor[0] % divisor[1]];
    }
    let ratio = [a.checked_div(divisor[0])?, b.checked_div(divisor[0])?];
    Some([ratio[0].try_into().ok()?, ratio[1].try_into().ok()?]).filter(|r: &[u32; 2]| r[0] > 0 && r[1] > 0)
}

fn colour(content: &[u8]) -> Result<Colour, Refused> {
    let mut colour = Colour::default();
    for (id, value) in elements(content)? {
        match id {
            0x55B1 => colour.matrix = Some(number(value)?.min(255) as u32),
            0x55BA => colour.transfer = Some(number(value)?.min(255) as u32),
            0x55B9 => {
                colour.full_range = match number(value)? {
                    1 => Some(false),
                    2 => Some(true),
                    _ => None,
                }
            }
            _ => {}
        }
    }
    Ok(colour)
}

/// `ContentEncodings`: the bytes that were taken away before every frame.
fn encodings(content: &[u8]) -> Result<Result<Vec<u8>, Refused>, Refused> {
    let mut prefix = Vec::new();
    for (_, encoding) in elements(content)?.into_iter().filter(|(id, _)| *id == 0x6240) {
        let mut scope = 1;
        let mut algorithm = None;
        let mut settings = Vec::new();
        for (id, value) in elements(encoding)? {
            match id {
                0x5032 => scope = number(value)?,
                0x5033 if number(value)? != 0 => return Ok(not_handled("encrypted frames")),
                0x5034 => {
                    algorithm = Some(0);
                    for (id, value) in elements(value)? {
                        match id {
                            0x4254 => algorithm = Some(number(value)?),
                            0x4255 => settings = value.to_vec(),
                            _ => {}
                        }
                    }
                }
                _ => {}
            }
        }
        if algorithm != Some(3) || scope != 1 || !prefix.is_empty() || settings.len() > 64 {
            return Ok(not_handled("compressed frames"));
        }
        prefix = settings;
    }
    Ok(Ok(prefix))
}
