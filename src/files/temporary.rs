//! Files that appear completely or not at all: written as `.FILE.tmp-HOST-PID-START-N`, synced, then renamed. START is
//! the time at which the process began, so leftovers differ from files of a live process that got the same number. A
//! large file is synced while more of it is written (`Disk`).

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use tempfile::TempDir;

use crate::system;

static NEXT: AtomicU64 = AtomicU64::new(0);

/// A temporary of another host, of a container, or on a system that does not state which processes run, is a leftover
/// when it was not written to for a day.
const OLD: Duration = Duration::from_hours(24);

/// Bytes written and hashed at once: BLAKE3 takes sixteen blocks of 1 KiB in parallel, and large writes are few.
const AT_ONCE: usize = 256 << 10;

/// Bytes that are written before they are synced to the disk.
const UNTIL_DISK: u64 = 16 << 20;

/// A file under a temporary name; removed when dropped.
#[derive(Debug)]
pub struct Temporary {
    path: PathBuf,
    file: BufWriter<Digested>,
}

#[derive(Debug)]
struct Digested {
    file: File,
    hasher: blake3::Hasher,
    disk: Disk,
}

#[derive(Debug, Default)]
struct Disk {
    waiting: u64,
    at_work: Option<JoinHandle<io::Result<()>>>,
}

impl Disk {
    /// Notes that more bytes were written, and begins a sync when there are enough.
    fn wrote(&mut self, bytes: usize, file: &File) -> io::Result<()> {
        self.waiting += bytes as u64;
        let busy = self.at_work.as_ref().is_some_and(|work| !work.is_finished());
        if self.waiting < UNTIL_DISK || busy {
            return Ok(());
        }
        self.finish()?;
        self.waiting = 0;
        let file = file.try_clone()?;
        self.at_work = Some(std::thread::spawn(move || file.sync_data()));
        Ok(())
    }

    /// Waits for the sync under way. The system reports an error only once, so it must not be lost here.
    fn finish(&mut self) -> io::Result<()> {
        let work = self.at_work.take().map(JoinHandle::join);
        work.map_or(Ok(()), |done| done.unwrap_or_else(|_| Err(io::Error::other("a thread ended"))))
    }
}

impl Temporary {
    /// Opens a temporary next to `target`, whose folder must exist.
    pub fn beside(target: &Path) -> io::Result<Self> {
        let file_name = target.file_name().expect("a lake's files have names").to_string_lossy();
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let name = format!(".{file_name}.tmp-{}-{number}", Owner::this_process().suffix());
        let path = target.with_file_name(name);
        let file = File::options().write(true).create_new(true).open(&path)?;
        let digested = Digested { file, hasher: blake3::Hasher::new(), disk: Disk::default() };
        let file = BufWriter::with_capacity(AT_ONCE, digested);
        Ok(Self { path, file })
    }

    #[cfg(feature = "s3")]
    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn bytes(&self) -> io::Result<u64> {
        Ok(self.path.metadata()?.len())
    }

    /// Syncs everything to the disk, still under the temporary name, and returns the BLAKE3 digest, hexadecimal.
    pub fn sync(&mut self) -> io::Result<String> {
        self.file.flush()?;
        let Digested { file, hasher, disk } = self.file.get_mut();
        disk.finish()?;
        file.sync_all()?;
        Ok(hasher.finalize().to_hex().to_string())
    }

    /// Renames it to `target`, whether or not that exists.
    pub fn replace(self, target: &Path) -> io::Result<()> {
        fs::rename(&self.path, target)?;
        sync_folder(target)
    }

    /// Becomes `target` if that does not exist yet; of several that try at once exactly one succeeds.
    pub fn create(self, target: &Path) -> io::Result<bool> {
        match fs::hard_link(&self.path, target) {
            Ok(()) => sync_folder(target).map(|()| true),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(false),
            Err(error) => Err(error),
        }
    }
}

impl Write for Digested {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.hasher.update(&bytes[..written]);
        self.disk.wrote(written, &self.file)?;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Write for Temporary {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        // After a rename it is gone already; where removing fails, the next cleaning tries again.
        let _ = fs::remove_file(&self.path);
    }
}

fn sync_folder(target: &Path) -> io::Result<()> {
    system::sync_folder(target.parent().expect("a lake's files are in folders"))
}

/// Removes temporaries whose process on this host is gone, and old ones of processes of which that is unknown.
pub fn remove_stale(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut removed = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let gone = Owner::of_temporary(&name).is_some_and(|owner| {
            owner.is_gone() || (!owner.is_known() && is_old(&path).unwrap_or(false))
        });
        if gone && removed_now(&path)? {
            removed.push(path);
        }
    }
    removed.sort();
    Ok(removed)
}

/// Whether the file has not been written to for so long that no process can be writing it.
fn is_old(path: &Path) -> io::Result<bool> {
    let age = fs::metadata(path)?.modified()?.elapsed();
    Ok(age.is_ok_and(|age| age > OLD))
}

