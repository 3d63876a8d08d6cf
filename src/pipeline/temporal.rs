//! The temporal finish of files: reads the frames of an animation around each frame, and finishes them together.

use super::deliver::{header_to_finish, write_finish};
use super::finish::OpenFinish;
use super::rendered_file::RenderedFile;
use crate::error::{Error, ErrorKind, Result};
use crate::film::{LOBE_COLORS, Layer, LayerSet, lobe_names};
use crate::finish::temporal::{self, REACH, WINDOW};
use crate::finish::{ERROR, ErrorSource, parts_to_finish};
use crate::image::exr;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Files of an animation, one per frame. Memory holds what the average of frames needs of each frame of a window, and the
/// rest of one file at a time. Each frame is denoised once if frames are finished in ascending order.
pub struct FrameFiles {
    paths: BTreeMap<u32, PathBuf>,
    /// Frames in memory, by number.
    held: BTreeMap<u32, Held>,
    /// Whether each frame in memory, by number, and the next one are averaged.
    joined: BTreeMap<u32, bool>,
}

/// A frame in memory.
struct Held {
    frame: temporal::Frame,
    /// Seed of the render; `None` for files of other programs.
    seed: Option<u64>,
}

impl FrameFiles {
    /// Files by the numbers of their frames.
    pub fn new(paths: BTreeMap<u32, PathBuf>) -> FrameFiles {
        FrameFiles { paths, held: BTreeMap::new(), joined: BTreeMap::new() }
    }

    /// The file of a frame.
    ///
    /// # Errors
    /// There is none.
    fn path(&self, number: u32) -> Result<&Path> {
        let missing = || Error::usage(format!("there is no file of frame {number}"));
        self.paths.get(&number).map(PathBuf::as_path).ok_or_else(missing)
    }

    /// Numbers of the frames around a frame and the frame itself, without a gap between them: its window.
    pub fn window(&self, number: u32) -> Vec<u32> {
        let before = (1..=REACH as u32).map_while(|k| number.checked_sub(k).filter(|n| self.paths.contains_key(n)));
        let after = (1..=REACH as u32).map_while(|k| number.checked_add(k).filter(|n| self.paths.contains_key(n)));
        let mut window: Vec<u32> = before.chain([number]).chain(after).collect();
        window.sort_unstable();
        window
    }

    /// Finishes a frame with the frames of its window. The result depends on nothing else. Its remarks are on layers left out
    /// and on neighbours that do not count. `only_present`: no layers are added that the file lacks.
    ///
    /// # Errors
    /// A file of the window cannot be read or finished, or two frames have one seed.
    pub fn finish(&mut self, number: u32, finish: &mut OpenFinish, only_present: bool) -> Result<RenderedFile> {
        let around = self.window(number);
        let mut remarks = self.gaps(number);
        self.held.retain(|frame, _| around.contains(frame));
        self.joined.retain(|frame, _| around.contains(frame));
        let missing = around.iter().filter(|frame| !self.held.contains_key(frame)).count();
        if missing > 0 {
            let path = self.path(number)?.to_owned();
            let header = RenderedFile::read_header(&path)?.set;
            let checked = finish.finish().check_memory_of_frames(&header, missing);
            checked.map_err(|error| error.within(path.display()))?;
        }
        for &frame in &around {
            if !self.held.contains_key(&frame) {
                let held = self.read(frame, finish, &mut remarks)?;
                self.held.insert(frame, held);
            }
        }
        for pair in around.windows(2) {
            if !self.joined.contains_key(&pair[0]) {
                let obstacle = self.obstacle(pair[0], pair[1])?;
                self.joined.insert(pair[0], obstacle.is_none());
                remarks.extend(obstacle);
            }
        }
        let path = self.path(number)?.to_owned();
        let within = |error: Error| error.within(path.display());
        let header = RenderedFile::read_header(&path)?.set;
        let wanted = |name: &str| !only_present || header.get(name).is_some();
        let (window, averaged) = self.averaged(number);
        let average = finish.finish().average(&window, &parts_to_finish(&header, wanted));
        let average = average.ok_or_else(|| Error::new(ErrorKind::Io, path.display(), "there is no such frame"))?;
        let of_lobes: Vec<String> = LOBE_COLORS.into_iter().chain(lobe_names()).map(String::from).collect();
        let average = average.with_colors_of(&self.layers(number, &of_lobes)?);
        // The windows of later frames lack the first frame of this one.
        self.held.retain(|frame, _| frame + REACH as u32 > number);
        let error = ErrorSource::read(&header, |names| self.layers(number, names))?;
        let picture = finish.finish().deliver(average, error, wanted).map_err(within)?;
        let mut file = RenderedFile::read_layers(&path, |name| !picture.replaces(name))?;
        let mut object = header_to_finish(&file.attributes, &mut file.set);
        let finished = picture.insert_into(&mut file.set).map_err(within)?;
        // Replaced layers keep their places, except the error.
        let place = |layer: &Layer| header.layers.iter().position(|old| old.name == layer.name && layer.name != ERROR);
        file.set.layers.sort_by_key(|layer| place(layer).unwrap_or(usize::MAX));
        write_finish(&mut object, finish, &finished);
        object["combined"][WINDOW_KEY] = json!(around);
        object["combined"][AVERAGED_KEY] = json!(averaged);
        file.attributes.insert(exr::ATTRIBUTE, &object)?;
        Ok(RenderedFile { remarks, ..file })
    }

