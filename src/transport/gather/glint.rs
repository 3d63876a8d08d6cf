//! Glints: light of lights with a size that perfect mirrors and clear glass send to the sharp lobes of a vertex X.
//! Continued camera paths find it, and so do photons, each well where the other does not. One camera path in thousands
//! hits a bulb behind glass that a varnished door reflects, which makes a bright spot; the photons around X find it
//! reliably. A sharp highlight is found by every other camera path, and photons would blur it.
//!
//! The balance heuristic weighs both, as vertex merging and unidirectional sampling in \[Georgiev et al. 2012, (10)\]. A
//! camera path leaves X along a direction with density `pdf` per solid angle. Light paths leave the light along the same
//! line with density e per area facing it and per solid angle. Mirrors and clear glass keep the product of area and solid
//! angle, so light paths arrive at X with density `e cos` per area and solid angle. Of n light paths there are
//!
//! `n pi r^2 e cos / pdf`
//!
//! photons within the bandwidth r around X for every camera path. The contribution of one of them is bounded, however small
//! r is. Both sides must compute the same weight for a path, so both use e rounded down to a power of two
//! ([`PhotonFlags::density`]).

use super::bandwidths::LevelBandwidths;
use crate::bsdf::{BsdfSample, LobeSet, Shading, Transport};
use crate::light::EmissionDensity;
use crate::math::{Rgb, Vec3};
use crate::photon::{Kernel, Photon, PhotonFlags, PhotonMap};
use crate::transport::walk::pixel_sample::MAX_LEVELS;
use std::f32::consts::PI;

/// The lobes by which a path may continue, and the probability that it does.
#[derive(Clone, Copy, Debug)]
pub(in crate::transport) struct Onward {
    pub lobes: LobeSet,
    pub probability: f32,
}

/// Kernel area for glints, light that both photons and camera paths find at sharp lobes, over the kernel area of other
/// photons. It is smaller because photons are only one of two techniques here.
const AREA_RATIO: f32 = 1.0 / 4.0;

/// At one vertex, number of light paths times kernel area, `n pi r^2`, for each bandwidth level.
#[derive(Clone, Copy, Debug)]
struct MergeAreas {
    areas: [f32; MAX_LEVELS],
    /// The bandwidth level of each area.
    order: [u8; MAX_LEVELS],
    /// Number of areas; 0 where no photons are gathered.
    count: usize,
    /// Probability that the path continues by the sharp lobes.
    going: f32,
}

impl MergeAreas {
    const NONE: MergeAreas = MergeAreas { areas: [0.0; MAX_LEVELS], order: [0; MAX_LEVELS], count: 0, going: 1.0 };
}

/// State of a camera path from which the MIS weights of glints follow: light that both photons and the path find at a
/// sharp lobe.
#[derive(Clone, Copy, Debug)]
pub(in crate::transport) struct Glints {
    /// Kernel areas at the last vertex that is not a perfect mirror or clear glass.
    here: MergeAreas,
    /// Kernel areas at X, the last vertex that the path left by a sharp lobe, if it has met delta lobes only since.
    at: MergeAreas,
    /// Cosine over probability density of the direction in which the path left X.
    onward: f32,
}

impl Glints {
    pub const NONE: Glints = Glints { here: MergeAreas::NONE, at: MergeAreas::NONE, onward: 0.0 };

    /// Notes that the path arrives at a vertex. Glints are not gathered there unless [`Glints::gather`] is called.
    #[inline]
    pub fn arrive(&mut self) {
        self.here.count = 0;
    }

