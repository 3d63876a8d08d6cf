//! Claims of frames, by which machines that share a folder share its frames out.
//!
//! A claim is a file beside the output, made by whoever comes first, which file systems let one alone do, NFS included.
//! It names its owner and is touched as long as that lives; where it is not, its owner has died, and the next one takes
//! the frame. Ages are differences of times that the file's own server has given: clocks of machines differ.

use caustique::error::{Error, Result};
use caustique::image::atomic;
use rustix::io::Errno;
use rustix::process::{Pid, test_kill_process};
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime};

/// Time between two touches of a claim.
const TOUCH: Duration = Duration::from_secs(15);
/// The owner of a claim that was not touched for so long has died: servers may show a file's time a minute late.
const DEAD: Duration = Duration::from_secs(180);
/// Most bytes of a claim that are read.
const MOST: u64 = 1 << 12;

/// What came of asking for a frame.
pub enum Claimed {
    /// It is ours.
    Here(Claim),
    /// Somebody else renders it: on what machine, by what process.
    Elsewhere(String),
}

/// A frame that is ours until this is dropped.
pub struct Claim {
    path: PathBuf,
    owner: String,
    over: Option<Sender<()>>,
    toucher: Option<JoinHandle<()>>,
}

impl Claim {
    /// Claims the frame whose output this is.
    ///
    /// # Errors
    /// The folder takes no files.
    pub fn of(output: &Path) -> Result<Claimed> {
        let mut path = output.as_os_str().to_owned();
        path.push(".claim");
        let path = PathBuf::from(path);
        atomic::check_writable(output)?;
        Claim::make(path, owner()).map_err(|cause| Error::io(output, &cause))
    }

    fn make(path: PathBuf, owner: String) -> io::Result<Claimed> {
        loop {
            match File::options().read(true).write(true).create_new(true).open(&path) {
                Ok(mut file) => {
                    file.write_all(owner.as_bytes())?;
                    file.sync_all()?;
                    return Ok(Claimed::Here(Claim::kept(path, owner, file)));
                }
                Err(cause) if cause.kind() == io::ErrorKind::AlreadyExists => {}
                Err(cause) => return Err(cause),
            }
            // A link or a pipe is nobody's claim, and opening it may not end.
            if fs::symlink_metadata(&path).is_ok_and(|data| !data.is_file()) {
                return Err(io::Error::other(format!("{} is no file", path.display())));
            }
            // Gone meanwhile: once more.
            let Some((holder, touched)) = read(&path)? else { continue };
            if !is_dead(&holder, age(&path, touched)?) {
                let shown = holder.split('\n').next().unwrap_or_default();
                return Ok(Claimed::Elsewhere(if shown.is_empty() { "another machine".into() } else { shown.into() }));
            }
            match remove(&path, touched) {
                // Another user's, in a folder that lets nobody else remove it.
                Err(cause) if cause.kind() == io::ErrorKind::PermissionDenied => {
                    return Ok(Claimed::Elsewhere("another user".into()));
                }
                removed => removed?,
            }
        }
    }

