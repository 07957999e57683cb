//! What a mask file holds: its colours, how many pixels each has, and whether they have an inside.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};

use crate::io::codec::{Pixels, Samples};

/// Most colours of a file that are kept; of more those that cover most.
const KEPT: usize = 256;
/// No more colours than this are distinguished.
const TOLD_APART: usize = 1 << 16;
/// Channels that differ by more `[of 255]` are a colour, and no grey that compression has tinted.
const VIVID: u8 = 48;
/// Darker colours `[of 255]` show no hue.
const DARK: u8 = 64;
/// Marks a grey of 16 bits among the keys, which are colours of 8 bits otherwise: 0xRRGGBB.
const DEEP: u32 = 1 << 24;

/// What of an image is the mask.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Plane {
    /// Its colours, whatever its transparency.
    Colour,
    /// Its colours, black where it is transparent.
    OverBlack,
    /// Its opacity.
    Alpha,
}

impl Plane {
    const ALL: [Self; 3] = [Self::Colour, Self::OverBlack, Self::Alpha];
}

/// Colour and opacity of every pixel.
pub(super) struct Parts {
    width: usize,
    colours: Vec<u32>,
    /// 0 to 255, where the file has any.
    pub alpha: Option<Vec<u8>>,
}

/// Colour and opacity of `image`.
pub(super) fn parts(image: &Pixels) -> Parts {
    let grey = |v: u8| u32::from(v) * 0x01_0101;
    let deep = |v: u16| DEEP | u32::from(v);
    let packed = |p: &[u8]| u32::from_be_bytes([0, p[0], p[1], p[2]]);
    // Grey in three channels of 16 bits keeps its bits; colours need eight.
    let wide = |p: &[u16]| match p[0] == p[1] && p[1] == p[2] {
        true => deep(p[0]),
        false => u32::from_be_bytes([0, (p[0] >> 8) as u8, (p[1] >> 8) as u8, (p[2] >> 8) as u8]),
    };
    let high = |v: u16| (v >> 8) as u8;
    let n = image.channels;
    let (colours, alpha): (_, Option<Vec<u8>>) = match &image.samples {
        Samples::Bytes(data) => {
            let pixels = data.chunks_exact(n);
            let alpha = image.has_alpha().then(|| pixels.clone().map(|p| p[n - 1]).collect());
            (if n < 3 { pixels.map(|p| grey(p[0])).collect() } else { pixels.map(packed).collect() }, alpha)
        }
        Samples::Words(data) => {
            let pixels = data.chunks_exact(n);
            let alpha = image.has_alpha().then(|| pixels.clone().map(|p| high(p[n - 1])).collect());
            (if n < 3 { pixels.map(|p| deep(p[0])).collect() } else { pixels.map(wide).collect() }, alpha)
        }
    };
    Parts { width: image.width, colours, alpha }
}

impl Parts {
    /// The key of every pixel in `plane`: 0xRRGGBB, or a grey of 16 bits.
    pub fn keys(&self, plane: Plane) -> Cow<'_, [u32]> {
        let (colours, Some(alpha)) = (&self.colours, &self.alpha) else {
            return match plane {
                Plane::Colour | Plane::OverBlack => Cow::Borrowed(&self.colours),
                Plane::Alpha => Cow::Owned(vec![0xFF_FFFF; self.colours.len()]),
            };
        };
        match plane {
            Plane::Colour => Cow::Borrowed(colours),
            Plane::OverBlack => {
                colours.iter().zip(alpha).map(|(key, a)| if *a < 128 { 0 } else { *key }).collect()
            }
            Plane::Alpha => alpha.iter().map(|a| u32::from(*a) * 0x01_0101).collect(),
        }
    }
}

/// The value of a grey key, and the largest there can be; `None` of a colour.
pub(super) fn grey_of(key: u32) -> Option<(u32, u32)> {
    if key & DEEP != 0 {
        return Some((key & 0xFFFF, 65_535));
    }
    let [_, r, g, b] = key.to_be_bytes();
    (r == g && g == b).then_some((u32::from(r), 255))
}

/// Whether a key is black.
pub(super) fn is_black(key: u32) -> bool {
    grey_of(key).is_some_and(|(value, _)| value == 0)
}

/// Red, green and blue of a key, 0 to 255.
pub(super) fn colour_of(key: u32) -> [u8; 3] {
    match grey_of(key) {
        Some((value, full)) => [(value * 255 / full) as u8; 3],
        None => {
            let [_, r, g, b] = key.to_be_bytes();
            [r, g, b]
        }
    }
}

