//! What all fuzz targets share: the readers, which tests replay as well, and the body of a target.

pub mod support;

use std::panic::{AssertUnwindSafe, catch_unwind, set_hook};
use std::path::PathBuf;
use std::sync::{LazyLock, Mutex, PoisonError};
use support::readers::{READERS, Reader};

pub use libfuzzer_sys;

/// The folder of this process; the script that started it removes it.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| tempfile::tempdir().expect("a folder can be made").keep());

/// What the last panic said.
static SAID: Mutex<String> = Mutex::new(String::new());

/// The reader of that name.
pub fn reader(name: &str) -> Reader {
    *READERS.iter().find(|(own, _)| *own == name).expect("a target is called as its reader")
}

/// Lets readers catch the panics of decoders, as they do in the program: libFuzzer's own hook would end the process at
/// once.
pub fn prepare() {
    set_hook(Box::new(|panic| *SAID.lock().unwrap_or_else(PoisonError::into_inner) = panic.to_string()));
    LazyLock::force(&FOLDER);
}

/// Reads the bytes of a file; a panic that no reader has caught ends the process.
pub fn read(reader: Reader, bytes: &[u8]) {
    if catch_unwind(AssertUnwindSafe(|| (reader.1)(bytes, &FOLDER))).is_err() {
        eprintln!("{}", SAID.lock().unwrap_or_else(PoisonError::into_inner));
        std::process::abort();
    }
}

/// The target of the reader of that name.
#[macro_export]
macro_rules! target {
    ($name:literal) => {
        $crate::libfuzzer_sys::fuzz_target!(init: $crate::prepare(), |bytes: &[u8]| {
            $crate::read($crate::reader($name), bytes);
        });
    };
}