    /// Starts to gather photons of `map` at the sharp lobes of this vertex. The path continues by `onward`, its sharp and
    /// delta lobes.
    #[inline]
    pub fn gather<'s>(
        &mut self,
        kernel: Kernel,
        shading: &'s Shading<'s>,
        ng: Vec3,
        onward: Onward,
        bandwidths: &LevelBandwidths,
        map: &PhotonMap,
    ) -> GlintGather<'s> {
        let paths = map.paths() as f32;
        let count = if map.paths() == 0 { 0 } else { bandwidths.count };
        let bandwidth2 = bandwidths.bandwidth2.map(|bandwidth2| AREA_RATIO * bandwidth2);
        let areas = bandwidth2.map(|bandwidth2| paths * PI * bandwidth2);
        self.here = MergeAreas { areas, order: bandwidths.order, count, going: onward.probability };
        let reach2 = count.checked_sub(1).map_or(0.0, |last| bandwidth2[last]);
        GlintGather {
            kernel,
            shading,
            ng,
            onward,
            paths,
            bandwidth2,
            largest: PI * reach2,
            reach2,
            sums: [Rgb::ZERO; MAX_LEVELS],
            divided: None,
            transmitted: Rgb::ZERO,
        }
    }

    /// Notes that the path leaves a vertex with geometric normal `ng` along `sample`.
    #[inline]
    pub fn scatter(&mut self, ng: Vec3, sample: &BsdfSample) {
        if sample.lobe.intersects(LobeSet::SHARP) {
            self.at = self.here;
            self.onward = ng.dot(sample.wi).abs() / (sample.pdf_w * self.here.going);
        } else if sample.lobe != LobeSet::DELTA {
            self.at.count = 0;
        }
    }

    /// Whether photons also find the light that the camera path hits now, so that its weight is below 1.
    #[inline]
    pub fn are_shared(&self) -> bool {
        self.at.count > 0
    }

    /// For a camera path that hits a light with this density of emission: each bandwidth level and the MIS weight of
    /// the path there.
    #[inline]
    pub fn path_weights(&self, density: &EmissionDensity) -> impl Iterator<Item = (usize, f32)> {
        let density = PhotonFlags::from_area_light(density.ray_density()).density();
        let MergeAreas { areas, order, count, .. } = self.at;
        let onward = self.onward;
        (0..count).map(move |k| (usize::from(order[k]), 1.0 / (1.0 + areas[k] * density * onward)))
    }
}

/// Sums of the photons gathered at the sharp lobes of one vertex.
pub(in crate::transport) struct GlintGather<'s> {
    kernel: Kernel,
    shading: &'s Shading<'s>,
    ng: Vec3,
    onward: Onward,
    paths: f32,
    bandwidth2: [f32; MAX_LEVELS],
    /// Area of the largest gathering kernel (square scene units).
    largest: f32,
    /// Squared bandwidth within which photons are evaluated (square scene units).
    reach2: f32,
    sums: [Rgb; MAX_LEVELS],
    /// Index of the bandwidth whose light is also recorded as reflected and transmitted light; `None` without such layers.
    divided: Option<usize>,
    /// Transmitted light of that bandwidth.
    transmitted: Rgb,
}

