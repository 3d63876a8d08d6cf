//! The reference picture and an estimate of its own error.
//!
//! A reference rendered here is the mean `(a + b) / 2` of two independent halves with equal numbers of iterations. If a half
//! has the variance `v`, the mean has `v / 2`, and the expectation of `(a - b)^2` is `2 v`: a quarter of the squared
//! difference of the halves estimates the squared error of the mean. Bias that both halves share does not show.

use super::entry::Metric;
use crate::camera::Camera;
use crate::error::{Error, ErrorKind, Result};
use crate::film::{Layer, LayerSet, Picture, Size};
use crate::image::exr::{self, Attributes};
use crate::image::{Errors, errors};
use crate::render::{Control, RenderInput, Session, Settings};
use crate::scene::Scene;
use serde_json::{Value, json};
use std::path::Path;

/// A reference picture's own error against the truth, in the metrics of [`Errors`]; `None` where it is unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OwnError {
    /// Mean relative squared error over the pixels.
    pub relmse: Option<f64>,
    /// Mean relative squared error without the worst 0.5 % of the pixels.
    pub relmse_trimmed: Option<f64>,
    /// Mean squared error over the pixels and channels.
    pub mse: Option<f64>,
}

impl OwnError {
    /// The reference's own error in a metric; `None` if it is unknown.
    pub fn of(&self, metric: Metric) -> Option<f64> {
        match metric {
            Metric::RelMse => self.relmse,
            Metric::RelMseTrimmed => self.relmse_trimmed,
            Metric::Mse => self.mse,
        }
    }

    /// An own error of a reference that is known in one metric only.
    pub fn in_metric(metric: Metric, error: f64) -> OwnError {
        let of = |other: Metric| (metric == other).then_some(error);
        let [relmse, relmse_trimmed, mse] = [Metric::RelMse, Metric::RelMseTrimmed, Metric::Mse].map(of);
        OwnError { relmse, relmse_trimmed, mse }
    }

    /// The reference's own error as a JSON object, by metric.
    pub fn object(&self) -> Value {
        json!({"relmse": self.relmse, "relmse_trimmed": self.relmse_trimmed, "mse": self.mse})
    }
}

/// A reference picture, against which the errors of other pictures are measured.
#[derive(Clone, Debug)]
pub struct Reference {
    /// The picture, in scene-linear radiance.
    pub picture: Picture,
    /// The picture's own error.
    pub error: OwnError,
    /// The picture's origin, in words.
    pub about: String,
}

impl Reference {
    /// The error of a picture in a metric after subtraction of the reference's own error; `None` if the difference does not
    /// exceed the reference's own error.
    ///
    /// The errors of picture and reference are independent, so that the measured squared error is the sum of theirs.
    pub fn figure(&self, metric: Metric, errors: &Errors) -> Option<f64> {
        let own = self.error.of(metric).unwrap_or(0.0);
        let figure = metric.of(errors) - own;
        (figure > own && figure > 0.0).then_some(figure)
    }

    /// Reads a reference picture of this size (width, height), and its own error from the header if caustique has
    /// written the file. Also returns the header's JSON object.
    ///
    /// # Errors
    /// The file cannot be read, has no picture, or has another size.
    pub fn read(path: &Path, size: (u32, u32)) -> Result<(Reference, Value)> {
        let (set, attributes) = exr::read(path)?;
        let header = attributes.object().unwrap_or(Value::Null);
        let reference = Reference::of(&set, &header, size, path.display().to_string())?;
        Ok((reference, header))
    }

    /// The reference in a layer set, of this size (width, height), with its own error from the `header`'s JSON object.
    /// `about` is its origin, in words.
    ///
    /// # Errors
    /// The set has no picture or another size.
    pub fn of(set: &LayerSet, header: &Value, size: (u32, u32), about: String) -> Result<Reference> {
        let Size { width, height } = size.into();
        if (set.width, set.height) != (width, height) {
            let cause = format!("the reference has {} x {} pixels, not {width} x {height}", set.width, set.height);
            let error = Error::new(ErrorKind::Usage, about, cause);
            return Err(error.hint(format!("use --width {} --height {}", set.width, set.height)));
        }
        let picture = set.beauty().map_err(|error| error.within(&about))?;
        if !picture.iter().flatten().any(|v| v.is_finite()) {
            return Err(Error::new(ErrorKind::Image, about, "the reference has no finite value"));
        }
        Ok(Reference { picture, error: stated_error(header), about })
    }

    /// Writes the reference as an EXR with its estimated standard error, and its own error in the header.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path, halves: &Halves) -> Result<()> {
        let mut set = LayerSet::new(self.picture.size().width, self.picture.size().height);
        set.push(Layer::interleaved("", "RGB", self.picture.iter().copied()))?;
        set.push(Layer::interleaved("Error", "RGB", halves.a.half_difference(&halves.b)))?;
        let header = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "method": halves.method,
            "seeds": halves.seeds,
            "iterations": 2 * halves.iterations,
            "seconds": halves.seconds,
            "reference_error": self.error.object(),
            "reference_error_of": "a quarter of the squared difference of two independent halves",
        });
        exr::write(path, &set, &Attributes::of(&header)?, exr::Options::default())
    }
}

