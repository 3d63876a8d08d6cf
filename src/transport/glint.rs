//! Light of lamps that have a size, sent by perfect mirrors and clear glass to the sharp lobes of a vertex X. Camera paths
//! that go on find it, and so do photons: each well where the other does not. A bulb behind glass that a varnished door
//! shows is met by one camera path in thousands, which then is a bright spot; the photons around X know of it. A sharp
//! highlight is found by every other camera path and blurred by photons.
//!
//! Both are weighed by the balance heuristic, as vertex merging and unidirectional sampling are \[Georgiev et al. 2012,
//! (10)\]. A camera path goes from X along a direction with a density `pdf` per solid angle. Light paths leave the lamp
//! along the same ray with a density e per area that faces it and per solid angle; as mirrors and clear glass keep the
//! area times the solid angle of light, they come to X along it with `e cos` per area and solid angle. So within the
//! squared radius r^2 of X there are, of n light paths,
//!
//! `n pi r^2 e cos / pdf`
//!
//! photons for every camera path. What one of them brings is bounded, however small r is. Weights need only be the same
//! function of the whole path on either side: of e both know the leading power of two ([`PhotonFlags::density`]).

use super::bandwidths::{LevelRadii, MAX_LEVELS};
use crate::bsdf::{BsdfSample, LobeSet, Shading, Transport};
use crate::light::EmissionDensity;
use crate::math::{Rgb, Vec3};
use crate::photon::{Kernel, Photon, PhotonFlags, PhotonMap};
use std::f32::consts::PI;

/// Share of the area in which other photons are gathered: merging is one of two strategies, and as small a kernel
/// suffices.
const AREA: f32 = 1.0 / 4.0;

/// How many photons are merged at a vertex: `n pi r^2` by level.
#[derive(Clone, Copy, Debug)]
struct Merged {
    areas: [f32; MAX_LEVELS],
    /// The level of each.
    order: [u8; MAX_LEVELS],
    count: usize,
    /// Probability of going on by the sharp lobes.
    going: f32,
}

impl Merged {
    const NOTHING: Merged = Merged { areas: [0.0; MAX_LEVELS], order: [0; MAX_LEVELS], count: 0, going: 1.0 };
}

/// What a camera path knows of its last X.
#[derive(Clone, Copy, Debug)]
pub(super) struct Glints {
    /// At the last vertex that is not a perfect mirror or clear glass.
    here: Merged,
    /// At X, if the path has come from there by a sharp lobe and delta lobes alone since.
    at: Merged,
    /// Cosine over density of the direction in which it has left X.
    onward: f32,
}

impl Glints {
    pub const NONE: Glints = Glints { here: Merged::NOTHING, at: Merged::NOTHING, onward: 0.0 };

    /// At a vertex where nothing is merged, unless [`Glints::merge`] says otherwise.
    #[inline]
    pub fn arrive(&mut self) {
        self.here.count = 0;
    }

    /// Photons of a map are merged at this vertex, from which the path goes on by `onward`, sharp lobes and delta ones,
    /// with a probability.
    #[inline]
    pub fn merge<'s, K: Kernel>(
        &mut self,
        _: K,
        (shading, ng): (&'s Shading<'s>, Vec3),
        (onward, going): (LobeSet, f32),
        radii: &LevelRadii,
        map: &PhotonMap,
    ) -> Merging<'s, K> {
        let paths = map.paths() as f32;
        let count = if map.paths() == 0 { 0 } else { radii.count };
        let radius2 = radii.radius2.map(|radius2| AREA * radius2);
        let areas = radius2.map(|radius2| paths * PI * radius2);
        self.here = Merged { areas, order: radii.order, count, going };
        let reach2 = count.checked_sub(1).map_or(0.0, |last| radius2[last]);
        Merging {
            kernel: std::marker::PhantomData,
            shading,
            ng,
            onward,
            going,
            paths,
            radius2,
            largest: PI * reach2,
            reach2,
            sums: [Rgb::ZERO; MAX_LEVELS],
        }
    }

    /// The path goes on from a vertex.
    #[inline]
    pub fn scatter(&mut self, ng: Vec3, sample: &BsdfSample) {
        if sample.lobe.intersects(LobeSet::SHARP) {
            self.at = self.here;
            self.onward = ng.dot(sample.wi).abs() / (sample.pdf_w * self.here.going);
        } else if sample.lobe != LobeSet::DELTA {
            self.at.count = 0;
        }
    }

    /// Whether photons are merged, too, of the light that the path runs into now.
    #[inline]
    pub fn shared(&self) -> bool {
        self.at.count > 0
    }

    /// Levels, and the weight of this path in each, where it has run into light of some density.
    #[inline]
    pub fn weights(&self, density: &EmissionDensity) -> impl Iterator<Item = (usize, f32)> {
        let density = PhotonFlags::from_area_light(density.ray_density()).density();
        let Merged { areas, order, count, .. } = self.at;
        let onward = self.onward;
        (0..count).map(move |k| (usize::from(order[k]), 1.0 / (1.0 + areas[k] * density * onward)))
    }
}

