//! Values of options that are more than a number.

use tessuto::Back;
use tessuto::template::remesh::Resolution;
use tessuto::view::View;

/// A point [px] or a size.
pub type Pair = [f64; 2];

/// `WxH` with an optional unit; metres.
pub fn lengths(text: &str) -> Result<Pair, String> {
    let hint = "write width x height and the unit, such as 0.7x0.5m, 70x50cm or 700x500mm";
    let units = [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("", 1.0)];
    let (number, scale) = units.iter().find_map(|(u, s)| Some((text.strip_suffix(u)?, *s))).ok_or(hint)?;
    let (w, h) = number.split_once('x').ok_or(hint)?;
    let side =
        |text: &str| text.trim().parse::<f64>().ok().map(|v| v * scale).filter(|v| *v > 0.0 && *v < 1e3);
    Ok([side(w).ok_or(hint)?, side(h).ok_or(hint)?])
}

/// A length with an optional unit; metres.
pub fn length(text: &str) -> Result<f64, String> {
    let hint = "write a length and its unit, such as 20mm, 62cm or 0.62m";
    let units = [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("", 1.0)];
    let (number, scale) = units.iter().find_map(|(u, s)| Some((text.strip_suffix(u)?, *s))).ok_or(hint)?;
    let length = number.trim().parse::<f64>().ok().map(|v| v * scale).filter(|v| *v > 0.0 && *v < 1e3);
    length.ok_or_else(|| hint.to_owned())
}

/// Sizes of paper that have names [m].
const PAPERS: [(&str, Pair); 6] = [
    ("a3", [0.297, 0.42]),
    ("a4", [0.21, 0.297]),
    ("a5", [0.148, 0.21]),
    ("letter", [0.2159, 0.2794]),
    ("legal", [0.2159, 0.3556]),
    ("tabloid", [0.2794, 0.4318]),
];

/// The name of a size of paper, or `WxH` with an optional unit; metres.
pub fn paper(text: &str) -> Result<Pair, String> {
    let name = text.to_lowercase();
    let known = PAPERS.iter().find(|(known, _)| *known == name).map(|(_, size)| *size);
    let hint = "write A3, A4, A5, letter, legal, tabloid, or width x height and the unit, such as 210x297mm";
    known.map_or_else(|| lengths(text).map_err(|_| hint.to_owned()), Ok)
}

/// `N` numbers between commas.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let found: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    <[f64; N]>::try_from(found?).ok().filter(|found| found.iter().all(|v| v.is_finite()))
}

/// A point and a normal.
pub fn plane(text: &str) -> Result<[f64; 6], String> {
    let hint = "write a point and a normal, such as 0,0.1,0.9,0,-0.7,-0.7";
    numbers(text).ok_or_else(|| hint.to_owned())
}

/// How a table is tilted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tilt {
    /// Gravity is perpendicular to it.
    Level,
    /// The camera looks along its normal.
    Facing,
    /// Its normal.
    Normal([f64; 3]),
}

/// `level`, `facing` or `X,Y,Z`.
pub fn tilt(text: &str) -> Result<Tilt, String> {
    match text {
        "level" => Ok(Tilt::Level),
        "facing" => Ok(Tilt::Facing),
        _ => {
            numbers(text).map(Tilt::Normal).ok_or_else(|| "write level, facing, or a normal X,Y,Z".to_owned())
        }
    }
}

/// Two points `X,Y X,Y`.
pub fn two_points(text: &str) -> Result<[Pair; 2], String> {
    let points: Vec<Pair> = text.split_whitespace().map(point).collect::<Result<_, _>>()?;
    let count = points.len();
    points.try_into().map_err(|_| format!("{count} points; write two, such as 312,208 930,215"))
}

/// `#rrggbb`; sRGB in [0, 1].
pub fn colour(text: &str) -> Result<[f32; 3], String> {
    match tessuto::io::scene::back::parse(text, "") {
        Ok(Back::Plain(Some(colour))) => Ok(colour),
        _ => Err("write a colour as #rrggbb, such as #7a1f3d".to_owned()),
    }
}

/// A number above 0.
pub fn positive(text: &str) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok().filter(|v| *v > 0.0 && v.is_finite());
    number.ok_or_else(|| "give a number above 0, with a decimal point".to_owned())
}

