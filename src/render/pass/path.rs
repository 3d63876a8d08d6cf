//! One iteration of path tracing.

use super::integrator::{Integrator, Work};
use super::sample_buffer::{self, SampleBuffer};
use super::techniques::{TechniquePicture, Watch, Watched};
use super::tiles::{TILE_PIXELS, Tiles};
use crate::estimator::PixelAccumulator;
use crate::random::{Domain, Streams};
use crate::render::clock::Phases;
use crate::render::clock::cpu_seconds;
use crate::render::settings::Settings;
use crate::transport::{CameraPaths, PixelSample, path_sample};
use bumpalo::Bump;
use rayon::prelude::*;

/// The passes of a render.
pub(super) struct Paths<'a> {
    camera_paths: CameraPaths<'a>,
    settings: &'a Settings,
    tiles: Tiles,
    samples: [SampleBuffer; 1],
    watched: Watched,
}

impl<'a> Paths<'a> {
    /// Nothing done yet.
    pub fn new(camera_paths: CameraPaths<'a>, settings: &'a Settings) -> Paths<'a> {
        let tiles = Tiles::new(camera_paths.camera);
        let samples = [SampleBuffer::new(tiles.count() * TILE_PIXELS, 1)];
        Paths { camera_paths, settings, tiles, samples, watched: Watched::new(settings, camera_paths.scene, &tiles) }
    }

    /// Adds iteration `i` (from 1) to all pixels; false where it was given up.
    fn pass<W: Watch>(&mut self, i: u64, pixels: &mut [PixelAccumulator], watches: &mut [W]) -> bool {
        let (camera_paths, tiles) = (self.camera_paths, self.tiles);
        let streams = Streams::in_sequence(self.settings.seed, i, Domain::CameraIndependent);
        let parts = self.samples[0].par_tiles().zip(watches.par_iter_mut());
        parts.enumerate().for_each(|(tile, (mut samples, watch))| {
            let (mut arena, mut sample) = (Bump::new(), PixelSample::default());
            for places in tiles.groups(tile) {
                if camera_paths.is_given_up() {
                    return;
                }
                let starts = camera_paths.starts(&places, streams);
                for (place, start) in places.iter().flatten().zip(starts.iter().flatten()) {
                    arena.reset();
                    watch.begin(place.at, Some(0));
                    path_sample(&camera_paths, &arena, start, watch, &mut sample);
                    samples.set(place.at, &sample);
                }
            }
        });
        if self.settings.stop.aborted() {
            return false;
        }
        let groups = |slot: usize| watches[slot / TILE_PIXELS].groups(slot % TILE_PIXELS);
        sample_buffer::add(&self.samples, (&camera_paths, i), pixels, |index| tiles.slot(index as u32), groups);
        true
    }
}

impl Integrator for Paths<'_> {
    fn pixels(&mut self) -> Vec<PixelAccumulator> {
        self.settings.initial_pixels(self.camera_paths.scene, self.camera_paths.camera)
    }

    fn iterate(&mut self, i: u64, pixels: &mut [PixelAccumulator], phases: &mut Phases) -> Option<Work> {
        let start = cpu_seconds();
        let mut watched = std::mem::take(&mut self.watched);
        let done = match watched.begin() {
            Some(watches) => self.pass(i, pixels, watches),
            None => self.pass(i, pixels, &mut vec![(); self.tiles.count()]),
        };
        self.watched = watched;
        phases.eye += cpu_seconds() - start;
        done.then_some(Work::default())
    }

    fn techniques(&mut self, iterations: u64) -> Vec<TechniquePicture> {
        self.watched.collect(&self.tiles, iterations)
    }
}