/// The error that a file's JSON header states: a reference's own error, or the estimated error of a render that was not
/// finished.
fn stated_error(header: &Value) -> OwnError {
    let own = &header["reference_error"];
    if own.is_object() {
        let [relmse, relmse_trimmed, mse] = ["relmse", "relmse_trimmed", "mse"].map(|key| own[key].as_f64());
        return OwnError { relmse, relmse_trimmed, mse };
    }
    let estimate = header["error"].as_f64().filter(|_| header["combined"].is_null());
    OwnError { relmse: estimate.map(|error| error * error), ..OwnError::default() }
}

/// Two independent renders with equal numbers of iterations, whose mean is a reference picture.
pub struct Halves {
    /// The picture of the first render.
    pub a: Picture,
    /// The picture of the second render.
    pub b: Picture,
    /// Name of the method of both renders.
    pub method: &'static str,
    /// Seed of each render.
    pub seeds: [u64; 2],
    /// Iterations of each render.
    pub iterations: u64,
    /// Wall-clock seconds of both renders together.
    pub seconds: f64,
}

impl Halves {
    /// Renders both halves in turns for the iterations (of each) or the time (of both together) in `settings`, at least
    /// two iterations. `observe` receives the iterations of each and the seconds of both, and can stop the render.
    pub fn render(
        scene: &Scene,
        camera: &Camera,
        settings: &Settings,
        mut observe: impl FnMut(u64, f64) -> Control,
    ) -> Halves {
        // Seeds that no user is likely to choose.
        let seeds = [0, 1].map(|half| settings.seed ^ (0x8000_cafe_0000_0000 + half));
        let stages = seeds.map(|seed| RenderInput::new(scene, camera, &Settings { seed, ..settings.clone() }));
        let [mut a, mut b] = [0, 1].map(|half| Session::new(&stages[half]));
        loop {
            a.step();
            b.step();
            let seconds = a.spent().seconds + b.spent().seconds;
            let stopped = observe(a.iterations(), seconds) == Control::Stop;
            if a.iterations() >= 2 && (stopped || a.is_finished() || settings.time.is_some_and(|time| seconds >= time))
            {
                break;
            }
        }
        Halves {
            seeds,
            method: settings.method.name(),
            iterations: a.iterations(),
            seconds: a.spent().seconds + b.spent().seconds,
            a: a.picture(),
            b: b.picture(),
        }
    }

    /// The mean of both renders as a reference, with its own error.
    pub fn reference(&self) -> Reference {
        let about = format!(
            "Two independent halves by {}, {} iterations each, {:.0} s in all",
            self.method, self.iterations, self.seconds
        );
        Reference { picture: self.a.average(&self.b), error: own_error(&self.a, &self.b), about }
    }
}

/// The error of the mean of two independent halves: a quarter of their squared difference.
pub fn own_error(a: &Picture, b: &Picture) -> OwnError {
    // Half the difference is the distance of either from the mean.
    errors(a, &a.average(b)).map_or(OwnError::default(), |errors| OwnError {
        relmse: Some(errors.relmse),
        relmse_trimmed: Some(errors.relmse_trimmed),
        mse: Some(errors.mse),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    /// For pictures with known truth and noise the stated error equals the error against the truth. Over 20000 pixels its
    /// standard error is below one percent; the squared difference of the halves would be four times as large.
    #[test]
    fn the_stated_error_of_two_halves_is_their_means_error() {
        let size = Size { width: 200, height: 100 };
        let noisy = |seed: u64| {
            Picture::from_fn(size, |i| {
                let truth = 0.2 + (i % 7) as f32;
                std::array::from_fn(|c| {
                    let u = Stream::new(seed, 1 + c as u64, Domain::Test, i as u64).vertex(0).two(Purpose::Pixel).x;
                    truth * (1.0 + 0.3 * (u - 0.5))
                })
            })
        };
        let (a, b) = (noisy(1), noisy(2));
        let truth = Picture::from_fn(size, |i| [0.2 + (i % 7) as f32; 3]);
        let halves = Halves { a, b, method: "path", seeds: [1, 2], iterations: 2, seconds: 1.0 };
        let reference = halves.reference();
        let real = errors(&reference.picture, &truth).expect("finite pixels");
        let stated = reference.error;
        assert!((stated.mse.expect("known") / real.mse - 1.0).abs() < 0.04, "{stated:?}, {real:?}");
        assert!((stated.relmse.expect("known") / real.relmse - 1.0).abs() < 0.04, "{stated:?}, {real:?}");
        let trimmed = stated.relmse_trimmed.expect("known");
        assert!((trimmed / real.relmse_trimmed - 1.0).abs() < 0.04, "{stated:?}, {real:?}");
        // The figure of an independent picture against this reference is its true error.
        let other = noisy(3);
        let measured = errors(&other, &reference.picture).expect("finite pixels");
        let figure = reference.figure(Metric::Mse, &measured).expect("twice the reference's error");
        let true_error = errors(&other, &truth).expect("finite pixels").mse;
        assert!((figure / true_error - 1.0).abs() < 0.04, "{figure}, {true_error}");
        assert_eq!(reference.figure(Metric::Mse, &errors(&halves.a, &reference.picture).expect("finite")), None);
    }
}