/// Weight per area with its unit; kg/m².
pub fn weight(text: &str) -> Result<f64, String> {
    let hint = "write the weight and its unit, such as 142g/m2 or 0.142kg/m2, from 5 g/m² to 5 kg/m²";
    let plain = text.replace('²', "2").replace(' ', "");
    let units = [("kg/m2", 1.0), ("g/m2", 1e-3), ("gsm", 1e-3)];
    let (number, scale) = units.iter().find_map(|(u, s)| Some((plain.strip_suffix(u)?, *s))).ok_or(hint)?;
    let weight = number.parse::<f64>().map_err(|_| hint)? * scale;
    if (5e-3..=5.0).contains(&weight) { Ok(weight) } else { Err(hint.to_owned()) }
}

/// A part of a whole, from 0 to below 1.
pub fn part(text: &str) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok().filter(|v| (0.0..1.0).contains(v));
    number.ok_or_else(|| "give a number from 0 to below 1, such as 1e-4".to_owned())
}

/// `X,Y` in pixels.
pub fn point(text: &str) -> Result<Pair, String> {
    let parsed = text.split_once(',').and_then(|(x, y)| Some([x.parse().ok()?, y.parse().ok()?]));
    parsed
        .filter(|p: &Pair| p.iter().all(|v| v.is_finite()))
        .ok_or_else(|| "write column,row in pixels, such as 312,208".to_owned())
}

/// Corners of a polygon [px].
#[derive(Debug, Clone, PartialEq)]
pub struct Polygon(pub Vec<Pair>);

/// `X,Y X,Y X,Y …`.
pub fn polygon(text: &str) -> Result<Polygon, String> {
    let corners: Vec<Pair> = text.split_whitespace().map(point).collect::<Result<_, _>>()?;
    match corners.len() {
        0..3 => {
            Err("write three or more corners column,row, such as \"312,208 930,215 941,640 305,622\""
                .to_owned())
        }
        _ => Ok(Polygon(corners)),
    }
}

/// `X,Y X,Y X,Y X,Y`.
pub fn corners(text: &str) -> Result<[Pair; 4], String> {
    let corners: Vec<Pair> = text.split_whitespace().map(point).collect::<Result<_, _>>()?;
    let count = corners.len();
    corners.try_into().map_err(|_| {
        format!("{count} corners; write four, clockwise from the upper left, such as 312,208 930,215 941,640 305,622")
    })
}

/// Places [px] in frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Places(pub Vec<(usize, Pair)>);

/// `FRAME:X,Y FRAME:X,Y …`.
pub fn places(text: &str) -> Result<Places, String> {
    let place = |word: &str| {
        let (frame, at) = word.split_once(':').ok_or("write FRAME:column,row, such as 17:610,230")?;
        Ok::<_, String>((frame.parse().map_err(|_| format!("{frame} is no number of a frame"))?, point(at)?))
    };
    Ok(Places(text.split_whitespace().map(place).collect::<Result<_, _>>()?))
}

/// `N` or `CxR`.
pub fn resolution(text: &str) -> Result<Resolution, String> {
    let hint = "write a number, such as 32, or columns x rows, such as 32x24";
    match text.split_once('x') {
        Some((c, r)) => Ok(Resolution::Grid([c.parse().map_err(|_| hint)?, r.parse().map_err(|_| hint)?])),
        None => Ok(Resolution::Longer(text.parse().map_err(|_| hint)?)),
    }
}

/// `CxR`.
pub fn grid(text: &str) -> Result<[usize; 2], String> {
    let parsed = text.split_once('x').and_then(|(c, r)| Some([c.parse().ok()?, r.parse().ok()?]));
    parsed.ok_or_else(|| "write columns x rows, such as 21x21".to_owned())
}

/// `NAME=NUMBER`.
pub fn named_number(text: &str) -> Result<(String, f64), String> {
    let parsed = text.split_once('=').filter(|(name, _)| !name.is_empty());
    let parsed = parsed.and_then(|(name, number)| Some((name.to_owned(), number.parse::<f64>().ok()?)));
    parsed
        .filter(|(_, number)| number.is_finite())
        .ok_or_else(|| "write a name and a number, such as right=0.01".to_owned())
}

/// `NAME=PATH`.
pub fn named_path(text: &str) -> Result<(String, std::path::PathBuf), String> {
    let parsed = text.split_once('=').filter(|(name, path)| !name.is_empty() && !path.is_empty());
    let parsed = parsed.map(|(name, path)| (name.to_owned(), path.into()));
    parsed.ok_or_else(|| "write a name and a path, such as right=right.mp4".to_owned())
}

