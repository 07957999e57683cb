//! Line charts as SVG text.

use std::fmt::Write;

/// One line of a chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// Its points; where a value is not finite (or not positive on a log axis) the line has a gap.
    pub points: Vec<(f64, f64)>,
}

/// A line chart.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Chart {
    /// Heading.
    pub title: String,
    /// Name of the horizontal axis, with its unit.
    pub x_label: String,
    /// Name of the vertical axis, with its unit.
    pub y_label: String,
    /// The lines.
    pub series: Vec<Series>,
}

/// Colours that people with any colour vision can tell apart (Okabe, Ito).
const COLOURS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#444444"];
const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 280.0;
/// Space around the plot [px]: left, right, top, bottom.
const MARGIN: [f64; 4] = [66.0, 14.0, 44.0, 44.0];

/// One axis: values from `low` to `high` at pixels from `start` to `end`.
struct Axis {
    low: f64,
    high: f64,
    start: f64,
    end: f64,
    log: bool,
}

impl Axis {
    /// Around `values`; logarithmic if asked for, they are positive and span two decades or more.
    fn around(values: impl Iterator<Item = f64>, [start, end]: [f64; 2], may_be_log: bool) -> Self {
        let values: Vec<f64> = values.filter(|v| v.is_finite()).collect();
        let positive: Vec<f64> = values.iter().copied().filter(|v| *v > 0.0).collect();
        let range =
            |v: &[f64]| v.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        // A loss that is exactly 0 at first does not forbid a log axis, negative values do.
        let (low, high) = range(&positive);
        let log = may_be_log && values.iter().all(|v| *v >= 0.0) && high / low >= 100.0;
        let (low, high) = if log { (low.log10(), high.log10()) } else { range(&values) };
        let (low, high) = if low > high { (0.0, 1.0) } else { (low, high) };
        let room = match (high - low, may_be_log) {
            (span, _) if span <= 1e-9 * high.abs().max(low.abs()) => 0.1 * high.abs().max(1e-3),
            (span, true) => 0.05 * span,
            (_, false) => 0.0,
        };
        Self { low: low - room, high: high + room, start, end, log }
    }

    fn pixel(&self, value: f64) -> f64 {
        let value = if self.log { value.log10() } else { value };
        self.start + (value - self.low) / (self.high - self.low) * (self.end - self.start)
    }

    /// Values worth a mark, ascending.
    fn ticks(&self) -> Vec<f64> {
        if self.log {
            let decades = self.low.ceil() as i32..=self.high.floor() as i32;
            let every = (decades.clone().count() as i32).div_euclid(7) + 1;
            let whole: Vec<f64> = decades.filter(|d| d % every == 0).map(|d| 10f64.powi(d)).collect();
            return whole;
        }
        let rough = (self.high - self.low) / 5.0;
        let power = 10f64.powf(rough.log10().floor());
        let step =
            [1.0, 2.0, 2.5, 5.0, 10.0].map(|s| s * power).into_iter().find(|s| *s >= rough).unwrap_or(rough);
        let (first, last) = ((self.low / step).ceil() as i64, (self.high / step + 1e-9).floor() as i64);
        (first..=last).map(|k| k as f64 * step).collect()
    }
}

impl Chart {
    /// The chart as an `<svg>` element. All names are escaped.
    pub fn svg(&self) -> String {
        let [left, right, top, bottom] = MARGIN;
        let every = || self.series.iter().flat_map(|s| &s.points);
        let x_axis = Axis::around(every().map(|p| p.0), [left, WIDTH - right], false);
        let y_axis = Axis::around(every().map(|p| p.1), [HEIGHT - bottom, top], true);
        let mut out = format!(
            r#"<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{}">"#,
            escaped(&self.title)
        );
        text(&mut out, [left, 15.0], "title", &self.title);
        self.grid(&mut out, &x_axis, &y_axis);
        for (k, series) in self.series.iter().enumerate() {
            let colour = COLOURS[k % COLOURS.len()];
            let _ = write!(
                out,
                r#"<path class="line" stroke="{colour}" d="{}"/>"#,
                path(series, &x_axis, &y_axis)
            );
        }
        self.legend(&mut out);
        out.push_str("</svg>");
        out
    }