    /// The named layers of a frame, as far as its file has them.
    fn layers(&self, number: u32, names: &[String]) -> Result<LayerSet> {
        let wanted = |name: &str| names.iter().any(|wanted| wanted == name);
        Ok(RenderedFile::read_layers(self.path(number)?, wanted)?.set)
    }

    /// Whether the header of a frame's file says that the frame has been finished with all frames of its window.
    pub fn is_finished(&self, number: u32) -> bool {
        let read = self.path(number).and_then(exr::read_header).ok();
        let header = read.and_then(|(_, attributes)| attributes.object());
        header.is_some_and(|header| header["combined"][WINDOW_KEY] == json!(self.window(number)))
    }

    /// Reads a frame and denoises it.
    fn read(&self, number: u32, finish: &mut OpenFinish, remarks: &mut Vec<String>) -> Result<Held> {
        let path = self.path(number)?.to_owned();
        let mut header = RenderedFile::read_header(&path)?;
        remarks.append(&mut header.remarks);
        let layers = self.layers(number, &finish.finish().frame_layers(&header.set))?;
        let frame = finish.finish().frame(layers).map_err(|error| error.within(path.display()))?;
        let seed = header.attributes.object().and_then(|header| header["seed"].as_u64());
        Ok(Held { frame, seed })
    }

    /// Remarks on missing frames beside a frame, except before the first and after the last one.
    fn gaps(&self, number: u32) -> Vec<String> {
        let (first, last) = (self.paths.keys().next(), self.paths.keys().next_back());
        let between = |frame: &u32| first < Some(frame) && Some(frame) < last;
        let next = [number.checked_sub(1), number.checked_add(1)].into_iter().flatten().filter(between);
        let missing = next.filter(|frame| !self.paths.contains_key(frame));
        let remark = |frame: u32| {
            format!("frame {frame} is missing: frame {number} is finished without it and the frames beyond it")
        };
        missing.map(remark).collect()
    }

    /// The reason for which a frame and the next one are not averaged; `None` if they are.
    ///
    /// # Errors
    /// Both have one seed.
    fn obstacle(&self, number: u32, next: u32) -> Result<Option<String>> {
        let Some((a, b)) = self.held.get(&number).zip(self.held.get(&next)) else { return Ok(None) };
        let names = [self.path(number)?, self.path(next)?].map(|path| path.display().to_string());
        if a.seed.is_some() && a.seed == b.seed {
            let cause = format!("has the seed of {}, so both have equal noise, which their average keeps", names[0]);
            let error = Error::new(ErrorKind::Image, &names[1], cause);
            return Err(error.hint("render without --frame-seed same, or finish each frame alone"));
        }
        let [here, there] = [a, b].map(|held| held.frame.size());
        Ok(if here != there {
            let sizes = [here, there].map(|size| format!("{} x {}", size.width, size.height));
            Some(format!(
                "{} has {} pixels and {} {}: frames on both sides are finished without each other; render all frames at \
                 one size",
                names[0], sizes[0], names[1], sizes[1]
            ))
        } else if temporal::is_cut(&a.frame, &b.frame) {
            Some(format!(
                "{} shows hardly any surface of {}: frames on both sides of the cut are finished without each other",
                names[1], names[0]
            ))
        } else {
            None
        })
    }

    /// The frames that are averaged with a frame, as a window and by number.
    fn averaged(&self, number: u32) -> (temporal::Window<'_>, Vec<u32>) {
        let mut window = [None; WINDOW];
        let mut numbers = vec![number];
        window[REACH] = self.held.get(&number).map(|held| &held.frame);
        let joined = |frame: u32| self.joined.get(&frame).copied().unwrap_or(false);
        let before =
            |k: usize| number.checked_sub(k as u32).filter(|frame| joined(*frame)).map(|frame| (REACH - k, frame));
        let after =
            |k: usize| number.checked_add(k as u32).filter(|frame| joined(frame - 1)).map(|frame| (REACH + k, frame));
        for (at, frame) in (1..=REACH).map_while(before).chain((1..=REACH).map_while(after)) {
            window[at] = self.held.get(&frame).map(|held| &held.frame);
            numbers.push(frame);
        }
        numbers.sort_unstable();
        (window, numbers)
    }
}

/// Key of the header's object `combined` with the numbers of the frames that the temporal finish has read.
const WINDOW_KEY: &str = "window";
/// Key of the header's object `combined` with the numbers of the frames that are averaged.
const AVERAGED_KEY: &str = "averaged";
