//! Path tracing.

use super::integrator::{Integrator, Work};
use super::sample_buffer::{self, SampleBuffer};
use super::techniques::{FilmRecorder, TechniquePicture, TileRecorder};
use super::tiles::{TILE_PIXELS, Tiles};
use crate::estimator::PixelAccumulator;
use crate::random::{Domain, Streams};
use crate::render::clock::{Phases, cpu_seconds};
use crate::render::input::RenderInput;
use crate::transport::{PixelSample, path_sample};
use bumpalo::Bump;
use rayon::prelude::*;

/// Integrator of path tracing.
pub(super) struct Paths {
    tiles: Tiles,
    samples: [SampleBuffer; 1],
    recorder: FilmRecorder,
}

impl Paths {
    pub fn new(RenderInput { scene, camera, settings, .. }: &RenderInput<'_>) -> Paths {
        let tiles = Tiles::new(camera);
        let samples = [SampleBuffer::new(tiles.count() * TILE_PIXELS, 1)];
        Paths { tiles, samples, recorder: FilmRecorder::new(settings, scene, &tiles) }
    }

    /// Adds iteration `i` (from 1) to all pixels; false if the iteration was aborted.
    fn pass<W: TileRecorder>(
        &mut self,
        input: &RenderInput<'_>,
        i: u64,
        pixels: &mut [PixelAccumulator],
        recorders: &mut [W],
    ) -> bool {
        let (camera_paths, tiles) = (input.camera_paths(), self.tiles);
        let streams = Streams::in_sequence(input.settings.seed, i, Domain::CameraIndependent);
        let parts = self.samples[0].par_tiles().zip(recorders.par_iter_mut());
        parts.enumerate().for_each(|(tile, (mut samples, tile_recorder))| {
            let (mut arena, mut sample) = (Bump::new(), PixelSample::default());
            for places in tiles.film_blocks(tile) {
                if camera_paths.is_given_up() {
                    return;
                }
                let starts = camera_paths.starts(&places, streams);
                for (place, start) in places.iter().flatten().zip(starts.iter().flatten()) {
                    arena.reset();
                    tile_recorder.select_pixel(place.at, Some(0));
                    path_sample(&camera_paths, &arena, start, tile_recorder, &mut sample);
                    samples.set(place.at, &sample);
                }
            }
        });
        if input.settings.stop.aborted() {
            return false;
        }
        let groups = |slot: usize| recorders[slot / TILE_PIXELS].group_light(slot % TILE_PIXELS);
        sample_buffer::add(&self.samples, &camera_paths, i, pixels, |index| tiles.slot(index as u32), groups);
        true
    }
}

impl Integrator for Paths {
    fn pixels(&mut self, input: &RenderInput<'_>) -> Vec<PixelAccumulator> {
        input.initial_pixels()
    }

    fn iterate(
        &mut self,
        input: &RenderInput<'_>,
        i: u64,
        pixels: &mut [PixelAccumulator],
        phases: &mut Phases,
    ) -> Option<Work> {
        let start = cpu_seconds();
        let mut recorder = std::mem::take(&mut self.recorder);
        let done = match recorder.start_iteration() {
            Some(recorders) => self.pass(input, i, pixels, recorders),
            None => self.pass(input, i, pixels, &mut vec![(); self.tiles.count()]),
        };
        self.recorder = recorder;
        phases.eye += cpu_seconds() - start;
        done.then_some(Work::default())
    }

    fn techniques(&mut self, iterations: u64) -> Vec<TechniquePicture> {
        self.recorder.take_pictures(&self.tiles, iterations)
    }
}
