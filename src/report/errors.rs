//! A self-contained HTML page with the errors of a picture: its difference from a reference, the error that the render has
//! estimated, and FLIP.

use super::crop::heat_bar;
use super::number::short;
use super::page::{data_url, document};
use crate::error::Result;
use crate::film::{LayerSet, Picture, channel_mean};
use crate::finish::ERROR;
use crate::image::tonemap::Look;
use crate::image::{Comparison, heat, png};
use maud::{Markup, html};

/// Percentile of the pixels' errors that gets the palest colour, so that fireflies do not make the rest black.
const PERCENTILE: f64 = 0.95;

/// The HTML page that shows the errors of `image` against its reference, which have the same size.
///
/// # Errors
/// One of the two sets has no picture.
pub fn html(image: &LayerSet, reference: &LayerSet, names: [&str; 2], comparison: &Comparison) -> Result<String> {
    let (pixels, truth) = (image.beauty()?, reference.beauty()?);
    let floor = truth.relative_floor();
    // Relative error of a pixel, from its squared error summed over channels.
    let relative =
        |square: f64, worth: &[f32; 3]| (square / 3.0 / (channel_mean(*worth).powi(2) + floor)).sqrt() as f32;
    let distance =
        |(a, b): (&[f32; 3], &[f32; 3])| relative((0..3).map(|c| (f64::from(a[c]) - f64::from(b[c])).powi(2)).sum(), b);
    let found: Vec<f32> = pixels.iter().zip(&truth).map(distance).collect();
    let estimated = image.picture(ERROR).map(|estimated| -> Vec<f32> {
        let squares = estimated.iter().map(|error| error.iter().map(|e| f64::from(*e).powi(2)).sum::<f64>());
        squares.zip(&truth).map(|(square, worth)| relative(square, worth)).collect()
    });
    let largest = scale(found.iter().chain(estimated.iter().flatten()).copied());
    let shown = |pixels: &Picture| png::encode_tonemapped(pixels, Look::default());
    let map = |errors: &[f32], largest: f32| {
        png::encode(image.size(), errors.iter().map(|error| heat::magma(error / largest)))
    };
    let bar = data_url(&heat_bar()?);
    let percents = |largest: f32| [0.0, 0.5, 1.0].map(|part| format!("{} %", short(100.0 * f64::from(part * largest))));
    let plain = [0.0, 0.5, 1.0].map(short);
    let mut figures = vec![
        figure(names[0], &data_url(&shown(&pixels)?), None),
        figure(names[1], &data_url(&shown(&truth)?), None),
        figure("relative error against it", &data_url(&map(&found, largest)?), Some((&bar, &percents(largest)))),
    ];
    if let Some(estimated) = &estimated {
        let estimated = data_url(&map(estimated, largest)?);
        figures.push(figure("error that the render has estimated", &estimated, Some((&bar, &percents(largest)))));
    }
    figures.push(figure("FLIP", &data_url(&map(&comparison.flip_map, 1.0)?), Some((&bar, &plain))));
    let inside = comparison.inside.map_or_else(String::new, |inside| {
        let [relmse, flip, grain] = [inside.relmse, inside.flip, inside.grain].map(short);
        format!("; in glass and mirrors relMSE {relmse}, FLIP {flip}, grain {grain}")
    });
    let lead = format!(
        "relMSE {}, trimmed {}, FLIP {}, grain {}, mean ratio {}{inside}",
        short(comparison.relmse),
        short(comparison.relmse_trimmed),
        short(comparison.flip),
        short(comparison.grain),
        comparison.mean_ratio.map_or("unknown".into(), short)
    );
    let body = html! { section { div.errors { @for figure in &figures { (figure) } } } };
    Ok(document(&format!("Errors of {}", names[0]), &lead, &body))
}

/// The HTML of a picture with a title, and of the bar of its colour scale with three labels.
fn figure(title: &str, url: &str, scale: Option<(&str, &[String; 3])>) -> Markup {
    html! {
        figure {
            figcaption { (title) }
            img src=(url) alt=(title);
            @if let Some((bar, labels)) = scale {
                div.scale {
                    img src=(bar) alt="colours of the scale";
                    div.labels { @for label in labels { span { (label) } } }
                }
            }
        }
    }
}

/// The error that gets the palest colour of the heat map, from the errors of the pixels.
fn scale(errors: impl Iterator<Item = f32>) -> f32 {
    let mut errors: Vec<f32> = errors.filter(|error| error.is_finite()).collect();
    errors.sort_unstable_by(f32::total_cmp);
    errors.get((PERCENTILE * errors.len() as f64) as usize).copied().unwrap_or(1.0).max(1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Layer;
    use crate::image::compare;

    #[test]
    fn the_page_has_all_pictures_and_a_scale_without_fireflies() {
        let set = |value: f32| -> LayerSet {
            let mut set = LayerSet::new(16, 16);
            let pixels = (0..256).map(|i| if i == 9 { [1e6; 3] } else { [value; 3] });
            set.push(Layer::interleaved("", "RGB", pixels)).expect("sizes agree");
            set
        };
        let (mut image, reference) = (set(1.1), set(1.0));
        let compared = compare(&image, &reference).expect("both are pictures");
        let without = html(&image, &reference, ["a.exr", "b.exr"], &compared).expect("both are pictures");
        assert_eq!(without.matches("<figure>").count(), 4);
        image.push(Layer::interleaved(ERROR, "RGB", [[0.2; 3]; 256])).expect("sizes agree");
        let page = html(&image, &reference, ["a.exr", "b.exr"], &compared).expect("both are pictures");
        assert_eq!(page.matches("<figure>").count(), 5);
        // 0.2 / sqrt(1 + 0.01), with the floor of 0.01.
        assert!(page.contains("19.9 %") || page.contains("20 %"));
    }
}
