//! One iteration of path tracing. No light arrives in another pixel than its path's, so a pixel's measure is added at
//! once, and none is kept.

use super::clock::cpu_seconds;
use super::iterate::{Iterate, Work};
use super::result::Phases;
use super::settings::Settings;
use super::techniques::{TechniquePicture, Watch, Watched};
use super::tiles::Tiles;
use crate::estimator::Pixel;
use crate::random::{Domain, Streams};
use crate::transport::{Eye, EyeMeasure, path_measure};
use bumpalo::Bump;
use rayon::prelude::*;

/// The passes of a render.
pub(super) struct Paths<'a> {
    eye: Eye<'a>,
    settings: &'a Settings,
    tiles: Tiles,
    watched: Watched,
}

impl<'a> Paths<'a> {
    /// Nothing done yet.
    pub fn new(eye: Eye<'a>, settings: &'a Settings) -> Paths<'a> {
        let tiles = Tiles::new(eye.camera);
        Paths { eye, settings, tiles, watched: Watched::new(settings, eye.scene, &tiles) }
    }

    /// Adds iteration `i` (from 1) to all pixels.
    fn pass<W: Watch>(&self, i: u64, pixels: &mut [Pixel], watches: &mut [W]) {
        let (eye, tiles) = (self.eye, self.tiles);
        let streams = Streams::in_sequence(self.settings.seed, i, Domain::EyeIndependent);
        let parts = tiles.cut(pixels).into_par_iter().zip(watches);
        parts.enumerate().for_each(|(tile, (mut pixels, watch))| {
            let mut arena = Bump::new();
            for places in tiles.groups(tile) {
                let starts = eye.starts(&places, streams);
                for (place, start) in places.iter().flatten().zip(starts.iter().flatten()) {
                    arena.reset();
                    watch.begin(place.at, Some(0));
                    let mut measure = EyeMeasure::default();
                    path_measure(&eye, &arena, start, watch, &mut measure);
                    let pixel = pixels.at(place.at);
                    pixel.see(i, || eye.seen(&measure));
                    pixel.add_with_groups(i, &measure, None, watch.groups(place.at));
                }
            }
        });
    }
}

impl Iterate for Paths<'_> {
    fn pixels(&mut self) -> Vec<Pixel> {
        self.settings.pixels(self.eye.scene, self.eye.camera)
    }

    fn iterate(&mut self, i: u64, pixels: &mut [Pixel], phases: &mut Phases) -> Work {
        let start = cpu_seconds();
        let mut watched = std::mem::take(&mut self.watched);
        match watched.begin() {
            Some(watches) => self.pass(i, pixels, watches),
            None => self.pass(i, pixels, &mut vec![(); self.tiles.count()]),
        }
        self.watched = watched;
        phases.eye += cpu_seconds() - start;
        Work { light_paths: 0, photons: 0, rejected: 0 }
    }

    fn techniques(&mut self, iterations: u64) -> Vec<TechniquePicture> {
        self.watched.collect(&self.tiles, iterations)
    }
}