/// Luminance of a key in [0, 1].
pub(super) fn luminance(key: u32) -> f32 {
    if let Some((value, full)) = grey_of(key) {
        return value as f32 / full as f32;
    }
    let [r, g, b] = colour_of(key).map(|v| f32::from(v) / 255.0);
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Pixels of one colour.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Count {
    pub pixels: usize,
    /// Those whose four neighbours have the same colour.
    pub inner: usize,
    /// Files in which it is.
    pub files: usize,
    /// Those of them in which there is black, too.
    pub beside_black: usize,
}

/// The colours of a file, or of several.
#[derive(Debug, Clone, Default)]
pub(crate) struct Colours {
    pub(super) keys: BTreeMap<u32, Count>,
    /// Whether some colours were left out.
    pub(super) more: bool,
    pub(super) pixels: usize,
    /// Pixels that are coloured.
    pub(super) vivid: usize,
    /// Least and largest channels over the largest one, of the pixels that are not dark: one hue if they agree.
    pub(super) hue: Option<[[f32; 2]; 3]>,
    /// Largest channel of any pixel.
    pub(super) top: u8,
}

impl Colours {
    fn of(keys: &[u32], width: usize) -> Self {
        let mut out = Self { pixels: keys.len(), ..Self::default() };
        let mut counts: HashMap<u32, Count> = HashMap::new();
        // Runs of one colour are counted at once.
        let mut start = 0;
        for end in 1..=keys.len() {
            if end < keys.len() && keys[end] == keys[start] {
                continue;
            }
            let (key, length) = (keys[start], end - start);
            start = end;
            let room = counts.len() < TOLD_APART;
            match counts.get_mut(&key) {
                Some(count) => count.pixels += length,
                None if room => {
                    counts.insert(key, Count { pixels: length, files: 1, ..Count::default() });
                }
                None => out.more = true,
            }
            let colour = colour_of(key);
            let (low, high) = (colour.into_iter().min().unwrap_or(0), colour.into_iter().max().unwrap_or(0));
            out.top = out.top.max(high);
            if high - low > VIVID {
                out.vivid += length;
            }
            if high >= DARK {
                let part = colour.map(|v| f32::from(v) / f32::from(high));
                let hue = out.hue.get_or_insert(part.map(|v| [v, v]));
                hue.iter_mut().zip(part).for_each(|(h, v)| *h = [h[0].min(v), h[1].max(v)]);
            }
        }
        count_inner(keys, width, &mut counts);
        if counts.keys().any(|key| is_black(*key)) {
            counts.values_mut().for_each(|count| count.beside_black = 1);
        }
        let mut all: Vec<(u32, Count)> = counts.into_iter().collect();
        all.sort_by_key(|(key, count)| (std::cmp::Reverse(count.pixels), *key));
        out.more |= all.len() > KEPT;
        out.keys = all.into_iter().take(KEPT).collect();
        out
    }

    /// Adds another file's.
    fn add(&mut self, other: &Self) {
        for (key, count) in &other.keys {
            let own = self.keys.entry(*key).or_default();
            own.pixels += count.pixels;
            own.inner += count.inner;
            own.files += count.files;
            own.beside_black += count.beside_black;
        }
        self.more |= other.more;
        self.pixels += other.pixels;
        self.vivid += other.vivid;
        self.top = self.top.max(other.top);
        self.hue = match (self.hue, other.hue) {
            (Some(mut own), Some(hue)) => {
                own.iter_mut().zip(hue).for_each(|(a, b)| *a = [a[0].min(b[0]), a[1].max(b[1])]);
                Some(own)
            }
            (own, hue) => own.or(hue),
        };
    }
}

/// Counts the pixels whose neighbours above, below, left and right have their colour, or are outside of the image.
fn count_inner(keys: &[u32], width: usize, counts: &mut HashMap<u32, Count>) {
    let height = keys.len() / width.max(1);
    // Of the present run of one colour; a map is looked into once for each.
    let (mut present, mut inner) = (keys.first().copied().unwrap_or(0), 0);
    let mut add = |key: u32, inner: usize| {
        if inner > 0
            && let Some(count) = counts.get_mut(&key)
        {
            count.inner += inner;
        }
    };
    for y in 0..height {
        for x in 0..width {
            let i = y * width + x;
            if keys[i] != present {
                add(present, inner);
                (present, inner) = (keys[i], 0);
            }
            let same = |k: usize| keys[k] == present;
            let surrounded = (x == 0 || same(i - 1))
                && (x + 1 == width || same(i + 1))
                && (y == 0 || same(i - width))
                && (y + 1 == height || same(i + width));
            inner += usize::from(surrounded);
        }
    }
    add(present, inner);
}

/// What a mask file holds, before anybody knows what it means; or what several hold together.
#[derive(Debug, Clone)]
pub(crate) struct Look {
    planes: [Colours; 3],
    /// Whether some pixels are more transparent than others.
    pub(super) alpha_varies: bool,
    pub(super) lossy: bool,
    pub(super) files: usize,
    /// Colour of every index, of a file with a palette.
    pub(super) palette: Option<Vec<[u8; 3]>>,
}

impl Look {
    pub(super) fn of(parts: &Parts, palette: Option<Vec<[u8; 3]>>, lossy: bool) -> Self {
        let colour = Colours::of(&parts.keys(Plane::Colour), parts.width);
        let of = |plane| Colours::of(&parts.keys(plane), parts.width);
        let alpha_varies = parts.alpha.as_ref().is_some_and(|alpha| alpha.iter().any(|a| *a != alpha[0]));
        let white = || {
            let pixels = parts.colours.len();
            let keys =
                BTreeMap::from([(0xFF_FFFF, Count { pixels, inner: pixels, files: 1, ..Count::default() })]);
            Colours { keys, pixels, top: 255, ..Colours::default() }
        };
        let [over_black, alpha] = match parts.alpha {
            Some(_) => [of(Plane::OverBlack), of(Plane::Alpha)],
            None => [colour.clone(), white()],
        };
        Self { planes: [colour, over_black, alpha], alpha_varies, lossy, files: 1, palette }
    }

    /// What all of `looks` hold; a palette only if they share it.
    pub(super) fn together<'a>(looks: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut looks = looks.into_iter();
        let mut out = looks.next().expect("there is a mask").clone();
        for look in looks {
            out.planes.iter_mut().zip(&look.planes).for_each(|(own, other)| own.add(other));
            out.alpha_varies |= look.alpha_varies;
            out.lossy |= look.lossy;
            out.files += 1;
            if out.palette != look.palette {
                out.palette = None;
            }
        }
        out
    }

    /// The colours of a plane.
    pub(super) fn plane(&self, plane: Plane) -> &Colours {
        let k = Plane::ALL.iter().position(|p| *p == plane).expect("all are there");
        &self.planes[k]
    }
}