    /// Touches the file until the claim is dropped.
    fn kept(path: PathBuf, owner: String, file: File) -> Claim {
        let (over, end) = channel::<()>();
        let touch = move || {
            while end.recv_timeout(TOUCH) == Err(RecvTimeoutError::Timeout) {
                // The server's own time, and the next touch may succeed where this one fails.
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
        // Unless somebody has taken us for dead.
        if read(&self.path).ok().flatten().is_some_and(|(holder, _)| holder == self.owner) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Gives a file the time that its server has now: a write does, even of the byte that is there.
fn touch(file: &File) -> io::Result<()> {
    let mut first = [0];
    file.read_exact_at(&mut first, 0)?;
    file.write_all_at(&first, 0)?;
    file.sync_all()
}

/// What a claim says and when it was touched; `None` where there is none.
fn read(path: &Path) -> io::Result<Option<(String, SystemTime)>> {
    let read = || {
        let file = File::open(path)?;
        let touched = file.metadata()?.modified()?;
        let mut bytes = Vec::new();
        file.take(MOST).read_to_end(&mut bytes)?;
        Ok((String::from_utf8_lossy(&bytes).into_owned(), touched))
    };
    match read() {
        Err(cause) if io::Error::kind(&cause) == io::ErrorKind::NotFound => Ok(None),
        read => read.map(Some),
    }
}

/// How long ago a claim was touched, by its server's clock.
fn age(path: &Path, touched: SystemTime) -> io::Result<Duration> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let now = tempfile::tempfile_in(folder)?.metadata()?.modified()?;
    Ok(now.duration_since(touched).unwrap_or_default())
}

/// Whether the owner of a claim has died: a process of this machine that is not there, or any that does not touch it.
fn is_dead(holder: &str, age: Duration) -> bool {
    let mut lines = holder.split('\n').skip(1);
    let of_here = lines.next() == Some(machine().as_str());
    age > DEAD || lines.next().filter(|_| of_here).is_some_and(is_gone)
}

/// Whether there is no process of a number. One that may not be signalled is there, though `/proc` may hide it.
fn is_gone(process: &str) -> bool {
    let process = process.parse().ok().filter(|process| *process > 0).and_then(Pid::from_raw);
    process.is_some_and(|process| test_kill_process(process) == Err(Errno::SRCH))
}

/// Removes a claim whose owner has died. Of several that do so at once the lock lets one after the other look whether
/// it is still the claim that was read; where a file system has no locks, a frame may be rendered twice.
fn remove(path: &Path, touched: SystemTime) -> io::Result<()> {
    let removed = || {
        let file = File::open(path)?;
        let _ = file.lock();
        let [own, there] = [file.metadata()?, fs::metadata(path)?];
        let same = (own.dev(), own.ino(), own.modified()?) == (there.dev(), there.ino(), touched);
        if same { fs::remove_file(path) } else { Ok(()) }
    };
    match removed() {
        Err(cause) if io::Error::kind(&cause) == io::ErrorKind::NotFound => Ok(()),
        removed => removed,
    }
}

/// Who we are: a line for people, the machine, the process, and what no other claim has.
fn owner() -> String {
    let process = std::process::id();
    let moment = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default().as_nanos();
    format!("{}, process {process}\n{}\n{process}\n{moment}\n", host(), machine())
}

/// The machine since it was started, and whose processes are seen: containers of one machine have numbers of their own.
fn machine() -> String {
    let boot = fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    let namespace = fs::read_link("/proc/self/ns/pid").unwrap_or_default();
    format!("{} {} {}", host(), boot.trim(), namespace.display())
}

/// What the machine is called.
fn host() -> String {
    fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default().trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn make(path: &Path, owner: &str) -> Claimed {
        Claim::make(path.to_owned(), owner.into()).expect("the folder takes files")
    }

    /// A link that leads nowhere is no claim: an error, and no loop without an end.
    #[test]
    fn links_are_no_claims() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.exr.claim");
        std::os::unix::fs::symlink("nowhere", &path).expect("a link");
        assert!(Claim::make(path, owner()).is_err());
    }

    /// An owner that lives is not disturbed; one that is gone, or silent for long, is followed.
    #[test]
    fn claims_of_the_dead_are_released() {
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
        // Its old owner lives after all, and leaves the new one's alone.
        drop(Claim { path: path.clone(), owner: elsewhere.into(), over: None, toucher: None });
        assert!(path.exists());
        assert_eq!(fs::read_dir(folder.path()).expect("it can be read").count(), 1);
    }

    /// Processes that are there are alive, also those of others; what is no number tells nothing.
    #[test]
    fn processes_of_others_are_alive() {
        let own = std::process::id().to_string();
        assert_eq!(["1", &own, "0", "-1", "x", "4194999"].map(is_gone), [false, false, false, false, false, true]);
    }

    /// A touch is a new time.
    #[test]
    fn a_touch_is_seen() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.exr.claim");
        fs::write(&path, "owner").expect("it can be written");
        let file = File::options().read(true).write(true).open(&path).expect("it is there");
        file.set_modified(SystemTime::UNIX_EPOCH).expect("it can be touched");
        let touched = |path: &Path| read(path).expect("it can be read").expect("it is there");
        assert!(age(&path, touched(&path).1).expect("a file can be made") > DEAD);
        touch(&file).expect("it can be touched");
        assert_eq!(touched(&path).0, "owner");
        assert!(age(&path, touched(&path).1).expect("a file can be made") < DEAD);
    }

    /// Of many that ask at once, for a new frame or for one whose owner has died, one gets it.
    #[test]
    fn one_of_many_gets_a_frame() {
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
                    // Nobody lets go before all have asked.
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