/// Removes a file; of two processes that do, one gets `true`.
pub(crate) fn removed_now(path: &Path) -> io::Result<bool> {
    match fs::remove_file(path) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

/// Under the system's temporary directory, removed when dropped, or by [`clean_folders`] after an interruption.
pub fn folder(of: &str) -> io::Result<TempDir> {
    // A number or letters follow, without a dash.
    let prefix = format!(".{of}.tmp-{}-", Owner::this_process().suffix());
    tempfile::Builder::new().prefix(&prefix).tempdir()
}

/// Removes such folders of processes that are gone, where the system allows it; errors are ignored.
pub fn clean_folders(of: &str) {
    let entries = fs::read_dir(std::env::temp_dir());
    for entry in entries.into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let is_ours = name.starts_with(&format!(".{of}.tmp-"));
        if is_ours && Owner::of_temporary(&name).is_some_and(|owner| owner.is_gone()) {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

#[derive(Debug, PartialEq, Eq)]
pub struct Owner {
    host: String,
    pid: u32,
    start: u64,
}

impl Owner {
    fn this_process() -> Self {
        let pid = std::process::id();
        Self { host: host(), pid, start: start_of(pid).unwrap_or(0) }
    }

    fn suffix(&self) -> String {
        format!("{}-{}-{}", self.host, self.pid, self.start)
    }

    pub fn of_temporary(file_name: &str) -> Option<Self> {
        let (_, suffix) = file_name.strip_prefix('.')?.rsplit_once(".tmp-")?;
        let parts: Vec<&str> = suffix.split('-').collect();
        let [host, pid, start, _number] = parts[..] else { return None };
        Some(Self { host: host.to_owned(), pid: pid.parse().ok()?, start: start.parse().ok()? })
    }

    /// Whether this system states if the process runs: not of other hosts, and only Linux has `/proc`.
    fn is_known(&self) -> bool {
        self.host == host() && start_of(std::process::id()).is_some()
    }

    /// Whether the process certainly no longer runs.
    fn is_gone(&self) -> bool {
        self.is_known() && start_of(self.pid) != Some(self.start)
    }
}

/// The name of this host, letters and digits only.
pub fn host() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    name.chars().filter(char::is_ascii_alphanumeric).take(24).collect()
}

/// Ticks since the system started: field 22 of `stat`, after a name that may hold spaces.
fn start_of(pid: u32) -> Option<u64> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    stat.rsplit_once(") ")?.1.split(' ').nth(19)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(folder: &Path) -> Vec<String> {
        let name =
            |entry: io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
        let mut names: Vec<_> = fs::read_dir(folder).unwrap().map(name).collect();
        names.sort();
        names
    }

    #[test]
    fn nothing_stands_under_the_name_until_all_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("table");
        fs::write(&target, "old").unwrap();
        let mut temporary = Temporary::beside(&target).unwrap();
        temporary.write_all(b"half").unwrap();
        drop(temporary);
        assert_eq!(fs::read_to_string(&target).unwrap(), "old");
        assert_eq!(files(folder.path()), ["table"], "given up, the temporary is removed");
    }

    #[test]
    fn a_process_killed_before_the_rename_leaves_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("table");
        fs::write(&target, "old").unwrap();
        let mut temporary = Temporary::beside(&target).unwrap();
        temporary.write_all(b"whole").unwrap();
        temporary.sync().unwrap();
        // A killed process drops nothing.
        std::mem::forget(temporary);
        assert_eq!(fs::read_to_string(&target).unwrap(), "old");
        assert_eq!(
            files(folder.path()).len(),
            2,
            "the temporary is left, hidden from readers by its dot"
        );
        assert!(files(folder.path())[0].starts_with(".table.tmp-"));
    }

    #[test]
    fn a_file_that_goes_to_the_disk_in_pieces_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("table");
        let mut temporary = Temporary::beside(&target).unwrap();
        let piece: Vec<u8> = (0..=250).cycle().take(1 << 20).collect();
        let mut expected = blake3::Hasher::new();
        for _ in 0..40 {
            temporary.write_all(&piece).unwrap();
            expected.update(&piece);
        }
        assert!(temporary.file.get_ref().disk.at_work.is_some());
        let digest = temporary.sync().unwrap();
        assert_eq!(digest, expected.finalize().to_hex().as_str());
        temporary.replace(&target).unwrap();
        let written = fs::read(&target).unwrap();
        assert_eq!(blake3::hash(&written).to_hex().as_str(), digest);
    }

    #[test]
    fn of_two_that_create_one_wins() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("row");
        for (text, wins) in [("first", true), ("second", false)] {
            let mut temporary = Temporary::beside(&target).unwrap();
            temporary.write_all(text.as_bytes()).unwrap();
            assert_eq!(temporary.sync().unwrap(), blake3::hash(text.as_bytes()).to_hex().as_str());
            assert_eq!(temporary.create(&target).unwrap(), wins);
        }
        assert_eq!(fs::read_to_string(&target).unwrap(), "first");
        assert_eq!(files(folder.path()), ["row"]);
    }

    #[test]
    fn only_leftovers_of_processes_that_are_gone_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let mine = Owner::this_process();
        // The same process number, begun one tick earlier: another process, gone since.
        let gone = Owner { start: mine.start.wrapping_sub(1), ..Owner::this_process() };
        let elsewhere = Owner { host: "elsewhere".to_owned(), ..Owner::this_process() };
        let name = |owner: &Owner| format!(".run.parquet.tmp-{}-0", owner.suffix());
        let path = |owner: &Owner| folder.path().join(name(owner));
        for owner in [&mine, &gone, &elsewhere] {
            fs::write(path(owner), "half").unwrap();
        }
        fs::write(folder.path().join("run.parquet"), "whole").unwrap();
        let removed = remove_stale(folder.path()).unwrap();
        assert_eq!(removed, [path(&gone)]);
        assert_eq!(files(folder.path()).len(), 3);
        // Two days later: the file of another host is old; our own process still runs.
        for owner in [&mine, &elsewhere] {
            let file = File::options().write(true).open(path(owner)).unwrap();
            file.set_modified(std::time::SystemTime::now() - 2 * OLD).unwrap();
        }
        assert_eq!(remove_stale(folder.path()).unwrap(), [path(&elsewhere)]);
    }
}
