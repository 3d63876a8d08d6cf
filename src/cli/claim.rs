//! Claims of frames, by which machines that share a folder divide the frames among themselves.
//!
//! A claim is a file beside the output. Creating a file is atomic on all file systems, NFS included, so only one process
//! gets the claim. The file names its owner, who touches it regularly. If the file is not touched, its owner has died, and
//! another process takes the frame. Ages are differences of times of the file server, because the clocks of machines
//! differ.

use caustique::error::Result;
use caustique::files;
use caustique::image::atomic;
use caustique::system::{self, machine};
use std::fs::{self, File};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime};

/// Time between two touches of a claim, the file by which a process says that it renders a frame.
const TOUCH_INTERVAL: Duration = Duration::from_secs(15);
/// Age from which the process of an untouched claim counts as dead: servers may show a file's time a minute late.
const MAX_AGE: Duration = Duration::from_secs(180);
/// Most bytes that are read of a claim's file.
const MAX_BYTES: u64 = 1 << 12;

/// The result of claiming a frame for this process.
pub enum Claimed {
    /// This process renders the frame.
    Here(Claim),
    /// Another process renders the frame: machine and process, for messages.
    Elsewhere(String),
}

/// The claim of a frame: a file that keeps other processes from rendering it, removed when dropped.
pub struct Claim {
    path: PathBuf,
    owner: String,
    over: Option<Sender<()>>,
    toucher: Option<JoinHandle<()>>,
}

/// Path of the claim of the frame that is written to `output`.
pub fn file(output: &Path) -> PathBuf {
    let mut path = output.as_os_str().to_owned();
    path.push(".claim");
    PathBuf::from(path)
}

impl Claim {
    /// Claims for this process the frame that is written to `output`.
    ///
    /// # Errors
    /// The folder is not writable.
    pub fn claim(output: &Path) -> Result<Claimed> {
        atomic::check_writable(output)?;
        Claim::make(file(output), owner()).map_err(|cause| atomic::failure(output, &cause))
    }

    fn make(path: PathBuf, owner: String) -> io::Result<Claimed> {
        loop {
            match File::options().read(true).write(true).create_new(true).open(&path) {
                Ok(mut file) => {
                    return match file.write_all(owner.as_bytes()).and_then(|()| file.sync_all()) {
                        Ok(()) => Ok(Claimed::Here(Claim::keep(path, owner, file))),
                        Err(cause) => {
                            // Where the disk is full, a claim without an owner would keep others from the frame.
                            let _ = fs::remove_file(&path);
                            Err(cause)
                        }
                    };
                }
                Err(cause) if cause.kind() == io::ErrorKind::AlreadyExists => {}
                Err(cause) => return Err(cause),
            }
            // Links and pipes are no claims, and opening one may block.
            if fs::symlink_metadata(&path).is_ok_and(|data| !data.is_file()) {
                return Err(io::Error::other(format!("{} is no file", path.display())));
            }
            // The claim was released meanwhile: try again.
            let Some((holder, touched)) = read(&path)? else { continue };
            if !is_claim(&holder) {
                return Err(io::Error::other(format!("{} is no claim of a frame", path.display())));
            }
            if !is_dead(&holder, age(&path, touched)?) {
                let shown = holder.split('\n').next().unwrap_or_default();
                return Ok(Claimed::Elsewhere(if shown.is_empty() { "another machine".into() } else { shown.into() }));
            }
            match remove(&path, touched) {
                // In a folder with the sticky bit only the owner may remove the file.
                Err(cause) if cause.kind() == io::ErrorKind::PermissionDenied => {
                    return Ok(Claimed::Elsewhere("another user".into()));
                }
                removed => removed?,
            }
        }
    }