/// Letters among x, y, z.
pub fn axes(text: &str) -> Result<[bool; 3], String> {
    let known = !text.is_empty() && text.chars().all(|c| "xyz".contains(c));
    if known {
        Ok(["x", "y", "z"].map(|axis| text.contains(axis)))
    } else {
        Err("name axes, such as y or yz".to_owned())
    }
}

/// `original`, the name of a further camera, `LEFT` or `LEFT,UP`.
pub fn view(text: &str) -> Result<View, String> {
    let hint = "write original, the name of a view, LEFT or LEFT,UP in degrees, such as 45 or -30,20";
    if text == "original" {
        return Ok(View::Original);
    }
    if text.starts_with(char::is_alphabetic) && !text.contains(',') {
        return Ok(View::Camera(text.to_owned()));
    }
    let (left, up) = text.split_once(',').unwrap_or((text, "0"));
    let number = |t: &str| t.trim().parse::<f64>().ok().filter(|a| a.is_finite()).ok_or(hint.to_owned());
    Ok(View::About(number(left)?, number(up)?))
}

/// `WxH` in pixels.
pub fn pixels(text: &str) -> Result<[usize; 2], String> {
    let hint = "write WIDTHxHEIGHT between 16 and 16384, such as 1280x720";
    let (w, h) = text.split_once('x').ok_or(hint)?;
    let side = |t: &str| t.parse().ok().filter(|n| (16..=16384).contains(n)).ok_or(hint.to_owned());
    Ok([side(w)?, side(h)?])
}

/// Seconds, 0 to 1000000.
pub fn seconds(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|s| (0.0..=1e6).contains(s));
    value.ok_or_else(|| "expected seconds, 0 to 1000000".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_have_units() {
        for text in ["142g/m2", "142 g/m²", "0.142kg/m2", "142gsm"] {
            assert!((weight(text).unwrap() / 0.142 - 1.0).abs() < 1e-12, "{text}");
        }
        for bad in ["142", "0.142", "142oz", "g/m2", "-3g/m2", "142kg/m2", "1g/m2", "NaNg/m2"] {
            assert!(weight(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn sizes_have_units() {
        assert_eq!(lengths("0.7x0.5m"), Ok([0.7, 0.5]));
        assert_eq!(lengths("0.7x0.5"), Ok([0.7, 0.5]));
        let [w, h] = lengths("70x50cm").unwrap();
        assert!((w - 0.7).abs() < 1e-12 && (h - 0.5).abs() < 1e-12);
        for bad in ["70", "70x", "ax5", "-1x5m", "0x5m", "70x50in"] {
            assert!(lengths(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn tables_are_read_or_explained() {
        assert_eq!(paper("A4"), Ok([0.21, 0.297]));
        assert_eq!(paper("Letter"), Ok([0.2159, 0.2794]));
        assert_eq!(paper("0.2x0.3m"), Ok([0.2, 0.3]));
        assert!(paper("A9").unwrap_err().contains("tabloid"));
        let mm = length("20mm").unwrap();
        assert!((mm - 0.02).abs() < 1e-15 && length("0.5") == Ok(0.5));
        assert!(length("-2mm").is_err() && length("2in").is_err());
        assert_eq!(plane("0,0.1,0.9, 0,-0.7,-0.7"), Ok([0.0, 0.1, 0.9, 0.0, -0.7, -0.7]));
        assert!(plane("0,0,1").is_err() && plane("0,0,1,0,0,NaN").is_err());
        assert_eq!(tilt("level"), Ok(Tilt::Level));
        assert_eq!(tilt("0,-1,-1"), Ok(Tilt::Normal([0.0, -1.0, -1.0])));
        assert!(tilt("flat").is_err());
        assert_eq!(two_points("1,2 3,4"), Ok([[1.0, 2.0], [3.0, 4.0]]));
        assert!(two_points("1,2").unwrap_err().contains("write two"));
    }

    #[test]
    fn views_sizes_and_grids_are_read_or_explained() {
        assert_eq!(view("original"), Ok(View::Original));
        assert_eq!(view("-30, 20"), Ok(View::About(-30.0, 20.0)));
        assert_eq!(view("left"), Ok(View::Camera("left".to_owned())), "a further camera, where there is one");
        assert!(view("left,20").unwrap_err().contains("degrees"));
        assert_eq!(pixels("1280x720"), Ok([1280, 720]));
        assert!(pixels("1280").is_err() && pixels("0x9").is_err());
        assert_eq!(grid("9x12"), Ok([9, 12]));
        assert!(grid("9").is_err() && grid("ax3").is_err());
    }
}
