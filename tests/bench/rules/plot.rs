//! Plots curves in panels.

use plotters::prelude::*;
use std::path::Path;

/// Blue, vermilion and green for SPPM, APPM and CPPM.
const COLOURS: [(u8, u8, u8); 3] = [(0, 114, 178), (213, 94, 0), (0, 158, 115)];

/// A curve. Every point has a standard error, or 0. Curves use the colours in order.
pub struct Curve {
    pub name: String,
    pub points: Vec<(f64, f64, f64)>,
    pub dashed: bool,
    pub colour: usize,
}

/// A plot with two logarithmic axes.
pub struct Panel {
    pub title: String,
    pub across: &'static str,
    pub curves: Vec<Curve>,
}

/// Draws panels, row by row.
pub fn panels(
    file: &Path,
    panels: &[Panel],
    (rows, columns): (usize, usize),
) -> Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::new(file, (500 * columns as u32, 340 * rows as u32)).into_drawing_area();
    root.fill(&WHITE)?;
    for (area, panel) in root.split_evenly((rows, columns)).iter().zip(panels) {
        let all: Vec<(f64, f64, f64)> = panel.curves.iter().flat_map(|c| c.points.clone()).collect();
        let fold = |f: fn(f64, f64) -> f64, of: fn(&(f64, f64, f64)) -> f64| {
            all.iter().filter(|p| p.1 > 0.0).map(of).reduce(f).unwrap_or(1.0)
        };
        let (left, right) = (fold(f64::min, |p| p.0) / 1.1, fold(f64::max, |p| p.0) * 1.1);
        let (least, most) = (fold(f64::min, |p| p.1), fold(f64::max, |p| p.1));
        // An axis of less than a decade would have hardly any label.
        let (low, high) = if most < 8.0 * least { (least / 3.0, most * 1.6) } else { (least / 1.3, most * 1.3) };
        let mut chart = ChartBuilder::on(area)
            .margin(14)
            .caption(&panel.title, ("sans-serif", 16))
            .x_label_area_size(34)
            .y_label_area_size(64)
            .build_cartesian_2d((left..right).log_scale(), (low..high).log_scale())?;
        let digits = |v: &f64| if *v < 1.0 { format!("{v:.0e}") } else { format!("{v:.0}") };
        let round = |v: &f64| {
            let text = format!("{v:.0}");
            if text.starts_with(['1', '2', '5']) { text } else { String::new() }
        };
        chart
            .configure_mesh()
            .x_desc(panel.across)
            .x_label_formatter(&round)
            .y_label_formatter(&digits)
            .light_line_style(TRANSPARENT)
            .draw()?;
        for curve in &panel.curves {
            let (r, g, b) = COLOURS[curve.colour % COLOURS.len()];
            let colour = RGBColor(r, g, b);
            let points: Vec<(f64, f64)> = curve.points.iter().filter(|p| p.1 > 0.0).map(|p| (p.0, p.1)).collect();
            let bars = curve.points.iter().filter(|p| p.1 > 0.0 && p.2 > 0.0);
            let bars: Vec<_> = bars
                .map(|(x, y, e)| PathElement::new([(*x, (y - e).max(low)), (*x, (y + e).min(high))], colour))
                .collect();
            chart.draw_series(bars)?;
            let legend = move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour.stroke_width(2));
            if curve.dashed {
                let line = DashedLineSeries::new(points, 4, 4, colour.stroke_width(2));
                chart.draw_series(line)?.label(&curve.name).legend(legend);
            } else {
                let line = LineSeries::new(points, colour.stroke_width(2));
                chart.draw_series(line)?.label(&curve.name).legend(legend);
            }
        }
        chart.configure_series_labels().position(SeriesLabelPosition::LowerLeft).border_style(BLACK.mix(0.2)).draw()?;
    }
    root.present()?;
    Ok(())
}
