//! The card as one page: numbers, pictures, and how to check both with a ruler.

use std::path::Path;

use askama::Template;

use super::combine::{Answer, Clip, NAMES, limit};
use super::laboratory::Tested;
use super::{digits, drawing};
use crate::export::shell::terms;
use crate::run::fabric::{Fabric, bending_length};
use tessuto_core::error::Result;
use tessuto_estimate::io;
use tessuto_estimate::motion::causes::Constraint;
use tessuto_sim::textile::cantilever::SLOPE;

const STYLE: &str = include_str!("../../assets/report/page.css");

/// In the head of every card: a file without it is not replaced.
pub const MARK: &str = "<meta name=\"generator\" content=\"card of a fabric\">";

/// What the page shows.
#[derive(Debug)]
pub struct Card<'a> {
    /// The clips.
    pub clips: &'a [Clip],
    /// What they say together, at the weight of the card.
    pub answer: &'a Answer,
    /// Whether that weight is from a scale; otherwise it is assumed.
    pub weighed: bool,
    /// The simulated tests.
    pub tested: &'a Tested,
    /// Measured fabrics that bend most alike, with the mean difference of ln(D/ρ), and of how many.
    pub alike: &'a [(&'a Fabric, f64)],
    /// Number of fabrics in their table.
    pub among: usize,
}

/// What the template reads; it escapes every text that is not marked safe.
#[derive(Template)]
#[template(path = "card.html")]
struct Page<'a> {
    mark: &'static str,
    style: &'static str,
    title: String,
    clips: Vec<String>,
    several: bool,
    weight: String,
    weighed: bool,
    bent: String,
    key_numbers: Vec<[String; 3]>,
    rows: Vec<Row>,
    agreement: Vec<Agreement>,
    next: String,
    slope: f64,
    overhangs: [[String; 3]; 2],
    lengths: [String; 2],
    drapes: [[String; 2]; 3],
    strips: String,
    disc: String,
    alike: &'a [[String; 4]],
    among: usize,
    programs: Vec<Program>,
    version: &'static str,
}

/// One program's terms.
struct Program {
    name: &'static str,
    /// Name, value, unit and formula.
    terms: Vec<[String; 4]>,
}

/// One stiffness.
struct Row {
    name: String,
    value: String,
    band: String,
    unit: &'static str,
    informed: bool,
    /// What the video says of it.
    said: String,
}

/// What the clips say of one parameter.
struct Agreement {
    name: &'static str,
    /// Value of every clip over the combined one, its factor, and whether it counts.
    clips: Vec<(String, bool)>,
    together: String,
    chi_square: String,
    verdict: String,
    contradicts: bool,
}

/// A value a standard deviation of its logarithm lower and higher.
fn band(value: f64, sd_of_ln: f64) -> String {
    format!("{} to {}", digits(value * (-sd_of_ln).exp()), digits(value * sd_of_ln.exp()))
}

fn rows(answer: &Answer) -> Vec<Row> {
    let w = &answer.per_width;
    let row = |name: &str, value: f64, unit: &'static str, k: usize, power: f64| {
        let constraint = answer.parameters[k].constraint.powered(power);
        let (value, band) = match constraint.bound(value) {
            // One side is open: there is no band.
            Some(_) => (constraint.text(value, digits), String::new()),
            None => (digits(value), band(value, answer.parameters[k].sd_of_ln * power)),
        };
        let said = match constraint {
            Constraint::Constrained => "constrains it".to_owned(),
            Constraint::AtLeast { .. } => "gives a lower bound only".to_owned(),
            Constraint::AtMost { .. } => "gives an upper bound only".to_owned(),
            Constraint::TradedOff { with } => format!("constrains it only together with {}", with.name()),
            Constraint::Unconstrained => "does not constrain it: this is the prior".to_owned(),
        };
        Row { name: name.to_owned(), value, band, unit, informed: answer.is_informed(k), said }
    };
    let length = w.bending.map(|d| 1e3 * bending_length(d, w.area_density));
    vec![
        row("bending stiffness, warp", w.bending[0], "N·m", 1, 1.0),
        row("bending stiffness, weft", w.bending[1], "N·m", 1, 1.0),
        row("bending length, warp", length[0], "mm", 1, 1.0 / 3.0),
        row("bending length, weft", length[1], "mm", 1, 1.0 / 3.0),
        row("membrane stiffness, warp", w.membrane[0], "N/m", 0, 1.0),
        row("membrane stiffness, weft", w.membrane[1], "N/m", 0, 1.0),
        row("shear stiffness", w.shear, "N/m", 2, 1.0),
    ]
}

