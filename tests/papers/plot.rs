//! Drawing, as SVG: lines, bands and marks on logarithmic axes, and panels of lines on linear ones.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// A region between two curves: x, lowest, highest.
pub struct Band {
    pub name: String,
    pub points: Vec<(f64, f64, f64)>,
}

/// A curve.
pub struct Line {
    pub name: String,
    pub points: Vec<(f64, f64)>,
}

/// A point with its name.
pub struct Mark {
    pub name: String,
    pub at: (f64, f64),
}

/// One picture.
pub struct Chart {
    pub file: String,
    pub title: String,
    pub x: String,
    pub y: String,
    pub bands: Vec<Band>,
    pub lines: Vec<Line>,
    pub marks: Vec<Mark>,
}

/// Colours that colour-blind readers can distinguish (Okabe and Ito).
const COLOURS: [RGBColor; 4] = [
    RGBColor(230, 159, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(213, 94, 0),
];

impl Chart {
    /// Draws the chart into `folder`.
    pub fn draw(&self, folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
        let path = folder.join(&self.file);
        let root = SVGBackend::new(&path, (860, 520)).into_drawing_area();
        root.fill(&WHITE)?;
        let points = || {
            let lines = self.lines.iter().flat_map(|l| l.points.iter().copied());
            let bands = self.bands.iter().flat_map(|b| {
                b.points
                    .iter()
                    .flat_map(|(x, low, high)| [(*x, *low), (*x, *high)])
            });
            lines.chain(bands).chain(self.marks.iter().map(|m| m.at))
        };
        let ends = |values: &mut dyn Iterator<Item = f64>, room: f64| {
            let (low, high) = values
                .filter(|v| v.is_finite())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                    (low.min(v), high.max(v))
                });
            low / room..high * room
        };
        let x = ends(&mut points().map(|p| p.0), 1.05);
        let y = ends(&mut points().map(|p| p.1), 1.15);
        let mut chart = ChartBuilder::on(&root)
            .caption(&self.title, ("sans-serif", 18))
            .margin(14)
            .x_label_area_size(46)
            .y_label_area_size(64)
            .build_cartesian_2d(
                x.clone().log_scale().with_key_points(ticks(x.start, x.end)),
                y.clone().log_scale().with_key_points(ticks(y.start, y.end)),
            )?;
        chart
            .configure_mesh()
            .x_desc(&self.x)
            .y_desc(&self.y)
            .axis_desc_style(("sans-serif", 15))
            .label_style(("sans-serif", 13))
            .x_label_formatter(&|v| format!("{v}"))
            .y_label_formatter(&|v| format!("{v}"))
            .light_line_style(WHITE)
            .bold_line_style(RGBColor(225, 225, 225))
            .draw()?;
        for (k, band) in self.bands.iter().enumerate() {
            let colour = COLOURS[k % COLOURS.len()].mix(0.25);
            let high = band.points.iter().map(|p| (p.0, p.2.min(y.end)));
            let low = band.points.iter().rev().map(|p| (p.0, p.1));
            let outline: Vec<_> = high.chain(low).collect();
            chart
                .draw_series([Polygon::new(outline, colour.filled())])?
                .label(&band.name)
                .legend(move |(x, y)| {
                    Rectangle::new([(x, y - 5), (x + 22, y + 5)], colour.filled())
                });
        }
        for (k, line) in self.lines.iter().enumerate() {
            let style = COLOURS[k % COLOURS.len()].stroke_width(2);
            chart
                .draw_series(LineSeries::new(line.points.iter().copied(), style).point_size(3))?
                .label(&line.name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 22, y)], style));
        }
        for mark in &self.marks {
            // In the right half, the name is to the left of its mark; to the right it would leave the picture.
            let right = mark.at.0 * mark.at.0 > x.start * x.end;
            let (side, from) = if right {
                (HPos::Right, -8)
            } else {
                (HPos::Left, 8)
            };
            let style = ("sans-serif", 13)
                .into_text_style(&root)
                .pos(Pos::new(side, VPos::Center));
            chart.draw_series([EmptyElement::at(mark.at)
                + Circle::new((0, 0), 4, BLACK.filled())
                + Text::new(mark.name.clone(), (from, 0), style)])?;
        }
        chart
            .configure_series_labels()
            .background_style(WHITE.mix(0.85))
            .border_style(RGBColor(200, 200, 200))
            .label_font(("sans-serif", 14))
            .position(SeriesLabelPosition::LowerLeft)
            .draw()?;
        root.present()?;
        Ok(())
    }
}

