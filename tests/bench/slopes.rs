//! Bias and variance as functions of iterations on photon fields with a closed form: the memoryless rule with its exact
//! finite sums, for SPPM and, where only merging finds light, for VCM; and CPPM with a test that always rejects.
//!
//! `cargo bench --bench slopes -- [ITERATIONS] [SEEDS] [PLOT.svg]`, or `-- MEASURED.json PLOT.svg` to plot earlier
//! results. Every line of standard output is a JSON object: a rule, and per number of iterations the share of the first
//! bandwidth's bias, the variance and the mean squared error (mean over pixels, relative to the squared truth), each
//! with its standard error and expectation. Given the bandwidths, which depend on earlier photons, the expectation of
//! an iteration is known: `bias_given` is the mean of these expectations, the bias without the noise of photons.

#[path = "../support/field.rs"]
mod field;
#[path = "../support/scenes.rs"]
#[allow(dead_code)]
mod scenes;

use caustique::estimator::rule::chi_squared::ChiSquaredSettings;
use caustique::estimator::rule::memoryless::radius2_factor;
use caustique::render::{Method, RenderInput, Session, Settings};
use field::{Field, PixelField};
use plotters::prelude::*;
use serde_json::{Value, json};

const RADIUS: f64 = 0.2;
const PHOTONS: u32 = 2000;

/// A configuration to measure.
struct Run {
    name: &'static str,
    field: Field,
    /// Number of pixels per pixel of the coarsest picture, in each direction.
    finer: u32,
    /// Light paths per iteration.
    photons: u32,
    method: Method,
    /// Alpha of the memoryless rule.
    alpha: Option<f64>,
    chi_squared: ChiSquaredSettings,
}

impl Run {
    fn memoryless(alpha: f64) -> Run {
        Run {
            name: "memoryless",
            field: Field::Square,
            finer: 1,
            photons: PHOTONS,
            method: Method::Sppm,
            alpha: Some(alpha),
            chi_squared: ChiSquaredSettings::default(),
        }
    }

    fn forced(k: f64, beta: f64) -> Run {
        let chi_squared = ChiSquaredSettings { significance: 1.0 - 1e-12, k, beta, ..Default::default() };
        Run { name: "cppm, forced", method: Method::Cppm, alpha: None, chi_squared, ..Run::memoryless(1.0) }
    }

    /// One light path per pixel.
    fn merged() -> Run {
        let (finer, method) = (4, Method::Vcm);
        let photons = field::SIZE.0 * field::SIZE.1 * finer * finer;
        Run {
            name: "vcm, merging alone",
            field: Field::Point,
            finer,
            photons,
            method,
            ..Run::memoryless(method.default_alpha())
        }
    }
}

