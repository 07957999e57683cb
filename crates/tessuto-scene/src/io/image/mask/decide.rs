//! What the values of a clip's masks mean.
//!
//! Labels have insides, soft edges have none: a value whose pixels mostly have neighbours of the same value is an
//! area, and an area between black and the brightest one is an object of its own. What was compressed with losses
//! has no labels.

use super::choice::Object;
use super::look::{Colours, Count, Look, Plane, colour_of, grey_of, is_black, luminance};
use super::objects::{Candidate, chosen};
use tessuto_core::error::{Error, Hint, Remedy, Result};

/// Most colours that labels have.
const LABELS: usize = 64;
/// Colours of so few kinds, black among them, are objects however small these are.
const CERTAIN: usize = 16;
/// Grey values up to this one are labels, and no shades: nothing is that dark on purpose.
const SMALL: u32 = 16;
/// Fraction of its pixels that an area has inside, and of all pixels that it has at least.
const AREA: (f64, f64) = (0.5, 5e-4);
/// Values nearer to black or to the brightest one, as a fraction of that, are noise of it.
const NOISE: f64 = 0.06;
/// Fraction of coloured pixels up to which greys are tinted.
const TINTED: f64 = 0.01;
/// Channels over the largest differ by no more within one hue: exact, and compressed with losses.
const ONE_HUE: [f32; 2] = [0.12, 0.35];
/// Fraction of all pixels that areas must explain for a mask of many colours to be one.
const EXPLAINED: f64 = 0.9;
/// Opaque black that makes colours, and not transparency, the mask, as a fraction of all pixels.
const BLACK: f64 = 0.05;
/// Two values whose brighter one is above this [of white] need no note.
const NEARLY_WHITE: f32 = 0.95;

/// How to read all masks of a clip.
#[derive(Debug, Clone)]
pub(crate) struct Reading {
    pub(super) plane: Plane,
    how: How,
    /// What is fabric, where it is an object.
    pub fabric: Option<String>,
    /// What a user should know.
    pub notes: Vec<String>,
}

#[derive(Debug, Clone, PartialEq)]
enum How {
    Luminance,
    /// This colour is fabric, no other.
    Only(u32),
    /// The nearest of these colours counts; fabric is the first.
    Nearest(Vec<u32>),
    /// The largest channel over this one [of white].
    Over(f32),
}

impl Reading {
    fn new(plane: Plane, how: How) -> Self {
        Self { plane, how, fabric: None, notes: Vec::new() }
    }

    /// As masks are without further ado.
    pub fn luminance() -> Self {
        Self::new(Plane::Colour, How::Luminance)
    }

    /// Whether values are the luminance of the colours.
    pub fn is_luminance(&self) -> bool {
        self.plane == Plane::Colour && self.how == How::Luminance
    }

    /// The mask's value where the file has `key`, in [0, 1].
    pub(super) fn value(&self, key: u32) -> f32 {
        match &self.how {
            How::Luminance => luminance(key),
            How::Only(fabric) => f32::from(u8::from(key == *fabric)),
            How::Nearest(colours) => {
                let distance = |other: &u32| -> i32 {
                    let pairs = colour_of(key).into_iter().zip(colour_of(*other));
                    pairs.map(|(a, b)| (i32::from(a) - i32::from(b)).pow(2)).sum()
                };
                let nearest = colours.iter().min_by_key(|other| distance(other));
                f32::from(u8::from(nearest == colours.first()))
            }
            How::Over(most) => (brightness(key) / most).min(1.0),
        }
    }
}

/// Largest channel in [0, 1].
fn brightness(key: u32) -> f32 {
    match grey_of(key) {
        Some((value, full)) => value as f32 / full as f32,
        None => f32::from(colour_of(key).into_iter().max().unwrap_or(0)) / 255.0,
    }
}

