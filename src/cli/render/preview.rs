//! `--preview`: shows the picture while it renders, in a file that is rewritten every few seconds, or in a running tev.

use crate::cli::output::{self, PictureArgs};
use crate::cli::say;
use caustique::error::{Error, ErrorKind, Result};
use caustique::film::LayerSet;
use caustique::image::exr::{self, Attributes, Compression, Frame};
use caustique::image::png;
use caustique::render::Clock;
use caustique::scene::description::PictureDefaults;
use serde::Serialize;
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

/// Smallest number of seconds between two previews.
const MIN_INTERVAL: f64 = 2.0;
/// Ratio of the time between two previews to the time that one takes, so that previews take at most a tenth of the
/// render.
const INTERVAL_RATIO: f64 = 10.0;
/// Address (host and port) at which the viewer tev listens.
const TEV_ADDRESS: &str = "127.0.0.1:14158";

/// Where previews of an unfinished render are shown.
#[derive(Clone, Debug, Serialize)]
pub enum Target {
    /// Previews go to an sRGB file with the look of the PNG.
    Png(PathBuf),
    /// Previews go to a file with scene-linear Rec. 709 radiance and alpha.
    Exr(PathBuf),
    /// Previews go to the viewer tev on this machine.
    Tev,
}

impl FromStr for Target {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Target, String> {
        let path = PathBuf::from(text);
        let extension = path.extension().map(|extension| extension.to_ascii_lowercase());
        match extension.as_deref().and_then(|extension| extension.to_str()) {
            Some("png") => Ok(Target::Png(path)),
            Some("exr") => Ok(Target::Exr(path)),
            _ if text == "tev" => Ok(Target::Tev),
            _ => Err("a file that ends in .png or .exr, or 'tev'".into()),
        }
    }
}

impl Target {
    /// Path of the preview's file; `None` for the viewer.
    pub fn file(&self) -> Option<&std::path::Path> {
        match self {
            Target::Png(path) | Target::Exr(path) => Some(path),
            Target::Tev => None,
        }
    }

    /// Checks that previews can be written.
    ///
    /// # Errors
    /// The folder is missing or not writable.
    pub fn check(&self) -> Result<()> {
        match self {
            Target::Png(path) => output::check(path, "png"),
            Target::Exr(path) => output::check(path, "exr"),
            Target::Tev => Ok(()),
        }
    }
}

/// Shows previews of an unfinished render at intervals.
pub struct Preview<'a> {
    target: &'a Target,
    /// The user's look of a PNG.
    look: &'a PictureArgs,
    /// Name of the picture in tev: the path of the output.
    name: String,
    made_for: PictureDefaults,
    clock: Clock,
    /// Time of the next preview, and the time at which the current preview was started (seconds).
    next: f64,
    began: f64,
    tev: Option<TevClient>,
    /// Whether a preview has failed, which ends the previews.
    failed: bool,
}

impl<'a> Preview<'a> {
    /// Makes the previews of the picture that is written to `output`.
    pub fn new(target: &'a Target, output: &Path, look: &'a PictureArgs, made_for: PictureDefaults) -> Preview<'a> {
        let name = output.display().to_string();
        Preview { target, look, name, made_for, clock: Clock::start(), next: 0.0, began: 0.0, tev: None, failed: false }
    }

    /// Whether the next preview is due.
    pub fn due(&mut self) -> bool {
        self.began = self.clock.seconds();
        !self.failed && self.began >= self.next
    }

    /// Shows a picture as a preview. `frame`: position within the whole picture. A failure is a warning and ends the
    /// previews.
    pub fn show(&mut self, picture: Result<LayerSet>, frame: Option<Frame>) {
        if let Err(error) = picture.and_then(|set| self.write(&set, frame)) {
            say(&format!("warning: --preview: {error}; the render goes on without"));
            self.failed = true;
        }
        let now = self.clock.seconds();
        self.next = now + (INTERVAL_RATIO * (now - self.began)).max(MIN_INTERVAL);
    }

    fn write(&mut self, set: &LayerSet, frame: Option<Frame>) -> Result<()> {
        match self.target {
            Target::Png(path) => png::write_tonemapped(path, &set.beauty()?, self.look.look(&self.made_for)),
            Target::Exr(path) => {
                let options = exr::Options { compression: Compression::None, ..exr::Options::default() };
                exr::write(path, set, &Attributes { frame, ..Attributes::default() }, options)
            }
            Target::Tev => self.stream(set).map_err(|cause| {
                Error::new(ErrorKind::Io, format!("tev at {TEV_ADDRESS}"), cause)
                    .hint("start tev on this machine first")
            }),
        }
    }

    /// Sends a picture to tev, which replaces its picture of this name.
    fn stream(&mut self, set: &LayerSet) -> std::io::Result<()> {
        let name = self.name.clone();
        let beauty = set.beauty().map_err(std::io::Error::other)?;
        let side = |pixels: usize| u32::try_from(pixels).map_err(std::io::Error::other);
        let (width, height) = (side(set.width)?, side(set.height)?);
        if self.tev.is_none() {
            let mut client = TevClient::wrap(TcpStream::connect(TEV_ADDRESS)?);
            let channel_names = &["R", "G", "B"];
            client.send(PacketCreateImage { image_name: &name, grab_focus: false, width, height, channel_names })?;
            self.tev = Some(client);
        }
        let Some(client) = &mut self.tev else { return Ok(()) };
        client.send(PacketUpdateImage {
            image_name: &name,
            grab_focus: false,
            channel_names: &["R", "G", "B"],
            channel_offsets: &[0, 1, 2],
            channel_strides: &[3, 3, 3],
            x: 0,
            y: 0,
            width,
            height,
            data: beauty.as_flattened(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_follow_from_the_extension() {
        assert!(matches!("a.PNG".parse(), Ok(Target::Png(_))));
        assert!(matches!("a/b.exr".parse(), Ok(Target::Exr(_))));
        assert!(matches!("tev".parse(), Ok(Target::Tev)));
        assert!("a.jpg".parse::<Target>().is_err() && "tev.".parse::<Target>().is_err());
    }
}
