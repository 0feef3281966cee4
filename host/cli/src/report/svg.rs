//! Drawings as SVG with colours from a style sheet, because a page is read in dark mode and printed on white. The crate plotters is not used: it
//! writes colours into every element.

use std::ops::Range;

use maud::{Markup, PreEscaped, html};

use super::page::{FIGURES, STYLE, raised};

/// Maps values to pixels of a drawing.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Left and right end, pixels.
    pub across: Range<f64>,
    /// Top and bottom, pixels.
    pub down: Range<f64>,
    /// Values at the left and the right end.
    pub x: Range<f64>,
    /// Values at the bottom and the top end.
    pub y: Range<f64>,
    /// Whether both axes are logarithmic.
    pub logarithmic: bool,
}

/// Classes of the three axes of a sensor: colours that colour-blind people can distinguish (Okabe and Ito).
pub const AXIS_CLASSES: [&str; 3] = ["axis-x", "axis-y", "axis-z"];

impl Frame {
    /// Pixel of an abscissa.
    pub fn at_x(&self, x: f64) -> f64 {
        let share = self.share(x, &self.x);
        self.across.start + share * (self.across.end - self.across.start)
    }

    /// Pixel of an ordinate.
    pub fn at_y(&self, y: f64) -> f64 {
        let share = self.share(y, &self.y);
        self.down.end - share * (self.down.end - self.down.start)
    }

    fn share(&self, value: f64, of: &Range<f64>) -> f64 {
        match self.logarithmic {
            true => (value / of.start).ln() / (of.end / of.start).ln(),
            false => (value - of.start) / (of.end - of.start),
        }
    }

    /// Numbers of an axis with this range, and their labels.
    fn numbers(&self, range: &Range<f64>) -> Vec<(f64, String)> {
        match self.logarithmic {
            true => decades(range),
            false => ticks(range, 5),
        }
    }

    /// Grid, numbers and a heading. Numbers of the ordinate are shown only if `with_y`.
    pub fn axes(&self, heading: &str, with_y: bool) -> Markup {
        self.grid(heading, &self.numbers(&self.x), with_y)
    }

    /// Grid, numbers and a heading, with the given numbers of the abscissa.
    fn grid(&self, heading: &str, x: &[(f64, String)], with_y: bool) -> Markup {
        let y = self.numbers(&self.y);
        let (left, right) = (self.across.start, self.across.end);
        let (top, bottom) = (self.down.start, self.down.end);
        let zero = (!self.logarithmic && self.y.contains(&0.0)).then(|| self.at_y(0.0));
        html! {
            path class="grid" d=(y.iter().map(|(y, _)| format!("M{left:.1} {:.1}H{right:.1}", self.at_y(*y))).collect::<String>()) {}
            path class="grid" d=(x.iter().map(|(x, _)| format!("M{:.1} {top:.1}V{bottom:.1}", self.at_x(*x))).collect::<String>()) {}
            @for (x, label) in x {
                text class="tick" x=(px(self.at_x(*x))) y=(px(bottom + 14.0)) text-anchor="middle" { (label) }
            }
            @if with_y {
                @for (y, label) in &y {
                    text class="tick" x=(px(left - 6.0)) y=(px(self.at_y(*y) + 3.5)) text-anchor="end" { (label) }
                }
            }
            text class="heading" x=(px(left)) y=(px(top - 8.0)) { (heading) }
            @if let Some(y) = zero { path class="zero" d={ "M" (px(left)) " " (px(y)) "H" (px(right)) } {} }
        }
    }

    /// Name of the abscissa, centred between this frame and `last`, which may be the same.
    pub fn x_name(&self, name: &str, last: &Self) -> Markup {
        let middle = 0.5 * (self.across.start + last.across.end);
        html! { text class="name" x=(px(middle)) y=(px(self.down.end + 31.0)) text-anchor="middle" { (name) } }
    }

    /// Name of the ordinate, rotated, next to the numbers.
    pub fn y_name(&self, name: &str) -> Markup {
        // Its letters reach 12 pixels to the left of it.
        let (x, y) = (px(16.0), px(0.5 * (self.down.start + self.down.end)));
        html! { text class="name" x=(x) y=(y) text-anchor="middle" transform={ "rotate(-90 " (x) " " (y) ")" } { (name) } }
    }