    /// Starts a thread that touches the claim's file until the claim is dropped.
    fn keep(path: PathBuf, owner: String, file: File) -> Claim {
        let (over, end) = channel::<()>();
        let touch = move || {
            while end.recv_timeout(TOUCH_INTERVAL) == Err(RecvTimeoutError::Timeout) {
                // If this touch fails, the next may succeed.
                let _ = touch(&file);
            }
        };
        Claim { path, owner, over: Some(over), toucher: std::thread::Builder::new().spawn(touch).ok() }
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.over = None;
        if let Some(toucher) = self.toucher.take() {
            let _ = toucher.join();
        }
        // Another process may have taken over the claim.
        if read(&self.path).ok().flatten().is_some_and(|(holder, _)| holder == self.owner) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Sets the modification time of a file to the server's current time by rewriting its first byte.
fn touch(mut file: &File) -> io::Result<()> {
    let mut first = [0];
    file.rewind()?;
    file.read_exact(&mut first)?;
    file.rewind()?;
    file.write_all(&first)?;
    file.sync_all()
}

/// The text of a claim's file and its modification time; `None` if there is no claim.
fn read(path: &Path) -> io::Result<Option<(String, SystemTime)>> {
    let read = || {
        let file = files::open(path)?;
        let touched = file.metadata()?.modified()?;
        let mut bytes = Vec::new();
        file.take(MAX_BYTES).read_to_end(&mut bytes)?;
        Ok((String::from_utf8_lossy(&bytes).into_owned(), touched))
    };
    match read() {
        Err(cause) if io::Error::kind(&cause) == io::ErrorKind::NotFound => Ok(None),
        read => read.map(Some),
    }
}

/// Time since a claim's file was touched, by the server's clock.
fn age(path: &Path, touched: SystemTime) -> io::Result<Duration> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let now = tempfile::tempfile_in(folder)?.metadata()?.modified()?;
    Ok(now.duration_since(touched).unwrap_or_default())
}

/// Whether the process that holds a claim has died: it is a process of this machine that does not exist, or it has not
/// touched the claim for [`MAX_AGE`].
fn is_dead(holder: &str, age: Duration) -> bool {
    let mut lines = holder.split('\n').skip(1);
    let of_here = lines.next() == Some(machine().as_str());
    age > MAX_AGE || lines.next().filter(|_| of_here).is_some_and(is_gone)
}

/// Whether no process has this number, or one that has ended.
fn is_gone(process: &str) -> bool {
    process.parse().is_ok_and(system::is_process_gone)
}

/// Whether a file holds the text of [`owner`], or nothing yet.
fn is_claim(text: &str) -> bool {
    let mut lines = text.lines();
    text.is_empty() || lines.next().is_some_and(|line| line.contains(", process ")) && lines.count() >= 2
}

/// Removes the claim of a finished frame if its owner has died before it could.
pub fn remove_dead(output: &Path) {
    let path = file(output);
    let Some((holder, touched)) = read(&path).ok().flatten() else { return };
    if is_claim(&holder) && age(&path, touched).is_ok_and(|age| is_dead(&holder, age)) {
        let _ = remove(&path, touched);
    }
}

/// Removes the claim's file of a dead process. Several processes may try this at once: under a lock, each checks that
/// the file is still the claim that it has read. On file systems without locks a frame may be rendered twice.
fn remove(path: &Path, touched: SystemTime) -> io::Result<()> {
    let removed = || {
        let file = File::open(path)?;
        let _ = system::lock(&file);
        let [own, there] = [system::open_file_id(&file)?, system::file_id(path)?];
        let same = own == there && file.metadata()?.modified()? == touched;
        if same { fs::remove_file(path) } else { Ok(()) }
    };
    match removed() {
        Err(cause) if io::Error::kind(&cause) == io::ErrorKind::NotFound => Ok(()),
        removed => removed,
    }
}

/// The text by which this process claims a frame: a line for people, the machine, the process, and the current time to
/// tell claims apart.
fn owner() -> String {
    let process = std::process::id();
    let moment = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default().as_nanos();
    format!("{}, process {process}\n{}\n{process}\n{moment}\n", system::host(), machine())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn make(path: &Path, owner: &str) -> Claimed {
        Claim::make(path.to_owned(), owner.into()).expect("the folder takes files")
    }

    /// A dangling link is an error, not an endless loop.
    #[test]
    fn links_are_no_claims() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.exr.claim");
        std::os::unix::fs::symlink("nowhere", &path).expect("a link");
        assert!(Claim::make(path, owner()).is_err());
    }

