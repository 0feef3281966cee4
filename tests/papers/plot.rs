//! Panels of lines, as SVG.

use std::path::Path;

use plotters::prelude::*;

/// A curve.
pub struct Line {
    pub name: String,
    pub points: Vec<(f64, f64)>,
}

/// Colours that colour-blind readers can distinguish (Okabe and Ito).
const COLOURS: [RGBColor; 4] = [
    RGBColor(230, 159, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(213, 94, 0),
];

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