    /// Round marks.
    pub fn dots(&self, class: &str, points: impl Iterator<Item = (f64, f64)>) -> Markup {
        // A line of zero length with round ends takes a tenth of the bytes of a circle.
        self.path(class, points, |_, x, y| format!("M{x:.1} {y:.1}h0"))
    }

    /// Unfilled diamonds.
    pub fn diamonds(&self, class: &str, points: impl Iterator<Item = (f64, f64)>) -> Markup {
        let diamond = |x, top| format!("M{x:.1} {top:.1}l3.4 3.4l-3.4 3.4l-3.4 -3.4z");
        self.path(class, points, |_, x, y| diamond(x, y - 3.4))
    }

    /// Vertical bars: abscissa, middle, half-length.
    pub fn bars(&self, class: &str, bars: impl Iterator<Item = (f64, f64, f64)>) -> Markup {
        let at = |y: f64| self.at_y(y.clamp(self.y.start, self.y.end));
        let known = bars.filter(|(x, y, _)| x.is_finite() && y.is_finite());
        let bar = |(x, y, half)| {
            format!(
                "M{:.1} {:.1}V{:.1}",
                self.at_x(x),
                at(y - half),
                at(y + half)
            )
        };
        html! { path class=(class) d=(known.map(bar).collect::<String>()) {} }
    }

    /// A line through points.
    pub fn line(&self, class: &str, points: impl Iterator<Item = (f64, f64)>) -> Markup {
        self.path(class, points, |k, x, y| {
            format!("{}{x:.1} {y:.1}", if k == 0 { 'M' } else { 'L' })
        })
    }

    /// The area between two lines: abscissa, lower and upper ordinate.
    pub fn band(&self, class: &str, points: &[(f64, f64, f64)]) -> Markup {
        let inside = |y: f64| y.clamp(self.y.start, self.y.end);
        let up = points.iter().map(|p| (p.0, inside(p.2)));
        let back = points.iter().rev().map(|p| (p.0, inside(p.1)));
        self.line(class, up.chain(back))
    }

    /// Shades every second segment between `ends`.
    pub fn stretches(&self, class: &str, ends: &[f64]) -> Markup {
        let after = ends.iter().skip(1).copied().chain([self.x.end]);
        let all: Vec<(f64, f64)> = ends.iter().copied().zip(after).step_by(2).collect();
        self.spans(class, &all)
    }

    /// Shades the spans between pairs of abscissas.
    pub fn spans(&self, class: &str, spans: &[(f64, f64)]) -> Markup {
        let (top, height) = (self.down.start, self.down.end - self.down.start);
        html! { @for (from, to) in spans {
            @let (from, to) = (self.at_x(*from), self.at_x(*to));
            rect class=(class) x=(px(from)) y=(px(top)) width=(px(to - from)) height=(px(height)) {}
        } }
    }

    /// Class and name of each line, to the right of the heading.
    pub fn legend(&self, entries: &[(&str, &str)]) -> Markup {
        let width = |(_, name): &(&str, &str)| 30.0 + 6.6 * name.chars().count() as f64;
        let left = |k: usize| self.across.end - entries[k..].iter().map(width).sum::<f64>();
        let y = self.down.start - 12.0;
        html! { @for (k, (class, name)) in entries.iter().enumerate() {
            path class=(class) d={ "M" (px(left(k) + 6.0)) " " (px(y)) "h14" } {}
            text class="tick" x=(px(left(k) + 24.0)) y=(px(y + 3.5)) { (name) }
        } }
    }

    /// Marks at points, by their number and place in pixels.
    fn path(
        &self,
        class: &str,
        points: impl Iterator<Item = (f64, f64)>,
        mark: impl Fn(usize, f64, f64) -> String,
    ) -> Markup {
        let known = points
            .map(|(x, y)| (self.at_x(x), self.at_y(y)))
            .filter(|(x, y)| x.is_finite() && y.is_finite())
            .enumerate();
        let d: String = known.map(|(k, (x, y))| mark(k, x, y)).collect();
        html! { path class=(class) d=(d) {} }
    }
}

