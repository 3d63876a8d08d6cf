//! Denoising of pictures by a filter, which holds the network.

use std::ffi::{CStr, c_int, c_void};
use std::ptr;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::api::{self, Handle};
use crate::device::Device;
use crate::error::Error;
use crate::limits::MAX_SIDE;

/// Trade-off between quality and speed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Quality {
    /// For previews. Libraries older than 2.3 use [`Quality::Balanced`] instead.
    Fast,
    /// For interactive use.
    Balanced,
    /// For final pictures.
    #[default]
    High,
}

/// What a picture shows. A guide is denoised alone, without guides of its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Content {
    /// Colour: radiance, or a picture on a display.
    #[default]
    Color,
    /// Albedo of the surfaces, from 0 to 1.
    Albedo,
    /// Normals of the surfaces, each coordinate from -1 to 1.
    Normal,
}

/// A picture to denoise, its guides and settings. Pictures are row-major with three channels per pixel.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// The noisy picture. NaN and negative colours count as 0. Infinite and huge colours are allowed, but spoil the
    /// result: see the crate's documentation.
    pub color: &'a [[f32; 3]],
    /// What `color` shows. Only colour uses the guides and `hdr`.
    pub content: Content,
    /// Albedo of the surfaces, from 0 to 1, as a guide; `None` without.
    pub albedo: Option<&'a [[f32; 3]]>,
    /// Normals of the surfaces, each coordinate from -1 to 1, as a guide; `None` without. Only together with `albedo`.
    pub normal: Option<&'a [[f32; 3]]>,
    /// Trade-off between quality and speed.
    pub quality: Quality,
    /// Whether `color` may exceed 1, like radiance. If false, larger values are clamped.
    pub hdr: bool,
    /// Whether the guides, albedo and normals, are free of noise. If true, their noise remains in the result.
    pub clean_aux: bool,
    /// Approximate limit on memory (MiB); `None` means no limit. The picture is cut into overlapping tiles that fit,
    /// but tiles have a minimum size.
    pub max_memory_mib: Option<u32>,
}

impl<'a> Input<'a> {
    /// A picture of radiance to denoise without guides, at high quality.
    pub fn new(width: usize, height: usize, color: &'a [[f32; 3]]) -> Input<'a> {
        let quality = Quality::High;
        Input {
            width,
            height,
            color,
            content: Content::Color,
            albedo: None,
            normal: None,
            quality,
            hdr: true,
            clean_aux: false,
            max_memory_mib: None,
        }
    }

    /// Checks the sizes of picture and guides, which the library does not check.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let (width, height) = (self.width, self.height);
        let sides = 1..=MAX_SIDE;
        let pixels = width.checked_mul(height).filter(|_| sides.contains(&width) && sides.contains(&height));
        let Some(pixels) = pixels else { return Err(Error::BadSize { width, height }) };
        let pictures = [("color", Some(self.color)), ("albedo", self.albedo), ("normal", self.normal)];
        for (picture, values) in pictures {
            if let Some(values) = values.filter(|values| values.len() != pixels) {
                return Err(Error::BadLength { picture, pixels: values.len(), width, height });
            }
        }
        if self.normal.is_some() && self.albedo.is_none() {
            return Err(Error::NormalWithoutAlbedo);
        }
        Ok(())
    }
}

/// Denoises pictures, one after the other. The first picture prepares the network. Later pictures of the same size,
/// guides and settings save this time (a tenth of the total for 1280x720).
pub struct Filter {
    raw: Handle,
    device: Device,
}

// SAFETY: filters belong to their device, not to a thread, and are used only through `&mut`.
unsafe impl Send for Filter {}

/// A function that is polled while a picture is denoised, and whether it has ended the work.
struct Poll<'a> {
    goes_on: &'a (dyn Fn() -> bool + Sync),
    ended: AtomicBool,
}