/// Lines on linear axes.
pub struct Panel {
    pub title: String,
    pub x: String,
    pub y: String,
    pub lines: Vec<Line>,
}

/// Panels side by side, with one legend in the first.
pub struct Figure {
    pub file: String,
    pub columns: usize,
    pub panels: Vec<Panel>,
}

/// Size of a panel, pixels.
const PANEL: (u32, u32) = (340, 260);

impl Figure {
    /// Draws the panels into `folder`, row by row.
    pub fn draw(&self, folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
        let path = folder.join(&self.file);
        let rows = self.panels.len().div_ceil(self.columns);
        let size = (PANEL.0 * self.columns as u32, PANEL.1 * rows as u32);
        let root = SVGBackend::new(&path, size).into_drawing_area();
        root.fill(&WHITE)?;
        let areas = root.split_evenly((rows, self.columns));
        for (k, (panel, area)) in self.panels.iter().zip(&areas).enumerate() {
            panel.draw(area, k == 0)?;
        }
        root.present()?;
        Ok(())
    }
}

impl Panel {
    fn draw(
        &self,
        area: &DrawingArea<SVGBackend, plotters::coord::Shift>,
        legend: bool,
    ) -> Result<(), Box<dyn std::error::Error>> {
        let points = || self.lines.iter().flat_map(|l| l.points.iter().copied());
        let ends = |of: fn((f64, f64)) -> f64, room: f64| {
            let [low, high] = [f64::min, f64::max].map(|f| points().map(of).reduce(f));
            let (low, high) = (low.unwrap_or(0.0), high.unwrap_or(1.0));
            let beside = room * (high - low).max(f64::MIN_POSITIVE);
            low - beside..high + beside
        };
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, ("sans-serif", 14))
            .margin(8)
            .x_label_area_size(36)
            .y_label_area_size(54)
            .build_cartesian_2d(ends(|p| p.0, 0.0), ends(|p| p.1, 0.08))?;
        chart
            .configure_mesh()
            .x_desc(&self.x)
            .y_desc(&self.y)
            .x_labels(5)
            .y_labels(6)
            .axis_desc_style(("sans-serif", 12))
            .label_style(("sans-serif", 11))
            .light_line_style(WHITE)
            .bold_line_style(RGBColor(225, 225, 225))
            .draw()?;
        for (k, line) in self.lines.iter().enumerate() {
            let style = COLOURS[k % COLOURS.len()].stroke_width(2);
            chart
                .draw_series(LineSeries::new(line.points.iter().copied(), style))?
                .label(&line.name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
        }
        if legend {
            chart
                .configure_series_labels()
                .background_style(WHITE.mix(0.85))
                .border_style(RGBColor(200, 200, 200))
                .label_font(("sans-serif", 12))
                .position(SeriesLabelPosition::UpperRight)
                .draw()?;
        }
        Ok(())
    }
}

/// Round numbers of every decade within the range.
fn ticks(low: f64, high: f64) -> Vec<f64> {
    let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let all = decades.flat_map(|d| [1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0].map(|m| m * 10f64.powi(d)));
    // Powers of ten by multiplication have a rounding error, which a label would show.
    let tidy = all.map(|t| (t * 1e6).round() / 1e6);
    tidy.filter(|t| (low..=high).contains(t)).collect()
}