/// Size of a figure, and margins around its frame for numbers and names.
#[derive(Debug, Clone, Copy)]
pub struct Panel {
    /// Width and height.
    pub size: (f64, f64),
    /// Margins at the left, right, top and bottom of the frame.
    pub room: [f64; 4],
}

impl Panel {
    /// A figure with a single frame. Two fit side by side on a wide page.
    pub const ONE: Self = Self {
        size: (560.0, 232.0),
        room: [70.0, 8.0, 26.0, 40.0],
    };

    /// The frame inside the margins.
    pub fn frame(&self, x: Range<f64>, y: Range<f64>) -> Frame {
        let [left, right, top, bottom] = self.room;
        Frame {
            across: left..self.size.0 - right,
            down: top..self.size.1 - bottom,
            x,
            y,
            logarithmic: false,
        }
    }

    /// The same with logarithmic axes.
    pub fn logarithmic(&self, x: Range<f64>, y: Range<f64>) -> Frame {
        Frame {
            logarithmic: true,
            ..self.frame(x, y)
        }
    }

    /// Drawings of this size in rows, as a file.
    pub fn file(&self, rows: &[Vec<Markup>]) -> String {
        let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
        let (width, height) = (
            self.size.0 * columns as f64,
            self.size.1 * rows.len() as f64,
        );
        let drawn = html! {
            svg xmlns="http://www.w3.org/2000/svg" width=(width) height=(height) viewBox={ "0 0 " (width) " " (height) } font-family="sans-serif" {
                style { (PreEscaped(light_style())) }
                rect width=(width) height=(height) fill="#fff" {}
                @for (down, row) in rows.iter().enumerate() { @for (across, drawn) in row.iter().enumerate() {
                    g transform={ "translate(" (self.size.0 * across as f64) " " (self.size.1 * down as f64) ")" } { (drawn) }
                } }
            }
        };
        drawn.into_string() + "\n"
    }

    /// The complete drawing; `label` describes it for screen readers, `class` is in the style sheet.
    pub fn drawing(&self, label: &str, class: Option<&str>, inside: &Markup) -> Markup {
        html! {
            svg class=[class] role="img" aria-label=(label) viewBox={ "0 0 " (px(self.size.0)) " " (px(self.size.1)) }
                xmlns="http://www.w3.org/2000/svg" { (inside) }
        }
    }
}

/// Style of the figures with the page's light colours in place of their names, which few programs other than browsers know.
fn light_style() -> String {
    let light = STYLE.split(":root{").nth(1).unwrap_or_default();
    let light = light
        .split('}')
        .next()
        .unwrap_or_default()
        .split([';', '\n']);
    let colours = light.filter_map(|colour| colour.split_once(':'));
    colours.fold(FIGURES.to_owned(), |style, (name, colour)| {
        style.replace(&format!("var({name})"), colour)
    })
}

/// A drawing with its names: heading, abscissa and ordinate.
pub struct Chart<'a> {
    /// Where values are.
    pub frame: Frame,
    /// Heading, name of the abscissa, and of the ordinate.
    pub names: [&'a str; 3],
    /// Numbers of the abscissa in place of the usual ones, with their labels.
    pub numbers: Option<Vec<(f64, String)>>,
    /// Class and name of each series.
    pub key: Vec<(&'a str, &'a str)>,
}