/// Of bending, membrane and shear.
fn agreement(clips: &[Clip], answer: &Answer) -> Vec<Agreement> {
    let density = answer.per_width.area_density;
    let mean = |w: &tessuto_sim::per_width::PerWidth, k: usize| match k {
        0 => (w.membrane[0] * w.membrane[1]).sqrt(),
        1 => (w.bending[0] * w.bending[1]).sqrt(),
        _ => w.shear,
    };
    let of = |k: usize| {
        let parameter = &answer.parameters[k];
        let of_clip = |(i, clip): (usize, &Clip)| {
            let w = super::combine::scaled(&clip.measured.per_width, density);
            let factor = clip.measured.sd_of_ln[k].exp();
            (format!("{} ×÷ {factor:.2}", digits(mean(&w, k))), parameter.clips.contains(&i))
        };
        let degrees = parameter.clips.len().saturating_sub(1);
        let verdict = match (&parameter.contradiction, parameter.clips.len()) {
            (Some(c), _) => {
                let [a, b] = c.clips.map(|i| &clips[i].name);
                format!(
                    "contradiction: {b} is {:.2} times as stiff as {a}, {:.1} standard deviations",
                    c.factor, c.deviations
                )
            }
            (None, 0) => "no clip constrains it".to_owned(),
            (None, 1) => "one clip constrains it".to_owned(),
            (None, _) => "they agree".to_owned(),
        };
        Agreement {
            name: NAMES[k],
            clips: clips.iter().enumerate().map(of_clip).collect(),
            together: format!("{} ×÷ {:.2}", digits(mean(&answer.per_width, k)), parameter.sd_of_ln.exp()),
            chi_square: match degrees {
                0 => String::new(),
                _ => format!("{:.2} of {:.2}", parameter.chi_square, limit(degrees)),
            },
            verdict,
            contradicts: parameter.contradiction.is_some(),
        }
    };
    vec![of(1), of(0), of(2)]
}

/// The numbers in other programs' terms.
fn programs(answer: &Answer) -> Vec<Program> {
    let mut programs: Vec<Program> = Vec::new();
    for term in terms(&answer.per_width) {
        if programs.last().is_none_or(|program| program.name != term.program) {
            programs.push(Program { name: term.program, terms: Vec::new() });
        }
        let shown = [term.name.into(), digits(term.value), term.unit.into(), term.formula.into()];
        programs.last_mut().expect("one was pushed").terms.push(shown);
    }
    programs
}

/// The page's text.
pub fn render(card: &Card) -> String {
    let (answer, tested) = (card.answer, card.tested);
    let w = &answer.per_width;
    let lengths = w.bending.map(|d| format!("{:.1}", 1e3 * bending_length(d, w.area_density)));
    let overhangs = tested.overhangs.map(|o| o.map(|l| format!("{:.1}", 1e3 * l)));
    let percent = |k: usize| format!("{:.0}", 100.0 * tested.drapes[k].coefficient);
    let names: Vec<&str> = card.clips.iter().map(|c| c.name.as_str()).collect();
    let alike: Vec<[String; 4]> = card
        .alike
        .iter()
        .map(|(f, off)| {
            let lengths = f.bending.map(|d| format!("{:.1}", 1e3 * bending_length(d, f.density)));
            [
                format!("row {}", f.row),
                format!("{:.0}", 1e3 * f.density),
                lengths.join(" · "),
                format!("{:.2}", off.exp()),
            ]
        })
        .collect();
    let page = Page {
        mark: MARK,
        style: STYLE,
        title: match names[..] {
            [one] => format!("Card of {one}"),
            _ => format!("Card of one fabric in {} clips", names.len()),
        },
        clips: names.iter().map(|name| (*name).to_owned()).collect(),
        several: names.len() > 1,
        weight: digits(1e3 * w.area_density),
        weighed: card.weighed,
        bent: format!("{:.1}", w.bent.to_degrees()),
        key_numbers: vec![
            [lengths.join(" · "), "mm".into(), "bending length, warp · weft".into()],
            [overhangs.each_ref().map(|o| o[1].clone()).join(" · "), "mm".into(), "overhang at 41.5°".into()],
            [percent(1), "%".into(), "drape coefficient".into()],
            [tested.drapes[1].nodes.to_string(), String::new(), "folds".into()],
        ],
        rows: rows(answer),
        agreement: agreement(card.clips, answer),
        next: answer.next_clip(),
        slope: SLOPE,
        overhangs,
        lengths,
        drapes: [0, 1, 2].map(|k| [percent(k), tested.drapes[k].nodes.to_string()]),
        strips: drawing::strips(tested),
        disc: drawing::drapes(tested),
        alike: &alike,
        among: card.among,
        programs: programs(answer),
        version: env!("CARGO_PKG_VERSION"),
    };
    page.render().expect("a string takes every text")
}

/// Writes the page to `path`.
///
/// # Errors
/// [`Error::Output`](tessuto_core::Error::Output).
pub fn write(path: &Path, card: &Card) -> Result<()> {
    io::atomic_write(path, render(card).as_bytes())
}