impl GlintGather<'_> {
    /// Divides the light of the bandwidth number `index` into reflected and transmitted light.
    #[inline]
    pub fn divide(&mut self, index: Option<usize>) {
        self.divided = index;
    }

    /// Radiance so far by bandwidth level, in the order of bandwidths.
    #[inline]
    pub fn sums(&self) -> &[Rgb; MAX_LEVELS] {
        &self.sums
    }

    /// Transmitted light of the divided bandwidth.
    #[inline]
    pub fn transmitted(&self) -> Rgb {
        self.transmitted
    }

    /// Evaluates photons up to this squared distance, for bandwidth rules that count beyond the kernels.
    #[inline]
    pub fn extend_reach(&mut self, reach2: f32) {
        self.reach2 = self.reach2.max(reach2);
    }

    /// Adds a photon at this squared distance, if it came from a light with a size by delta bounces only. Returns its
    /// light within the largest kernel, before division by an area.
    #[inline(always)]
    pub fn push(&mut self, photon: &Photon, distance2: f32) -> Rgb {
        if distance2 < self.reach2 && photon.flags.density() > 0.0 { self.add(photon, distance2) } else { Rgb::ZERO }
    }

    #[inline(never)]
    fn add(&mut self, photon: &Photon, distance2: f32) -> Rgb {
        let GlintGather { shading, ng, onward, .. } = *self;
        let (f, pdf) = shading.evaluate_cos(photon.wi, Transport::Radiance, onward.lobes);
        let cosine = photon.cosine();
        let (cos, pdf) = (photon.wi.dot(ng).abs(), pdf * onward.probability);
        // NaN fails these tests and goes on, so that the sample is rejected.
        if pdf <= 0.0 || cosine <= 0.0 || cos <= 0.0 {
            return Rgb::ZERO;
        }
        // Area in which one photon is expected for every camera path.
        let area_per_photon = pdf / (self.paths * photon.flags.density() * cos);
        let light = photon.flux * f / cosine;
        for (sum, bandwidth2) in self.sums.iter_mut().zip(self.bandwidth2) {
            if distance2 < bandwidth2 {
                let kernel = self.kernel.weight(distance2 / bandwidth2);
                // The weight over pi r^2; bounded however small the kernel is.
                *sum += light * (kernel / (area_per_photon + PI * bandwidth2));
            }
        }
        if let Some(bandwidth2) = self.divided.map(|index| self.bandwidth2[index])
            && distance2 < bandwidth2
            && shading.transmits_to(photon.wi)
        {
            let kernel = self.kernel.weight(distance2 / bandwidth2);
            self.transmitted += light * (kernel / (area_per_photon + PI * bandwidth2));
        }
        light * (self.largest / (area_per_photon + self.largest))
    }

    /// Radiance from the gathered photons by bandwidth level, in the order of bandwidths.
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
    use crate::random::{Domain, Purpose, Stream};

    const LEVELS: [f32; 3] = [1e-4, 4e-3, 0.2];
    const PATHS: u32 = 5000;
    const GOING: f32 = 0.6;

    /// The weights of both techniques sum to one for a path: at all bandwidths, view directions, for metal and varnish,
    /// with a tilted shading normal.
    #[test]
    fn weights_of_paths_and_photons_sum_to_one() {
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
        let lobes = LobeSet::SHARP | LobeSet::DELTA;
        let onward = Onward { lobes, probability: GOING };
        let mut least = [1.0f32; 2];
        for parameters in [metal, varnish] {
            let interface = Interface::new(&parameters, &tables);
            let bsdf = Bsdf::new(&parameters, &interface);
            for i in 0..1000 {
                let draws = Stream::new(1, 0, Domain::Test, i).vertex(0);
                let wo = crate::math::warp::hemisphere_cosine(draws.two(Purpose::Pixel));
                let shading = Shading::new(Frame::from_normal(Vec3::new(0.1, 0.0, 1.0).normalize()), Vec3::Z, bsdf, wo);
                let Some(sample) =
                    shading.sample(Transport::Radiance, lobes, draws.one(Purpose::Lobe), draws.two(Purpose::Direction))
                else {
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
                let bandwidths = LevelBandwidths::new(LEVELS.into_iter());
                let mut merging = glints.gather(Kernel::Box, &shading, Vec3::Z, onward, &bandwidths, &map);
                merging.push(&photon, 0.0);
                let merged = merging.finish();
                let found = sample.wi.z.abs().recip() * shading.eval_cos(sample.wi, Transport::Radiance, lobes);
                glints.scatter(Vec3::Z, &sample);
                let weights: Vec<(usize, f32)> = glints.path_weights(&density).collect();
                assert_eq!(weights.len(), LEVELS.len());
                for ((level, weight), bandwidth2) in weights.into_iter().zip(LEVELS) {
                    let other = (merged[level] * (PI * AREA_RATIO * bandwidth2) / found).x;
                    assert!((weight + other - 1.0).abs() < 1e-4, "{weight} {other}");
                    least = [least[0].min(weight), least[1].min(other)];
                }
            }
        }
        assert!(least[0] < 0.01 && least[1] < 0.01, "{least:?}");
    }

    /// Photons contribute only if the number of light paths and the density of emission are known.
    #[test]
    fn photons_of_unknown_density_are_not_gathered() {
        let mut glints = Glints::NONE;
        let tables = EnergyTables::new([1.5]);
        let parameters = Parameters { metallic: 1.0, alpha_x: 0.1, alpha_y: 0.1, ..Parameters::default() };
        let interface = Interface::new(&parameters, &tables);
        let shading = Shading::new(Frame::from_normal(Vec3::Z), Vec3::Z, Bsdf::new(&parameters, &interface), Vec3::Z);
        let sharp = Onward { lobes: LobeSet::SHARP, probability: GOING };
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
            let bandwidths = LevelBandwidths::new(LEVELS.into_iter());
            let mut merging = glints.gather(Kernel::Box, &shading, Vec3::Z, sharp, &bandwidths, &map);
            merging.push(&photon, 0.0);
            assert_eq!(merging.finish()[0].x > 0.0, merges);
        }
    }

    /// Powers of two are exact, other densities are rounded down and clamped to the range; none is taken for zero or for
    /// a delta light.
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