    fn grid(&self, out: &mut String, x_axis: &Axis, y_axis: &Axis) {
        let [left, right, top, bottom] = MARGIN;
        let (end, floor) = (WIDTH - right, HEIGHT - bottom);
        for value in y_axis.ticks() {
            let y = y_axis.pixel(value);
            let _ = write!(out, r#"<path class="grid" d="M{left} {y:.1}H{end}"/>"#);
            text(out, [left - 6.0, y + 4.0], "y", &number(value, y_axis));
        }
        for value in x_axis.ticks() {
            let x = x_axis.pixel(value);
            let _ = write!(out, r#"<path class="grid" d="M{x:.1} {top}V{floor}"/>"#);
            text(out, [x, floor + 16.0], "x", &number(value, x_axis));
        }
        let _ = write!(out, r#"<path class="axis" d="M{left} {top}V{floor}H{end}"/>"#);
        text(out, [(left + end) / 2.0, HEIGHT - 8.0], "x", &self.x_label);
        let (x, y) = (14.0, (top + floor) / 2.0);
        let scale = if y_axis.log { ", log scale" } else { "" };
        let label = escaped(&format!("{}{scale}", self.y_label));
        let _ =
            write!(out, r#"<text class="x" x="{x}" y="{y}" transform="rotate(-90 {x} {y})">{label}</text>"#);
    }

    /// Names of the lines between title and plot; one line alone is named by the title.
    fn legend(&self, out: &mut String) {
        let mut x = MARGIN[0];
        for (k, series) in self.series.iter().enumerate().filter(|_| self.series.len() > 1) {
            let _ =
                write!(out, r#"<path class="line" stroke="{}" d="M{x} 30h14"/>"#, COLOURS[k % COLOURS.len()]);
            text(out, [x + 19.0, 34.0], "name", &series.name);
            x += 36.0 + 6.6 * series.name.chars().count() as f64;
        }
    }
}

fn path(series: &Series, x_axis: &Axis, y_axis: &Axis) -> String {
    let (mut out, mut pen_down) = (String::new(), false);
    for (x, y) in &series.points {
        let (px, py) = (x_axis.pixel(*x), y_axis.pixel(*y));
        if px.is_finite() && py.is_finite() {
            let _ = write!(out, "{}{px:.1} {py:.1}", if pen_down { 'L' } else { 'M' });
        }
        pen_down = px.is_finite() && py.is_finite();
    }
    out
}

fn text(out: &mut String, [x, y]: [f64; 2], class: &str, content: &str) {
    let _ = write!(out, r#"<text class="{class}" x="{x:.1}" y="{y:.1}">{}</text>"#, escaped(content));
}

/// As many digits as tell neighbouring ticks apart.
fn number(value: f64, axis: &Axis) -> String {
    let span = axis.high - axis.low;
    if axis.log || value != 0.0 && (value.abs() >= 1e5 || span < 1e-3) {
        let text = format!("{value:.1e}");
        return if axis.log { text.replace(".0e", "e") } else { text };
    }
    let digits = (1.3 - span.log10()).ceil().clamp(0.0, 6.0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// `text` with the characters that mean something in markup replaced.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: &[(f64, f64)]) -> Chart {
        let series = vec![Series { name: "a<b".into(), points: points.to_vec() }];
        Chart { title: "<script>".into(), series, ..Chart::default() }
    }

    #[test]
    fn decades_get_a_log_axis_and_gaps_break_the_line() {
        let svg = chart(&[(0.0, 1.0), (1.0, f64::NAN), (2.0, 1e-3), (3.0, 2e-3)]).svg();
        assert!(svg.contains("log scale") && svg.contains("1e-2"));
        let line = svg.split(r#"class="line""#).nth(1).unwrap();
        assert_eq!(line.split("/>").next().unwrap().matches('M').count(), 2, "{svg}");
        assert!(!chart(&[(0.0, 1.0), (1.0, 2.0)]).svg().contains("log scale"));
        assert!(!chart(&[(0.0, -1.0), (1.0, 2000.0)]).svg().contains("log scale"));
    }

    #[test]
    fn any_values_give_finite_pixels_and_escaped_names() {
        for points in [
            &[][..],
            &[(0.0, 0.0)],
            &[(1.0, 5.0), (2.0, 5.0)],
            &[(0.0, f64::INFINITY)],
            &[(0.0, 0.0), (1.0, 1e-9)],
        ] {
            let svg = chart(points).svg();
            assert!(!svg.contains("NaN") && !svg.contains("inf") && !svg.contains("<script>"), "{svg}");
        }
    }
}