impl<'a> Chart<'a> {
    /// A chart in this frame, without a key.
    pub fn new(frame: Frame, names: [&'a str; 3]) -> Self {
        Self {
            frame,
            names,
            numbers: None,
            key: Vec::new(),
        }
    }

    /// With a key of these series.
    pub fn keyed(self, key: impl IntoIterator<Item = (&'a str, &'a str)>) -> Self {
        let key = key.into_iter().collect();
        Self { key, ..self }
    }

    /// The chart with what is behind the grid, and what is before it.
    pub fn drawn(&self, behind: &Markup, before: &Markup) -> Markup {
        let (frame, [heading, x, y]) = (&self.frame, self.names);
        html! {
            (behind)
            @match &self.numbers { Some(numbers) => (frame.grid(heading, numbers, true)), None => (frame.axes(heading, true)) }
            @if !x.is_empty() { (frame.x_name(x, frame)) }
            @if !y.is_empty() { (frame.y_name(y)) }
            (before)
            (frame.legend(&self.key))
        }
    }
}

/// Powers of ten in the range, with their labels, for a logarithmic axis; with their multiples by 2 and 5 if there are few.
fn decades(range: &Range<f64>) -> Vec<(f64, String)> {
    let many = (range.end / range.start).log10() > 2.5;
    let factors: &[i32] = if many { &[1] } else { &[1, 2, 5] };
    let powers = range.start.log10().floor() as i32..=range.end.log10().ceil() as i32;
    let all = powers.flat_map(|power| factors.iter().map(move |f| (*f, power)));
    let each = all.filter_map(|(factor, power)| {
        let value: f64 = format!("{factor}e{power}").parse().ok()?;
        let label = match power {
            -3..=4 => format!("{value}"),
            _ => format!("{factor}·10{}", raised(&power.to_string())),
        };
        range.contains(&value).then_some((value, label))
    });
    each.collect()
}

/// Pixels, to a tenth.
pub fn px(v: f64) -> String {
    format!("{v:.1}")
}

/// The range of `values` with a margin; never empty.
pub fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let known: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    let low = known.iter().copied().fold(f64::INFINITY, f64::min);
    let high = known.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    match high - low {
        width if width > 0.0 => low - 0.06 * width..high + 0.06 * width,
        0.0 => low - high.abs().max(1e-12)..high + high.abs().max(1e-12),
        _ => -1.0..1.0,
    }
}

/// Power of ten for the numbers of an axis with these ends: 0, or such that the numbers have few digits.
pub fn power_of_ten(ends: &Range<f64>) -> i32 {
    let most = ends.start.abs().max(ends.end.abs());
    if (0.02..2e4).contains(&most) || most == 0.0 {
        return 0;
    }
    3 * (most.log10() / 3.0).floor() as i32
}

/// `10⁻³ ` before the unit of an axis with a power of ten.
pub fn times_ten(power: i32) -> String {
    if power == 0 {
        return String::new();
    }
    format!("10{} ", raised(&power.to_string()))
}

/// About this many round numbers in the range, with their labels.
fn ticks(range: &Range<f64>, about: usize) -> Vec<(f64, String)> {
    let width = range.end - range.start;
    let rough = width / about as f64;
    let decade = 10f64.powf(rough.log10().floor());
    let mut steps = [1.0, 2.0, 5.0].map(|m| m * decade).into_iter();
    let step = steps.find(|s| *s >= 0.999 * rough).unwrap_or(10.0 * decade);
    let from = (range.start / step).ceil() as i64;
    let to = (range.end / step).floor() as i64;
    let decimals = (-step.log10()).ceil().clamp(0.0, 9.0) as usize;
    let label = |value: f64| {
        let text = format!("{value:.decimals$}");
        // A sum of steps may leave the sign of a zero.
        match text.trim_start_matches('-').trim_matches(['0', '.']) {
            "" => text.trim_start_matches('-').into(),
            _ => text.replace('-', "−"),
        }
    };
    let at = (from..=to).map(|k| k as f64 * step);
    at.map(|value| (value, label(value))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let labels = ticks(&(-0.031..0.047), 5)
            .into_iter()
            .map(|(_, label)| label);
        assert!(labels.eq(["−0.02", "0.00", "0.02", "0.04"]));
        assert_eq!(power_of_ten(&(-3.1e-5..2e-5)), -6);
        assert_eq!(times_ten(-6), "10⁻⁶ ");
    }

    #[test]
    fn the_ends_of_the_ranges_are_the_edges_of_the_frame() {
        let frame = Frame {
            across: 50.0..250.0,
            down: 10.0..110.0,
            x: -1.0..1.0,
            y: 0.0..4.0,
            logarithmic: false,
        };
        assert_eq!((frame.at_x(-1.0), frame.at_x(1.0)), (50.0, 250.0));
        assert_eq!((frame.at_y(4.0), frame.at_y(0.0)), (10.0, 110.0));
        let logarithmic = Frame {
            x: 0.01..100.0,
            logarithmic: true,
            ..frame
        };
        assert_eq!(logarithmic.at_x(1.0), 150.0);
    }

    #[test]
    fn a_file_has_colours_and_no_names_of_them() {
        let style = light_style();
        assert!(
            style.contains("#b36b00") && !style.contains("var("),
            "{style}"
        );
    }
}