/// How to read the masks that `looks` were taken of, which messages call `place`; `object` is the one that was
/// asked for.
///
/// # Errors
/// [`Error::Input`] with the list of objects, where there are several and none was chosen; of what is no mask.
pub(crate) fn understand<'a>(
    place: &str,
    looks: impl IntoIterator<Item = &'a Look>,
    object: Option<&Object>,
) -> Result<Reading> {
    let look = Look::together(looks);
    let (plane, note) = plane(&look);
    let mut reading = Reading::new(plane, How::Luminance);
    reading.notes.extend(note.map(str::to_owned));
    let colours = look.plane(plane);
    if plane == Plane::Alpha {
        // Opacity is no label.
        if colours.top > 0 && colours.top < 128 {
            reading.how = How::Over(f32::from(colours.top) / 255.0);
        }
        if let Some(object) = object {
            return Err(no_objects(place, object));
        }
        return Ok(reading);
    }
    let decision = Decision { place, look: &look, colours, object };
    let (how, note) = decision.decide()?;
    reading.fabric = match &how {
        How::Only(key) => Some(decision.name(*key)),
        How::Nearest(keys) => keys.first().map(|key| decision.name(*key)),
        How::Luminance | How::Over(_) => None,
    };
    reading.how = how;
    reading.notes.extend(note);
    Ok(reading)
}

fn no_objects(place: &str, object: &Object) -> Error {
    let problem = format!("has no labels, so there is no object {object}");
    Error::input(place, problem, "leave the choice of an object out")
}

/// What of the files is the mask, and a note on it.
fn plane(look: &Look) -> (Plane, Option<&'static str>) {
    if !look.alpha_varies {
        return (Plane::Colour, None);
    }
    let (over, alpha) = (look.plane(Plane::OverBlack), look.plane(Plane::Alpha));
    let colours = over.keys.keys().filter(|key| !is_black(**key)).count();
    let count = |found: &dyn Fn(u32) -> bool, colours: &Colours| -> usize {
        colours.keys.iter().filter(|(key, _)| found(**key)).map(|(_, count)| count.pixels).sum()
    };
    let transparent = count(&|key| brightness(key) < 0.5, alpha);
    let black = count(&is_black, over).saturating_sub(transparent) as f64;
    let black_around = black > BLACK * over.pixels as f64;
    let few = colours <= LABELS && !over.more;
    let all_grey = over.keys.keys().all(|key| grey_of(*key).is_some());
    match colours {
        0 | 1 if colours == 0 || !black_around => {
            (Plane::Alpha, Some("the transparency (alpha) is the mask, as the colour is one"))
        }
        _ if few || (all_grey && black_around) => {
            (Plane::OverBlack, Some("what is transparent counts as black"))
        }
        _ => (Plane::Alpha, Some("cut-outs: the transparency (alpha) is taken as the mask")),
    }
}

struct Decision<'a> {
    place: &'a str,
    look: &'a Look,
    colours: &'a Colours,
    object: Option<&'a Object>,
}

type Decided = Result<(How, Option<String>)>;

