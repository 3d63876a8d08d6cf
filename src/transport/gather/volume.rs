//! Photon gathering in media.
//!
//! A photon carries flux times length, so the sum over the photons of a ball, divided by its volume, is the fluence.
//! The vertex of the camera path multiplies it by the scattering coefficient and the phase function \[Jensen and
//! Christensen 1998, "Efficient simulation of light transport in scenes with participating media using photon maps",
//! (10), with the coefficient moved from the photon to the vertex\].

use crate::math::Rgb;
use crate::photon::{Kernel, NO_NORMAL, Near, PhotonMap, VolumePhoton};
use crate::transport::walk::pixel_sample::MAX_LEVELS;
use crate::transport::walk::vertex::MediumVertex;
use std::f32::consts::FRAC_1_PI;

/// The photons in media, and the bandwidths of the bandwidth levels of a camera path.
#[derive(Clone, Copy)]
pub struct Volume<'a> {
    photons: &'a PhotonMap<VolumePhoton>,
    /// Squared bandwidths of the bandwidth levels, in any order.
    bandwidth2: [f32; MAX_LEVELS],
    count: usize,
}

impl<'a> Volume<'a> {
    /// Takes the bandwidths of at most [`MAX_LEVELS`] bandwidth levels, in the order in which results are
    /// returned.
    #[inline]
    pub fn new(photons: &'a PhotonMap<VolumePhoton>, bandwidths: impl Iterator<Item = f32>) -> Volume<'a> {
        let mut volume = Volume { photons, bandwidth2: [0.0; MAX_LEVELS], count: 0 };
        for bandwidth in bandwidths.take(MAX_LEVELS) {
            volume.bandwidth2[volume.count] = bandwidth * bandwidth;
            volume.count += 1;
        }
        volume
    }

    /// Squared bandwidths of the bandwidth levels, in the order in which results are returned.
    #[inline]
    pub(in crate::transport) fn bandwidths2(&self) -> &[f32] {
        &self.bandwidth2[..self.count]
    }

    /// Radiance by level that the photons in `medium` scatter at `vertex`, from one query: kernel density estimation
    /// over balls, with `3 / (4 pi r^3)` as the box kernel. Photons of more than `longest` segments are skipped.
    #[inline]
    pub(in crate::transport) fn gather(
        &self,
        kernel: Kernel,
        near: &mut Near<VolumePhoton>,
        vertex: &MediumVertex,
        medium: u32,
        longest: u32,
    ) -> [Rgb; MAX_LEVELS] {
        let mut sums = [Rgb::ZERO; MAX_LEVELS];
        let bandwidth2 = self.bandwidths2();
        let largest2 = bandwidth2.iter().fold(0.0, |largest: f32, &bandwidth2| largest.max(bandwidth2));
        let phase = vertex.phase();
        self.photons.gather(near, vertex.arrival.p, NO_NORMAL, largest2, |photon, distance2| {
            if photon.medium != medium || u32::from(photon.depth) > longest {
                return;
            }
            let meets = vertex
                .wavelength
                .as_ref()
                .map_or(Some(Rgb::ONE), |wavelength| wavelength.connection_factor(photon.band));
            let Some(weight) = meets else { return };
            let light = photon.flux * weight * phase.pdf_w(vertex.wo, photon.wi);
            for (sum, &bandwidth2) in sums.iter_mut().zip(bandwidth2) {
                if distance2 < bandwidth2 {
                    *sum += light * kernel.ball_weight(distance2 / bandwidth2);
                }
            }
        });
        for (sum, bandwidth2) in sums.iter_mut().zip(bandwidth2) {
            *sum *= vertex.throughput * (0.75 * FRAC_1_PI / (bandwidth2 * bandwidth2.sqrt()));
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::medium::{FlightDensity, MediumParameters};
    use crate::random::{Domain, Purpose, Stream};
    use crate::spectrum::Band;
    use crate::transport::{Interior, MediumArrival};

    const PHOTONS: u64 = 40_000;

    fn photon(i: u64, medium: u32) -> VolumePhoton {
        let draws = Stream::new(17, 0, Domain::Test, i).vertex(medium);
        let (u, v) = (draws.two(Purpose::Pixel), draws.one(Purpose::Lobe));
        let wi = crate::math::warp::sphere_uniform(draws.two(Purpose::Direction));
        VolumePhoton {
            p: Vec3::new(u.x, u.y, v),
            wi,
            flux: Rgb::ONE / PHOTONS as f32,
            medium,
            depth: 2 + (i % 2) as u16,
            band: Band::WHITE,
        }
    }

    fn vertex() -> MediumVertex {
        let medium = MediumParameters { sigma_a: Rgb::ZERO, sigma_s: Rgb::ONE, g: 0.3 };
        let (interior, first) = (Interior::default(), None);
        let met = MediumArrival { p: Vec3::splat(0.5), medium, interior, weight: Rgb::ONE, distance: 1.0, first };
        MediumVertex {
            arrival: met,
            wo: Vec3::Y,
            throughput: Rgb::new(1.0, 2.0, 0.5),
            arriving: Rgb::ONE,
            depth: 1,
            from: Vec3::ZERO,
            draws: Stream::new(0, 0, Domain::Test, 0).vertex(0),
            flight: FlightDensity::ONE,
            opacity: 1.0,
            next_event: 1.0,
            wavelength: None,
            share: 1.0,
            survival_scale: 1.0,
        }
    }

    /// Largest deviation, in standard errors, from the result for a uniform field, over levels and path lengths. A unit
    /// of flux times length, spread evenly over the unit cube and over all directions, is a fluence of 1. A normalised
    /// phase function scatters 1 / (4 pi) of it into every direction, for all bandwidths and orders of levels.
    /// `roughness` is the integral of the squared kernel over that of the box; `fault` is a factor of the result.
    fn deviation(map: &PhotonMap<VolumePhoton>, kernel: Kernel, roughness: f32, fault: f32) -> f32 {
        let bandwidths = [0.4f32, 0.1, 0.2, 0.15, 0.3];
        let volume = Volume::new(map, bandwidths.into_iter());
        let mut worst = 0f32;
        for longest in [2, 3] {
            let found = volume.gather(kernel, &mut Near::default(), &vertex(), 7, longest);
            // Half of the photons have two segments, half three.
            let share = 0.5 * (longest - 1) as f32;
            for (found, bandwidth) in found.into_iter().zip(bandwidths) {
                let ball = 4.0 / 3.0 * std::f32::consts::PI * bandwidth.powi(3);
                // Weights by the phase function with g = 0.3 vary: their mean square is (1 + g^2) / (1 - g^2)^2 in
                // units of the mean.
                let error = (1.32 * roughness / (PHOTONS as f32 * ball * share)).sqrt();
                let ratio = found * fault * 4.0 * std::f32::consts::PI / (share * vertex().throughput);
                worst = worst.max((ratio - Rgb::ONE).abs().max_element() / error);
            }
        }
        worst
    }

    /// Ten checks for each of three kernels, at 5 sigma of the Poisson counts: the rate of false alarms is below 2e-5.
    #[test]
    fn an_even_field_is_measured_without_bias() {
        let map =
            PhotonMap::build((0..PHOTONS).map(|i| photon(i, 7)).chain((0..PHOTONS).map(|i| photon(i, 8))).collect());
        let kernels = [(Kernel::Box, 1.0), (Kernel::Epanechnikov, 10.0 / 7.0), (Kernel::Gaussian, 2.69)];
        let right = kernels.map(|(kernel, roughness)| deviation(&map, kernel, roughness, 1.0));
        assert!(right.iter().all(|&worst| worst < 5.0), "{right:?}");
        let of_disc = |kernel: Kernel| kernel.weight(0.0) / kernel.ball_weight(0.0);
        let flat =
            [kernels[1], kernels[2]].map(|(kernel, roughness)| deviation(&map, kernel, roughness, of_disc(kernel)));
        assert!(flat.iter().all(|&worst| worst > 5.0), "a disc's normalisation goes unnoticed: {flat:?}");
    }
}
