//! Reads the kept inputs of fuzzing (`tests/fuzz.sh`) again, each with its own reader: no reader may panic, take long
//! or use much memory. A folder of `tests/corpus` has the name of its reader in `tests/support/readers.rs`.

#[path = "support/mod.rs"]
mod support;

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError, mpsc};
use std::thread;
use std::time::Duration;
use support::readers::{READERS, Reader};

/// Limits for reading a file.
#[derive(Clone, Copy)]
struct Bounds {
    time: Duration,
    /// Increase of resident memory (bytes).
    memory: u64,
}

/// The files are small, so their images are far below a gigabyte. The time is enough for a slow machine.
const BOUNDS: Bounds = Bounds { time: Duration::from_secs(20), memory: 256 << 20 };

/// Memory is measured for the whole process, so one file is read at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// The value of a line of `/proc/self/status` (bytes).
fn memory(key: &str) -> u64 {
    let text = fs::read_to_string("/proc/self/status").expect("a line");
    let line = text.lines().find_map(|line| line.strip_prefix(key)).expect("the line is there");
    line.split_whitespace().nth(1).and_then(|kib| kib.parse::<u64>().ok()).expect("a number") << 10
}

/// Reads a file and returns the limit that was exceeded, if any.
fn fault(reader: Reader, path: &Path, bounds: Bounds) -> Option<String> {
    fault_of(reader, fs::read(path).expect("it can be read"), path, bounds)
}

/// Reads the bytes of a file and returns the limit that was exceeded, if any.
fn fault_of(reader: Reader, bytes: Vec<u8>, path: &Path, bounds: Bounds) -> Option<String> {
    let folder = tempfile::tempdir().expect("a folder");
    // Resets the peak to the memory in use.
    fs::write("/proc/self/clear_refs", "5").expect("Linux lets a process");
    let before = memory("VmRSS");
    let (done, ended) = mpsc::channel();
    thread::spawn(move || {
        let outcome = catch_unwind(AssertUnwindSafe(|| (reader.1)(&bytes, folder.path())));
        done.send(outcome.is_ok())
    });
    let what = match ended.recv_timeout(bounds.time) {
        Err(_) => "it takes long".into(),
        Ok(false) => "a panic".into(),
        Ok(true) => match memory("VmHWM").saturating_sub(before) {
            taken if taken > bounds.memory => format!("it takes {} MiB", taken >> 20),
            _ => return None,
        },
    };
    Some(format!("{}: {what}", path.display()))
}

/// The kept inputs of a reader.
fn kept(name: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus").join(name);
    let entries = fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    files.sort();
    files
}

#[test]
fn kept_inputs_of_fuzzing_are_read_or_refused() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let mut faults = Vec::new();
    for reader in READERS {
        let files = kept(reader.0);
        assert!(files.len() > 2, "{}: nothing was kept", reader.0);
        faults.extend(files.iter().filter_map(|path| fault(reader, path, BOUNDS)));
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Readers whose decoders are libraries, of which some believe the sizes in a file.
const DECODERS: [&str; 9] = ["png", "jpeg", "webp", "ktx2", "draco", "meshopt", "exr", "exr_environment", "hdr"];
/// Random changes of each kept input.
const CHANGES: u64 = 24;

/// A damaged copy of `bytes`: some bytes are replaced, or a part is cut off, or a large number of variable length is
/// inserted.
fn changed(bytes: &[u8], seed: u64) -> Vec<u8> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    // xorshift64*
    let mut draw = move |below: usize| {
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        (state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) as usize % below.max(1)
    };
    let mut bytes = bytes.to_vec();
    for _ in 0..=draw(3) {
        let at = draw(bytes.len());
        match draw(8) {
            0 => bytes.truncate(at),
            1 => drop(bytes.splice(at..(at + 1).min(bytes.len()), [0xff, 0xff, 0xff, 0xff, 0x0f])),
            2 => bytes[at..].iter_mut().take(4).for_each(|byte| *byte = 0xff),
            _ => bytes[at..].iter_mut().take(1).for_each(|byte| *byte = draw(256) as u8),
        }
    }
    bytes
}

/// Damaged inputs of decoders, most of which no fuzzing has kept.
#[test]
fn changed_inputs_of_decoders_are_read_or_refused() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let mut faults = Vec::new();
    for reader in READERS.into_iter().filter(|(name, _)| DECODERS.contains(name)) {
        for path in kept(reader.0) {
            let bytes = fs::read(&path).expect("it can be read");
            faults.extend((0..CHANGES).filter_map(|seed| {
                let said = fault_of(reader, changed(&bytes, seed), &path, BOUNDS)?;
                Some(format!("{said} (change {seed})"))
            }));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// The limits detect readers that panic, that do not end, and that use too much memory.
#[test]
fn planted_faults_are_found() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let path = &kept("glb")[0];
    let bounds = Bounds { time: Duration::from_secs(2), memory: 32 << 20 };
    let readers: [(Reader, &str); 4] = [
        (("panics", |_, _| panic!("planted")), ": a panic"),
        (("sleeps", |_, _| thread::sleep(Duration::from_secs(5))), ": it takes long"),
        (("takes", |_, _| drop(std::hint::black_box(vec![1u8; 64 << 20]))), ": it takes "),
        (("is fine", |_, _| {}), ""),
    ];
    for (reader, expected) in readers {
        let said = fault(reader, path, bounds).unwrap_or_default();
        assert!(said.contains(expected) && said.is_empty() == expected.is_empty(), "{}: {said}", reader.0);
    }
}
