//! Code of all fuzz targets: the readers, which tests replay as well, and the body of a target.

pub mod support;

use std::panic::{AssertUnwindSafe, catch_unwind, set_hook};
use std::path::PathBuf;
use std::sync::{LazyLock, Mutex, PoisonError};
use support::readers::{READERS, Reader};

pub use libfuzzer_sys;

/// The folder of this process. The script that started the process removes it.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| tempfile::tempdir().expect("a folder can be made").keep());

/// Message of the last panic.
static SAID: Mutex<String> = Mutex::new(String::new());

/// The reader named `name`.
pub fn reader(name: &str) -> Reader {
    *READERS.iter().find(|(own, _)| *own == name).expect("a target is called as its reader")
}

/// Lets readers catch panics of decoders, as in the program. The panic hook of libFuzzer would end the process.
pub fn prepare() {
    set_hook(Box::new(|panic| *SAID.lock().unwrap_or_else(PoisonError::into_inner) = panic.to_string()));
    LazyLock::force(&FOLDER);
}

/// Reads the bytes of a file. A panic that no reader has caught ends the process.
pub fn read(reader: Reader, bytes: &[u8]) {
    if catch_unwind(AssertUnwindSafe(|| (reader.1)(bytes, &FOLDER))).is_err() {
        eprintln!("{}", SAID.lock().unwrap_or_else(PoisonError::into_inner));
        std::process::abort();
    }
}

/// The fuzz target of the reader with this name.
#[macro_export]
macro_rules! target {
    ($name:literal) => {
        $crate::libfuzzer_sys::fuzz_target!(init: $crate::prepare(), |bytes: &[u8]| {
            $crate::read($crate::reader($name), bytes);
        });
    };
}