/// Photons being merged at the sharp lobes of a vertex.
pub(super) struct Merging<'s, K> {
    kernel: std::marker::PhantomData<K>,
    shading: &'s Shading<'s>,
    ng: Vec3,
    onward: LobeSet,
    going: f32,
    paths: f32,
    radius2: [f32; MAX_LEVELS],
    /// Area of the largest kernel.
    largest: f32,
    reach2: f32,
    sums: [Rgb; MAX_LEVELS],
}

impl<K: Kernel> Merging<'_, K> {
    /// Looks at photons as far away as this (squared), although those beyond the kernels bring nothing now.
    #[inline]
    pub fn look_beyond(&mut self, reach2: f32) {
        self.reach2 = self.reach2.max(reach2);
    }

    /// Adds a photon at a distance squared, if it is one of these. Returns what it would bring to the largest kernel
    /// from within, before it is divided by an area.
    #[inline(always)]
    pub fn push(&mut self, photon: &Photon, distance2: f32) -> Rgb {
        if distance2 < self.reach2 && photon.flags.density() > 0.0 { self.add(photon, distance2) } else { Rgb::ZERO }
    }

    #[inline(never)]
    fn add(&mut self, photon: &Photon, distance2: f32) -> Rgb {
        let Merging { shading, ng, onward, .. } = *self;
        let (f, pdf) = shading.evaluate_cos(photon.wi, Transport::Radiance, onward);
        let cosine = photon.cosine();
        let (cos, pdf) = (photon.wi.dot(ng).abs(), pdf * self.going);
        // What is no number goes on, for the sample to be rejected by.
        if pdf <= 0.0 || cosine <= 0.0 || cos <= 0.0 {
            return Rgb::ZERO;
        }
        // Area within which a photon is expected for every camera path.
        let one_each = pdf / (self.paths * photon.flags.density() * cos);
        let light = photon.flux * f / cosine;
        for (sum, radius2) in self.sums.iter_mut().zip(self.radius2) {
            if distance2 < radius2 {
                let kernel = if K::BOX { 1.0 } else { K::weight(distance2 / radius2) };
                // The weight over pi r^2, which is bounded however small the kernel.
                *sum += light * (kernel / (one_each + PI * radius2));
            }
        }
        light * (self.largest / (one_each + self.largest))
    }

    /// Radiance by level, in the order of radii.
    #[inline]
    pub fn finish(self) -> [Rgb; MAX_LEVELS] {
        self.sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::{Bsdf, EnergyTables, Interface, Parameters};
    use crate::math::Frame;
    use crate::photon::kernel;
    use crate::random::{Domain, Purpose, Stream};

    const LEVELS: [f32; 3] = [1e-4, 4e-3, 0.2];
    const PATHS: u32 = 5000;
    const GOING: f32 = 0.6;

    /// For the same path the weights of either strategy sum to one: at all bandwidths, seen from anywhere, of metal and
    /// varnish, with a bent shading normal.
    #[test]
    fn weights_sum_to_one() {
        let tables = EnergyTables::new([1.5]);
        let metal = Parameters {
            base_color: Rgb::splat(0.8),
            metallic: 1.0,
            alpha_x: 0.1,
            alpha_y: 0.05,
            eta: 1.5,
            ..Parameters::default()
        };
        let varnish = Parameters { metallic: 0.0, specular: 1.0, ..metal };
        let onward = LobeSet::SHARP | LobeSet::DELTA;
        let mut least = [1.0f32; 2];
        for parameters in [metal, varnish] {
            let interface = Interface::new(&parameters, &tables);
            let bsdf = Bsdf::new(&parameters, &interface);
            for i in 0..1000 {
                let draws = Stream::new(1, 0, Domain::Test, i).vertex(0);
                let wo = crate::math::warp::hemisphere_cosine(draws.two(Purpose::Pixel));
                let shading = Shading::new(Frame::from_normal(Vec3::new(0.1, 0.0, 1.0).normalize()), Vec3::Z, bsdf, wo);
                let Some(sample) = shading.sample(
                    Transport::Radiance,
                    onward,
                    draws.one(Purpose::Lobe),
                    draws.two(Purpose::Direction),
                ) else {
                    continue;
                };
                let density = 10f32.powf(8.0 * draws.one(Purpose::Lens) - 4.0);
                let density = EmissionDensity {
                    direct: 1.0,
                    start: density,
                    onward: 0.5,
                    cos: 0.7,
                    infinite: false,
                    delta: false,
                };
                let flux = Rgb::ONE;
                let photon = Photon {
                    wi: sample.wi,
                    ng: Vec3::Z,
                    flux,
                    flags: PhotonFlags::from_area_light(density.ray_density()),
                    ..Photon::default()
                };
                let mut glints = Glints::NONE;
                let map = PhotonMap::build(vec![photon]).of_paths(PATHS);
                let radii = LevelRadii::new(LEVELS.into_iter());
                let mut merging = glints.merge(kernel::Box, (&shading, Vec3::Z), (onward, GOING), &radii, &map);
                merging.push(&photon, 0.0);
                let merged = merging.finish();
                let found = sample.wi.z.abs().recip() * shading.eval_cos(sample.wi, Transport::Radiance, onward);
                glints.scatter(Vec3::Z, &sample);
                let weights: Vec<(usize, f32)> = glints.weights(&density).collect();
                assert_eq!(weights.len(), LEVELS.len());
                for ((level, weight), radius2) in weights.into_iter().zip(LEVELS) {
                    let other = (merged[level] * (PI * AREA * radius2) / found).x;
                    assert!((weight + other - 1.0).abs() < 1e-4, "{weight} {other}");
                    least = [least[0].min(weight), least[1].min(other)];
                }
            }
        }
        assert!(least[0] < 0.01 && least[1] < 0.01, "{least:?}");
    }

    /// Photons bring nothing where nobody knows how many to expect.
    #[test]
    fn unknown_photons_are_not_merged() {
        let mut glints = Glints::NONE;
        let tables = EnergyTables::new([1.5]);
        let parameters = Parameters { metallic: 1.0, alpha_x: 0.1, alpha_y: 0.1, ..Parameters::default() };
        let interface = Interface::new(&parameters, &tables);
        let shading = Shading::new(Frame::from_normal(Vec3::Z), Vec3::Z, Bsdf::new(&parameters, &interface), Vec3::Z);
        let known = Photon {
            wi: Vec3::Z,
            ng: Vec3::Z,
            flux: Rgb::ONE,
            flags: PhotonFlags::from_area_light(1.0),
            ..Photon::default()
        };
        for (photon, paths, merges) in
            [(known, PATHS, true), (known, 0, false), (Photon { flags: PhotonFlags::default(), ..known }, PATHS, false)]
        {
            let map = PhotonMap::build(vec![photon]).of_paths(paths);
            let radii = LevelRadii::new(LEVELS.into_iter());
            let mut merging = glints.merge(kernel::Box, (&shading, Vec3::Z), (LobeSet::SHARP, GOING), &radii, &map);
            merging.push(&photon, 0.0);
            assert_eq!(merging.finish()[0].x > 0.0, merges);
        }
    }

    /// Powers of two stay, others are rounded down, what is beyond the range is at its ends; no density is taken for
    /// none or for a delta light.
    #[test]
    fn densities_are_known_to_a_factor_of_two() {
        for exponent in -62..63 {
            let density = 2f32.powi(exponent);
            assert_eq!(PhotonFlags::from_area_light(density).density(), density);
            assert_eq!(PhotonFlags::from_area_light(1.999 * density).density(), density);
        }
        for extreme in [0.0, f32::MIN_POSITIVE, 1e30, f32::INFINITY] {
            let flags = PhotonFlags::from_area_light(extreme);
            assert!(flags.density() > 0.0 && flags != PhotonFlags::UNREACHABLE && flags != PhotonFlags::default());
        }
        assert_eq!(PhotonFlags::UNREACHABLE.density(), 0.0);
        assert_eq!(PhotonFlags::default().density(), 0.0);
    }
}
