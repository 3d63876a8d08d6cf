//! Photon maps of an iteration, and what media add to them: a map of photons in media, with its own bandwidths.

use super::photon_counts::PhotonCounts;
use crate::camera::GROUP_SIZE;
use crate::estimator::{PixelAccumulator, Schedule};
use crate::photon::{PhotonMap, PhotonMaps, VolumePhoton};
use crate::render::settings::Settings;
use crate::spectrum::IterationWavelengths;
use crate::transport::{CameraPathStart, Volume};

/// Photon maps of an iteration: photons on surfaces and in media.
pub(super) struct Maps {
    /// Map of the photons on surfaces.
    pub surface: PhotonMaps,
    /// Map of the photons in media; `None` if the scene has no scattering media.
    pub volume: Option<VolumeMap>,
    /// Wavelengths that the light paths of the iteration have used.
    pub wavelengths: IterationWavelengths,
    /// Number of light paths that ended because they were not finite.
    pub lost: u64,
}

impl Maps {
    /// Number of photons on surfaces and in media.
    pub fn len(&self) -> usize {
        let surface: usize = self.surface.iter().map(|map| map.photons().len()).sum();
        surface + self.volume.as_ref().map_or(0, |volume| volume.map.photons().len())
    }

    /// Number of photons on surfaces by kind (caustic, indirect); none is counted as gathered yet.
    pub fn counts(&self) -> PhotonCounts {
        let stored = self.surface.each_ref().map(|map| map.photons().len() as u64);
        PhotonCounts { stored, ..PhotonCounts::default() }
    }

    /// Number of photons and light paths that were rejected because they were not finite.
    pub fn rejected(&self) -> u64 {
        let surface: u64 = self.surface.iter().map(PhotonMap::rejected).sum();
        self.lost + surface + self.volume.as_ref().map_or(0, |volume| volume.map.rejected())
    }

    /// Sets the wavelengths of camera paths to those of the light paths.
    #[inline]
    pub fn tune(&self, mut starts: [Option<CameraPathStart>; GROUP_SIZE]) -> [Option<CameraPathStart>; GROUP_SIZE] {
        for CameraPathStart { ray, .. } in starts.iter_mut().flatten() {
            ray.wavelength_sample = self.wavelengths.nearest(ray.wavelength_sample);
        }
        starts
    }

    /// The photons in media, with the bandwidths of some bandwidth levels of `pixel`; `None` without scattering
    /// media.
    #[inline]
    pub fn volume(&self, pixel: &PixelAccumulator, levels: impl Iterator<Item = usize>) -> Option<Volume<'_>> {
        let VolumeMap { map, schedule } = self.volume.as_ref()?;
        Some(Volume::new(map, levels.map(|level| schedule.volume_bandwidth(pixel.volume_bandwidth, level))))
    }
}

/// Map of the photons in media, and the schedule by which their bandwidths shrink.
pub(super) struct VolumeMap {
    map: PhotonMap<VolumePhoton>,
    schedule: Schedule,
}

impl VolumeMap {
    /// Builds the map of photons in media for iteration `i`.
    pub fn new(photons: Vec<VolumePhoton>, i: u64, settings: &Settings) -> VolumeMap {
        VolumeMap { map: PhotonMap::build(photons), schedule: settings.schedule(i) }
    }
}