/// Results of one seed after some number of iterations.
struct Moment {
    /// Estimates of all pixels.
    estimates: Vec<f64>,
    /// Expectations of the estimates, given the bandwidths.
    given: Vec<f64>,
    /// Mean over pixels of the sum over iterations of squared deviations from the expectation, over the squared number
    /// of iterations and the squared truth.
    sum: f64,
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    if let Some(Ok(measured)) = arguments.first().map(std::fs::read_to_string) {
        let rules: Vec<Value> = measured.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
        let file = arguments.get(1).map_or("slopes.svg", String::as_str);
        return plot(file, &rules).unwrap_or_else(|error| panic!("{file}: {error}"));
    }
    let number = |i: usize, default: u64| arguments.get(i).and_then(|a| a.parse().ok()).unwrap_or(default);
    let (n, seeds) = (number(0, 8192), number(1, 16));
    let moments: Vec<u64> = (3..64).map(|e| 1u64 << e).take_while(|m| *m <= n).collect();
    let runs = [
        Run::memoryless(2.0 / 3.0),
        Run::memoryless(0.5),
        Run::forced(0.8, 1.2),
        Run::forced(0.8, 1.0 / 0.64),
        Run::merged(),
    ];
    let mut all = Vec::new();
    for run in runs {
        let Run { name, field, finer, photons, method, alpha, chi_squared } = run;
        let scene = field.scene();
        let camera = scene.camera(&field::view(finer)).unwrap_or_else(|e| panic!("{e}"));
        let (width, height) = camera.size();
        let fields: Vec<PixelField> = (0..width * height)
            .map(|k| PixelField::new(field, (k % width, k / width), finer, RADIUS, photons))
            .collect();
        let mut found: Vec<Vec<Moment>> = moments.iter().map(|_| Vec::new()).collect();
        for seed in 0..seeds {
            let settings = Settings {
                method,
                alpha: alpha.unwrap_or(1.0),
                chi_squared,
                iterations: None,
                ..field.settings(RADIUS, photons, seed)
            };
            let stage = RenderInput::new(&scene, &camera, &settings);
            let mut session = Session::new(&stage);
            let (mut sums, mut given, mut squares) = (vec![0.0; fields.len()], vec![0.0; fields.len()], 0.0);
            // The bandwidths of the next iteration, if they depend on photons.
            let mut radii = vec![RADIUS; fields.len()];
            for i in 1..=n {
                session.step();
                for (k, (pixel, field)) in session.pixels().iter().zip(&fields).enumerate() {
                    let radius2 = alpha.map_or(radii[k].powi(2), |a| RADIUS * RADIUS * radius2_factor(i, a));
                    let mean = field.moments(radius2).mean;
                    let now = field::photons_of(pixel) * i as f64;
                    squares += ((now - sums[k] - mean) / field.truth).powi(2);
                    sums[k] = now;
                    given[k] += mean;
                }
                if alpha.is_none() {
                    let layers = session.layers(|name| name == "Radius1").unwrap_or_else(|e| panic!("{e}"));
                    let of = layers.get("Radius1").map(|layer| layer.triples()).unwrap_or_default();
                    radii = of.iter().map(|radius| f64::from(radius[0])).collect();
                }
                if let Some(at) = moments.iter().position(|m| *m == i) {
                    let estimates = session.pixels().iter().map(field::photons_of).collect();
                    let given = given.iter().map(|sum| sum / i as f64).collect();
                    found[at].push(Moment { estimates, given, sum: squares / fields.len() as f64 / (i * i) as f64 });
                }
            }
        }
        let series: Vec<Value> = moments.iter().zip(&found).map(|(m, e)| at(*m, e, &fields, alpha)).collect();
        let parameters = match alpha {
            Some(alpha) => json!({"alpha": alpha}),
            None => json!({"k": chi_squared.k, "beta": chi_squared.beta}),
        };
        let rule = json!({"rule": name, "parameters": parameters, "seeds": seeds, "series": series});
        println!("{rule}");
        all.push(rule);
    }
    if let Some(file) = arguments.get(2) {
        plot(file, &all).unwrap_or_else(|error| panic!("{file}: {error}"));
    }
}

/// Plots the measurements with standard errors, the finite sums (lines) and the asymptotes (dashed), as in the figure
/// of Knaus and Zwicker.
fn plot(file: &str, rules: &[Value]) -> Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::new(file, (1000, 460)).into_drawing_area();
    root.fill(&WHITE)?;
    let halves = root.split_evenly((1, 2));
    for (area, (key, sum, title)) in halves.iter().zip([
        ("bias", "bias_sum", "bias, of the first bandwidth's"),
        ("variance", "variance_sum", "variance, of the squared truth"),
    ]) {
        let number = |value: &Value| value.as_f64().or_else(|| value[0].as_f64()).filter(|x| *x > 0.0);
        let points = |rule: &Value, key: &str| -> Vec<(f64, f64)> {
            let series = rule["series"].as_array().into_iter().flatten();
            series.filter_map(|at| Some((at["iterations"].as_f64()?, number(&at[key])?))).collect()
        };
        // The bias of CPPM without the noise of photons.
        let shown = |rule: &Value| {
            if key == "bias" && rule["parameters"]["alpha"].is_null() { "bias_given" } else { key }
        };
        let every: Vec<(f64, f64)> = rules.iter().flat_map(|rule| points(rule, shown(rule))).collect();
        let fold = |f: fn(f64, f64) -> f64, x: fn(&(f64, f64)) -> f64| every.iter().map(x).reduce(f).unwrap_or(1.0);
        let (left, right) = (fold(f64::min, |p| p.0) / 1.2, fold(f64::max, |p| p.0) * 1.2);
        let (low, high) = (fold(f64::min, |p| p.1) / 1.5, fold(f64::max, |p| p.1) * 1.5);
        let mut chart = ChartBuilder::on(area)
            .margin(14)
            .caption(title, ("sans-serif", 16))
            .x_label_area_size(34)
            .y_label_area_size(64)
            .build_cartesian_2d((left..right).log_scale(), (low..high).log_scale())?;
        chart
            .configure_mesh()
            .x_desc("iterations")
            .y_label_formatter(&|y| format!("{y:.0e}"))
            .light_line_style(TRANSPARENT)
            .draw()?;
        for (rule, colour) in
            rules.iter().zip([(0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167), (86, 180, 233)])
        {
            let colour = RGBColor(colour.0, colour.1, colour.2);
            let parameters = &rule["parameters"];
            let (name, slope) = match parameters["alpha"].as_f64() {
                Some(alpha) => {
                    let name = rule["rule"].as_str().unwrap_or("");
                    (format!("{name}, alpha {alpha:.2}"), if key == "bias" { alpha - 1.0 } else { -alpha })
                }
                None => {
                    let (k, beta) =
                        (parameters["k"].as_f64().unwrap_or(0.8), parameters["beta"].as_f64().unwrap_or(1.2));
                    // Equations 15 to 17.
                    let rate = (1.0 / k).ln() / (beta / k).ln();
                    (format!("CPPM, k {k}, beta {beta:.2}"), if key == "bias" { -rate } else { rate - 1.0 })
                }
            };
            let key = shown(rule);
            let measured = points(rule, key);
            let found: Vec<[f64; 3]> = rule["series"]
                .as_array()
                .into_iter()
                .flatten()
                .filter_map(|at| {
                    let (x, y, e) = (at["iterations"].as_f64()?, at[key][0].as_f64()?, at[key][1].as_f64()?);
                    (y > 0.0).then_some([x, y, e])
                })
                .collect();
            let bars = found.iter().map(|[x, y, e]| PathElement::new([(*x, (y - e).max(low)), (*x, y + e)], colour));
            chart.draw_series(bars)?;
            let spots = found.iter().map(|[x, y, _]| Circle::new((*x, *y), 4, colour.filled()));
            chart.draw_series(spots)?.label(name).legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
            chart.draw_series(LineSeries::new(points(rule, sum), colour))?;
            if let Some(&(x0, y0)) = measured.last() {
                let from = (x0 / 100.0).max(left);
                let line = [(from, y0 * (from / x0).powf(slope)), (x0, y0)];
                chart.draw_series(DashedLineSeries::new(line, 4, 4, colour.stroke_width(1)))?;
            }
        }
        chart.configure_series_labels().position(SeriesLabelPosition::LowerLeft).border_style(BLACK.mix(0.2)).draw()?;
    }
    root.present()?;
    Ok(())
}