impl Decision<'_> {
    fn decide(&self) -> Decided {
        let keys: Vec<u32> = self.colours.keys.keys().copied().collect();
        if keys.len() <= 2 && !self.colours.more {
            return self.two(&keys);
        }
        if keys.iter().all(|key| grey_of(*key).is_some()) {
            return self.grey();
        }
        let few = keys.len() <= LABELS && !self.colours.more && !self.look.lossy;
        if few { self.few_colours(&keys) } else { self.many_colours() }
    }

    /// Masks of one or two values.
    fn two(&self, keys: &[u32]) -> Decided {
        let mut keys = keys.to_vec();
        keys.sort_by(|a, b| luminance(*a).total_cmp(&luminance(*b)));
        let raw = |key: u32| grey_of(key).map(|(value, _)| value);
        let ([dark, light] | [dark, light, ..]) = keys[..] else {
            // Frames without anything, or full ones.
            let only = keys.first().copied().unwrap_or(0);
            if raw(only) == Some(1) {
                return Ok((How::Only(only), Some(ZEROS_AND_ONES.to_owned())));
            }
            return self.plain(keys.into_iter().filter(|key| !is_black(*key)));
        };
        let black = is_black(dark);
        let small = raw(light).is_some_and(|v| v <= SMALL);
        let shades = raw(dark).is_some() && raw(light).is_some() && !small;
        // Colour maps of plots paint the background in a dark colour.
        let surely = black || shades || (luminance(dark) < 0.25 && luminance(light) >= 0.5);
        if !surely {
            let key = self.choose(&[dark, light])?;
            return Ok((How::Only(key), self.note(key)));
        }
        if black && luminance(light) == 1.0 {
            return self.plain([light]);
        }
        if self.object.is_some() {
            let key = self.choose(&[light])?;
            return Ok((How::Only(key), self.note(key)));
        }
        let note = match (raw(dark), raw(light)) {
            (Some(0), Some(1)) => Some(ZEROS_AND_ONES.to_owned()),
            _ if black && luminance(light) > NEARLY_WHITE => None,
            _ => Some(format!(
                "the mask holds two values, {} and {}; taken as black and white",
                shown(dark),
                shown(light)
            )),
        };
        Ok((How::Only(light), note))
    }

    /// Greys: labels, or soft edges.
    fn grey(&self) -> Decided {
        let value = |key: u32| grey_of(key).expect("all are grey").0;
        let Colours { keys, more, .. } = self.colours;
        let top = keys.keys().copied().max_by(|a, b| luminance(*a).total_cmp(&luminance(*b))).expect("some");
        // A file of 16 bits may hold what 8 would.
        let full = if value(top) <= 255 { 255 } else { grey_of(top).expect("grey").1 };
        let between = |key: u32| {
            let part = f64::from(value(key)) / f64::from(value(top));
            // Greys in a file without any black are a filmed image, or a mask that is all grey.
            (NOISE..=1.0 - NOISE).contains(&part) && keys[&key].beside_black > 0
        };
        let areas: Vec<u32> =
            keys.iter().filter(|(k, c)| !is_black(**k) && self.is_area(c)).map(|(k, _)| *k).collect();
        let small = value(top) <= SMALL;
        let labels =
            !self.look.lossy && (small || keys.len() <= LABELS && !more && areas.iter().any(|k| between(*k)));
        if labels || self.object.is_some() {
            let all: Vec<u32> = keys.keys().copied().filter(|key| !is_black(*key)).collect();
            let key = self.choose(if small || areas.is_empty() { &all } else { &areas })?;
            let how = if labels { How::Only(key) } else { self.nearest(key, &areas) };
            return Ok((how, self.note(key)));
        }
        let deep = grey_of(top).is_some_and(|(_, most)| most > full);
        if deep {
            let note = "the masks have 16 bits, but values up to 255; taken as 8 bits";
            return Ok((How::Over(255.0 / 65_535.0), Some(note.to_owned())));
        }
        if luminance(top) < 0.5 && areas.contains(&top) {
            let note = format!("the mask's brightest value, {}, is taken as white", shown(top));
            return Ok((How::Over(luminance(top)), Some(note)));
        }
        Ok((How::Luminance, None))
    }

    /// Colours that can be counted, without losses.
    fn few_colours(&self, keys: &[u32]) -> Decided {
        let black = keys.iter().any(|key| is_black(*key));
        let areas: Vec<u32> =
            keys.iter().filter(|k| !is_black(**k) && self.is_area(&self.colours.keys[*k])).copied().collect();
        if self.one_hue() && areas.len() <= 1 && black && self.object.is_none() {
            return Ok(self.over_top());
        }
        let certain = black && (keys.len() <= CERTAIN || self.look.palette.is_some());
        let objects: Vec<u32> = match certain {
            true => keys.iter().copied().filter(|key| !is_black(*key)).collect(),
            false => areas,
        };
        if objects.is_empty() {
            return self.plain([]);
        }
        let key = self.choose(&objects)?;
        let how = if certain { How::Only(key) } else { self.nearest(key, &objects) };
        Ok((how, self.note(key)))
    }

    /// Colours with soft edges, or with losses; or no mask at all.
    fn many_colours(&self) -> Decided {
        let Colours { keys, pixels, vivid, .. } = self.colours;
        let tinted = (*vivid as f64) < TINTED * *pixels as f64;
        if tinted && self.object.is_none() {
            return Ok((How::Luminance, None));
        }
        if self.one_hue() && self.object.is_none() {
            return Ok(self.over_top());
        }
        let areas: Vec<(u32, Count)> =
            keys.iter().filter(|(_, c)| self.is_area(c)).map(|(k, c)| (*k, *c)).collect();
        let explained: usize = areas.iter().map(|(_, count)| count.pixels).sum();
        if !self.look.lossy && explained as f64 >= EXPLAINED * *pixels as f64 {
            let objects: Vec<u32> = areas.iter().map(|(k, _)| *k).filter(|k| !is_black(*k)).collect();
            let key = self.choose(&objects)?;
            return Ok((self.nearest(key, &objects), self.note(key)));
        }
        let what = match self.look.lossy {
            true => "holds colours that compression has spoilt, and no mask",
            false => "holds the colours of a filmed image, and no mask",
        };
        let hint = "write masks as PNG, white where the fabric is and black elsewhere, or one colour for each object";
        Err(Error::input(self.place, what, Hint::from(hint).with(Remedy::Masks)))
    }

    /// As the file has it, which leaves nothing to choose but the white of `objects`.
    fn plain(&self, objects: impl IntoIterator<Item = u32>) -> Decided {
        let Some(object) = self.object else { return Ok((How::Luminance, None)) };
        let objects: Vec<u32> = objects.into_iter().collect();
        if objects.is_empty() {
            return Err(no_objects(self.place, object));
        }
        let key = self.choose(&objects)?;
        Ok((How::Only(key), None))
    }

    fn is_area(&self, count: &Count) -> bool {
        let least = AREA.1 * self.colours.pixels as f64 / self.look.files as f64;
        count.inner as f64 >= AREA.0 * count.pixels as f64 && count.pixels as f64 >= least
    }

    fn one_hue(&self) -> bool {
        let most = ONE_HUE[usize::from(self.look.lossy)];
        self.colours.hue.is_some_and(|hue| hue.iter().all(|[low, high]| high - low <= most))
    }

    /// One colour with soft edges.
    fn over_top(&self) -> (How, Option<String>) {
        let top = self.colours.top;
        let note = format!("the masks have one colour; its brightest ({top} of 255) is taken as white");
        (How::Over(f32::from(top) / 255.0), Some(note))
    }

    fn nearest(&self, key: u32, objects: &[u32]) -> How {
        let others = objects.iter().copied().filter(|other| *other != key);
        How::Nearest(std::iter::once(key).chain([0]).chain(others).collect())
    }

    fn candidates(&self, keys: &[u32]) -> Vec<Candidate> {
        let label = |key: u32| {
            let colour = colour_of(key);
            let index = self.look.palette.as_ref().and_then(|p| p.iter().position(|c| *c == colour));
            index.map(|k| k as u32).or(grey_of(key).map(|(value, _)| value))
        };
        let of = |key: &u32| {
            let Count { pixels, files, .. } = self.colours.keys[key];
            let of_files = self.colours.pixels as f64 * files as f64 / self.look.files as f64;
            Candidate {
                key: *key,
                label: label(*key),
                colour: colour_of(*key),
                share: pixels as f64 / of_files,
                files,
            }
        };
        keys.iter().map(of).collect()
    }

    fn choose(&self, keys: &[u32]) -> Result<u32> {
        chosen(self.place, self.candidates(keys), self.look.files, self.object)
    }

    fn note(&self, key: u32) -> Option<String> {
        Some(format!("the fabric is {}", self.name(key)))
    }

    fn name(&self, key: u32) -> String {
        self.candidates(&[key])[0].named()
    }
}

/// What masks of label 1 are called.
const ZEROS_AND_ONES: &str = "the mask holds 0 and 1; taken as black and white";

fn shown(key: u32) -> String {
    match grey_of(key) {
        Some((value, _)) => value.to_string(),
        None => {
            let [r, g, b] = colour_of(key);
            format!("{r},{g},{b}")
        }
    }
}