/// Polls the [`Poll`] that `poll` points to, for the library.
unsafe extern "C" fn goes_on(poll: *mut c_void, _done: f64) -> bool {
    // SAFETY: `Filter::execute` passes a pointer to a `Poll` that outlives the execution; its function is `Sync`.
    let poll = unsafe { &*poll.cast::<Poll<'_>>() };
    let goes_on = (poll.goes_on)();
    if !goes_on {
        poll.ended.store(true, Ordering::Relaxed);
    }
    goes_on
}

impl Filter {
    pub(crate) fn new(device: &Device) -> Result<Filter, Error> {
        let during = "make a filter";
        // SAFETY: the device lives as long as the filter, which holds a clone; the name is a C string.
        let raw = unsafe { (device.functions().new_filter)(device.raw(), c"RT".as_ptr()) };
        // Created before the check, so that the handle is released if the check fails.
        let filter = (!raw.is_null()).then(|| Filter { raw, device: device.clone() });
        device.check(during)?;
        filter.ok_or_else(|| Error::Oidn { during, message: api::error_name(1).into() })
    }

    /// Denoises a picture. The values of the result are finite, for any input; colours and albedos are not negative.
    ///
    /// # Errors
    ///
    /// [`Error::BadSize`], [`Error::BadLength`] and [`Error::NormalWithoutAlbedo`], before the library is called;
    /// [`Error::Oidn`] with the library's message, for instance if memory is short. The filter stays usable.
    pub fn denoise(&mut self, input: &Input) -> Result<Vec<[f32; 3]>, Error> {
        self.execute(input, None)
    }

    /// Denoises a picture, or ends early with the result `None` once `goes_on` returns false. Threads of the library poll
    /// it, one at a time, whenever a layer of the network is done.
    ///
    /// # Errors
    ///
    /// As for [`Filter::denoise`].
    pub fn denoise_while(
        &mut self,
        input: &Input,
        goes_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<Vec<[f32; 3]>>, Error> {
        let poll = Poll { goes_on, ended: AtomicBool::new(false) };
        let denoised = self.execute(input, Some(&poll));
        // The library reports the end as an error.
        if poll.ended.into_inner() { Ok(None) } else { denoised.map(Some) }
    }

    fn execute<'i>(&mut self, input: &Input<'i>, poll: Option<&Poll>) -> Result<Vec<[f32; 3]>, Error> {
        input.check()?;
        let mut output = Vec::new();
        output.try_reserve_exact(input.color.len()).map_err(|error| Error::Oidn {
            during: "get memory for the denoised picture",
            message: error.to_string(),
        })?;
        output.resize(input.color.len(), [0.0; 3]);

        // All pointers are set for every picture, because those of the last picture may be invalid.
        let size = (input.width, input.height);
        let own = |content| (input.content == content).then_some(input.color);
        let guide = |guide: Option<&'i [[f32; 3]]>| guide.filter(|_| input.content == Content::Color);
        self.set_image(c"color", own(Content::Color), size)?;
        self.set_image(c"albedo", guide(input.albedo).or(own(Content::Albedo)), size)?;
        self.set_image(c"normal", guide(input.normal).or(own(Content::Normal)), size)?;
        self.set_pixels(c"output", output.as_mut_ptr().cast(), size)?;
        let quality = match input.quality {
            Quality::Fast if self.device.library().has_fast() => api::QUALITY_FAST,
            Quality::Fast | Quality::Balanced => api::QUALITY_BALANCED,
            Quality::High => api::QUALITY_HIGH,
        };
        let memory = input.max_memory_mib.map_or(-1, |mib| c_int::try_from(mib).unwrap_or(c_int::MAX));
        self.set_int(c"quality", quality)?;
        self.set_int(c"maxMemoryMB", memory)?;
        self.set_bool(c"hdr", input.hdr && input.content == Content::Color)?;
        self.set_bool(c"cleanAux", input.clean_aux && guide(input.albedo).is_some())?;

        let functions = self.device.functions();
        // SAFETY: the handle is a filter, and its pictures have the sizes that were set (checked above).
        unsafe { (functions.commit_filter)(self.raw) };
        self.device.check("prepare to denoise")?;
        if let Some(poll) = poll {
            // SAFETY: the handle is a filter. The library calls the function only while it executes the filter, below,
            // and `poll` outlives that.
            unsafe { (functions.set_monitor)(self.raw, Some(goes_on), ptr::from_ref(poll).cast_mut().cast()) };
        }
        // SAFETY: as above. Inputs and output are borrowed or owned here until the call returns, after the output is
        // written. They do not overlap, and inputs are only read.
        unsafe { (functions.execute_filter)(self.raw) };
        if poll.is_some() {
            // SAFETY: the handle is a filter.
            unsafe { (functions.set_monitor)(self.raw, None, ptr::null_mut()) };
        }
        self.device.check("denoise")?;
        Ok(output)
    }

    /// Sets a picture that the filter reads under the name `name`, or removes it if `None`.
    fn set_image(&mut self, name: &CStr, pixels: Option<&[[f32; 3]]>, size: (usize, usize)) -> Result<(), Error> {
        match pixels {
            Some(pixels) => self.set_pixels(name, pixels.as_ptr().cast_mut().cast(), size),
            None => {
                // SAFETY: the handle is a filter, the name a C string.
                unsafe { (self.device.functions().unset_image)(self.raw, name.as_ptr()) };
                self.device.check("set a picture")
            }
        }
    }

    /// Sets the pointer to a picture. The library stores it and reads through it only when the filter is executed.
    fn set_pixels(&mut self, name: &CStr, pixels: *mut c_void, (width, height): (usize, usize)) -> Result<(), Error> {
        let (format, set_image) = (api::FORMAT_FLOAT3, self.device.functions().set_image);
        // SAFETY: the handle is a filter, the name a C string. The code that executes the filter guarantees the pixels.
        unsafe { set_image(self.raw, name.as_ptr(), pixels, format, width, height, 0, 0, 0) };
        self.device.check("set a picture")
    }

    fn set_int(&mut self, name: &CStr, value: c_int) -> Result<(), Error> {
        // SAFETY: the handle is a filter, the name a C string.
        unsafe { (self.device.functions().set_filter_int)(self.raw, name.as_ptr(), value) };
        self.device.check("set an option")
    }

    fn set_bool(&mut self, name: &CStr, value: bool) -> Result<(), Error> {
        // SAFETY: the handle is a filter, the name a C string.
        unsafe { (self.device.functions().set_filter_bool)(self.raw, name.as_ptr(), value) };
        self.device.check("set an option")
    }
}

impl Device {
    /// Creates a filter of this device.
    ///
    /// # Errors
    ///
    /// [`Error::Oidn`], for instance when there is no memory left.
    pub fn filter(&self) -> Result<Filter, Error> {
        Filter::new(self)
    }

    /// Denoises one picture. For several pictures of one size and kind, a [`Device::filter`] is faster.
    ///
    /// # Errors
    ///
    /// As for [`Filter::denoise`].
    pub fn denoise(&self, input: &Input) -> Result<Vec<[f32; 3]>, Error> {
        // Errors of the input are reported before the library is called.
        input.check()?;
        self.filter()?.denoise(input)
    }
}

impl Drop for Filter {
    fn drop(&mut self) {
        // SAFETY: the handle came from `new_filter` and is released once. Its device is alive.
        unsafe { (self.device.functions().release_filter)(self.raw) }
    }
}