    /// A claim can be taken over if its owner does not exist, or has not touched it for long.
    #[test]
    fn claims_of_dead_owners_are_released() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.exr.claim");
        let first = make(&path, &owner());
        assert!(matches!(&first, Claimed::Here(_)));
        assert!(
            matches!(make(&path, "other\n"), Claimed::Elsewhere(by) if by.ends_with(&std::process::id().to_string()))
        );
        drop(first);
        assert!(!path.exists());
        // No process has this number.
        fs::write(&path, format!("here, process 0\n{}\n4194999\n", machine())).expect("it can be written");
        assert!(matches!(make(&path, &owner()), Claimed::Here(_)));
        assert!(!path.exists());
        let elsewhere = "there, process 7\nthere\n7\n";
        fs::write(&path, elsewhere).expect("it can be written");
        assert!(matches!(make(&path, &owner()), Claimed::Elsewhere(by) if by == "there, process 7"));
        let long_ago = SystemTime::UNIX_EPOCH;
        File::options()
            .write(true)
            .open(&path)
            .and_then(|file| file.set_modified(long_ago))
            .expect("it can be touched");
        let taken = make(&path, &owner());
        assert!(matches!(&taken, Claimed::Here(_)));
        // The former owner is alive after all, and leaves the new claim alone.
        drop(Claim { path: path.clone(), owner: elsewhere.into(), over: None, toucher: None });
        assert!(path.exists());
        assert_eq!(fs::read_dir(folder.path()).expect("it can be read").count(), 1);
    }

    /// Claims of processes of other users, and claims without a process number, count as alive.
    #[test]
    fn processes_of_others_are_alive() {
        let own = std::process::id().to_string();
        assert_eq!(["1", &own, "0", "-1", "x", "4194999"].map(is_gone), [false, false, false, false, false, true]);
    }

    /// A file that is no claim stays, however old it is.
    #[test]
    fn files_of_users_are_no_claims() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.exr.claim");
        fs::write(&path, "the client's claim\n").expect("it can be written");
        let old = File::options().write(true).open(&path).and_then(|file| file.set_modified(SystemTime::UNIX_EPOCH));
        old.expect("it can be touched");
        assert!(Claim::make(path.clone(), owner()).is_err());
        remove_dead(&folder.path().join("a.exr"));
        assert!(path.exists());
    }

    #[test]
    fn a_touch_sets_the_current_time() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.exr.claim");
        fs::write(&path, "owner").expect("it can be written");
        let file = File::options().read(true).write(true).open(&path).expect("it is there");
        file.set_modified(SystemTime::UNIX_EPOCH).expect("it can be touched");
        let touched = |path: &Path| read(path).expect("it can be read").expect("it is there");
        assert!(age(&path, touched(&path).1).expect("a file can be made") > MAX_AGE);
        touch(&file).expect("it can be touched");
        assert_eq!(touched(&path).0, "owner");
        assert!(age(&path, touched(&path).1).expect("a file can be made") < MAX_AGE);
    }

    /// If several threads claim a new frame, or one whose owner has died, at the same time, one gets it.
    #[test]
    fn one_of_several_gets_a_frame() {
        let folder = tempfile::tempdir().expect("a folder");
        for round in 0..20 {
            let path = folder.path().join(format!("{round}.claim"));
            if round % 2 == 0 {
                fs::write(&path, format!("here, process 0\n{}\n4194999\n", machine())).expect("it can be written");
            }
            let got = AtomicUsize::new(0);
            std::thread::scope(|scope| {
                let ask = |i: usize| {
                    let claimed = make(&path, &format!("{}{i}\n", owner()));
                    got.fetch_add(usize::from(matches!(&claimed, Claimed::Here(_))), Ordering::Relaxed);
                    // Keeps the claim until all threads have tried.
                    claimed
                };
                let asking: Vec<_> = (0..8).map(|i| scope.spawn(move || ask(i))).collect();
                let claims: Vec<Claimed> = asking.into_iter().map(|one| one.join().expect("it ends")).collect();
                assert_eq!(got.load(Ordering::Relaxed), 1, "round {round}");
                drop(claims);
            });
        }
    }
}