/// Mean and its standard error.
fn mean(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt())
}

fn at(n: u64, seeds: &[Moment], fields: &[PixelField], alpha: Option<f64>) -> Value {
    let first: Vec<f64> = fields.iter().map(|f| f.moments(RADIUS * RADIUS).mean - f.truth).collect();
    let all: f64 = first.iter().map(|b| b * b).sum();
    let share = |estimates: &[f64]| {
        let along = first.iter().zip(estimates).zip(fields).map(|((b, estimate), f)| b * (estimate - f.truth));
        along.sum::<f64>() / all
    };
    let pixels = fields.len() as f64;
    let estimates: Vec<&Vec<f64>> = seeds.iter().map(|moment| &moment.estimates).collect();
    // Variance of each seed about the mean of the others, and error from the truth.
    let count = estimates.len() as f64;
    let means: Vec<f64> = (0..fields.len()).map(|k| estimates.iter().map(|e| e[k]).sum::<f64>() / count).collect();
    let by_seed = |about: &dyn Fn(usize) -> f64| -> Vec<f64> {
        let squared = |e: &&Vec<f64>| {
            e.iter().enumerate().map(|(k, x)| ((x - about(k)) / fields[k].truth).powi(2)).sum::<f64>() / pixels
        };
        estimates.iter().map(squared).collect()
    };
    let unbiased = count / (count - 1.0);
    let variance = mean(&by_seed(&|k| means[k]));
    let error = mean(&by_seed(&|k| fields[k].truth));
    let bias = mean(&estimates.iter().map(|e| share(e)).collect::<Vec<_>>());
    let given = mean(&seeds.iter().map(|moment| share(&moment.given)).collect::<Vec<_>>());
    let mut value = json!({
        "iterations": n,
        "bias": bias,
        "bias_given": given,
        "variance": [variance.0 * unbiased, variance.1 * unbiased],
        "mse": error,
    });
    if let Some(alpha) = alpha {
        let (mut expected, mut expected_variance) = (vec![0.0; fields.len()], 0.0);
        for i in 1..=n {
            let radius2 = RADIUS * RADIUS * radius2_factor(i, alpha);
            for (k, field) in fields.iter().enumerate() {
                let moments = field.moments(radius2);
                expected[k] += moments.mean / n as f64;
                expected_variance += moments.variance / (n * n) as f64 / field.truth.powi(2) / pixels;
            }
        }
        value["bias_sum"] = share(&expected).into();
        value["variance_sum"] = json!(mean(&seeds.iter().map(|moment| moment.sum).collect::<Vec<_>>()));
        value["variance_poisson"] = expected_variance.into();
    }
    value
}
