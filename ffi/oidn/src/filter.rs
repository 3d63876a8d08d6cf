//! A filter: the network with its weights, ready for pictures of one size and kind.

use std::ffi::{CStr, c_int, c_void};

use crate::api::{self, Handle};
use crate::device::Device;
use crate::error::Error;
use crate::limits::MAX_SIDE;

/// How well, against how fast.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Quality {
    /// For a first look. Libraries older than 2.3 do not know it and take [`Quality::Balanced`] instead.
    Fast,
    /// For pictures that change while they are looked at.
    Balanced,
    /// For what is delivered.
    #[default]
    High,
}

/// A picture to denoise. Rows follow each other, pixels are of three channels.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// What is to be denoised. NaN and what is negative count as 0. Infinite and huge values are taken and do no harm
    /// beyond the picture, but spoil it: see the crate's documentation.
    pub color: &'a [[f32; 3]],
    /// Colour of the surfaces, from 0 to 1, as a guide.
    pub albedo: Option<&'a [[f32; 3]]>,
    /// Normals of the surfaces, each coordinate from -1 to 1, as a guide; only together with albedo.
    pub normal: Option<&'a [[f32; 3]]>,
    /// How well, against how fast.
    pub quality: Quality,
    /// Whether `color` goes beyond 1, as radiance does. Otherwise what does is cut off.
    pub hdr: bool,
    /// Whether the guides are free of noise. They are then trusted to the pixel, and noise of theirs is kept.
    pub clean_aux: bool,
    /// Roughly the most memory to compute with, in MiB: the picture is cut into overlapping tiles that fit, as far as
    /// tiles can be small. `None`: no limit.
    pub max_memory_mib: Option<u32>,
}

impl<'a> Input<'a> {
    /// A picture of radiances without guides, at high quality.
    pub fn new(width: usize, height: usize, color: &'a [[f32; 3]]) -> Input<'a> {
        let quality = Quality::High;
        Input {
            width,
            height,
            color,
            albedo: None,
            normal: None,
            quality,
            hdr: true,
            clean_aux: false,
            max_memory_mib: None,
        }
    }

    /// Everything the library would have to trust.
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

/// Denoises pictures, one after the other. What the network needs is made ready by the first and kept: a later picture
/// of the same size, kinds of guides and settings, whatever its content, spares that time (a tenth, for 1280x720).
pub struct Filter {
    raw: Handle,
    device: Device,
}

// SAFETY: the library ties filters to their device, not to a thread; it is used through `&mut` alone.
unsafe impl Send for Filter {}

impl Filter {
    pub(crate) fn new(device: &Device) -> Result<Filter, Error> {
        let during = "make a filter";
        // SAFETY: the device lives as long as the filter, which holds a clone; the name is a C string.
        let raw = unsafe { (device.functions().new_filter)(device.raw(), c"RT".as_ptr()) };
        // Before the check, so that it is released whatever that says.
        let filter = (!raw.is_null()).then(|| Filter { raw, device: device.clone() });
        device.check(during)?;
        filter.ok_or_else(|| Error::Oidn { during, message: api::error_name(1).into() })
    }

    /// The denoised picture. Its values are finite and not negative, whatever came in.
    ///
    /// # Errors
    ///
    /// [`Error::BadSize`], [`Error::BadLength`] and [`Error::NormalWithoutAlbedo`], before the library sees any of it;
    /// [`Error::Oidn`] with what it reports, for instance that there is no memory left. The filter serves on.
    pub fn denoise(&mut self, input: &Input) -> Result<Vec<[f32; 3]>, Error> {
        input.check()?;
        let mut output = Vec::new();
        output.try_reserve_exact(input.color.len()).map_err(|error| Error::Oidn {
            during: "get memory for the denoised picture",
            message: error.to_string(),
        })?;
        output.resize(input.color.len(), [0.0; 3]);

        // All pointers are set anew each time: those of the last picture may have become invalid since.
        let size = (input.width, input.height);
        self.set_image(c"color", Some(input.color), size)?;
        self.set_image(c"albedo", input.albedo, size)?;
        self.set_image(c"normal", input.normal, size)?;
        self.set_pixels(c"output", output.as_mut_ptr().cast(), size)?;
        let quality = match input.quality {
            Quality::Fast if self.device.library().has_fast() => api::QUALITY_FAST,
            Quality::Fast | Quality::Balanced => api::QUALITY_BALANCED,
            Quality::High => api::QUALITY_HIGH,
        };
        let memory = input.max_memory_mib.map_or(-1, |mib| c_int::try_from(mib).unwrap_or(c_int::MAX));
        self.set_int(c"quality", quality)?;
        self.set_int(c"maxMemoryMB", memory)?;
        self.set_bool(c"hdr", input.hdr)?;
        self.set_bool(c"cleanAux", input.clean_aux && input.albedo.is_some())?;

        let functions = self.device.functions();
        // SAFETY: the handle is a filter, its pictures are as large as it was told (checked above).
        unsafe { (functions.commit_filter)(self.raw) };
        self.device.check("prepare to denoise")?;
        // SAFETY: as above; inputs and output are borrowed or owned here until the call is over, which returns when
        // the output is written, and they do not overlap. Inputs are only read.
        unsafe { (functions.execute_filter)(self.raw) };
        self.device.check("denoise")?;
        Ok(output)
    }

    /// A picture that the filter reads, or that it does without.
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

    /// The pointer is kept by the library, and followed when the filter is executed, not before.
    fn set_pixels(&mut self, name: &CStr, pixels: *mut c_void, (width, height): (usize, usize)) -> Result<(), Error> {
        let (format, set_image) = (api::FORMAT_FLOAT3, self.device.functions().set_image);
        // SAFETY: the handle is a filter, the name a C string; whoever executes the filter answers for the pixels.
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
    /// A denoiser of pictures with this device.
    ///
    /// # Errors
    ///
    /// [`Error::Oidn`], for instance when there is no memory left.
    pub fn filter(&self) -> Result<Filter, Error> {
        Filter::new(self)
    }

    /// Denoises one picture. For several of one size and kind [`Device::filter`] is faster.
    ///
    /// # Errors
    ///
    /// As for [`Filter::denoise`].
    pub fn denoise(&self, input: &Input) -> Result<Vec<[f32; 3]>, Error> {
        // What is wrong with the input is told before the library is asked for anything.
        input.check()?;
        self.filter()?.denoise(input)
    }
}

impl Drop for Filter {
    fn drop(&mut self) {
        // SAFETY: the handle came from `new_filter` and is released once; its device is still there.
        unsafe { (self.device.functions().release_filter)(self.raw) }
    }
}
