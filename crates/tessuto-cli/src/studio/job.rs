//! The commands that run now: children of this program, one after the other, in the project folder. They write
//! into a log themselves and go on if this program is killed.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::commands::{self, Command};

/// How often it is asked whether a child has ended.
const BETWEEN_LOOKS: Duration = Duration::from_millis(40);
/// A child that was asked to stop and goes on for so long is killed; its checkpoints stay.
const GRACE: Duration = Duration::from_secs(20);

/// At most one job.
#[derive(Default)]
pub struct Jobs(Mutex<Option<Arc<Job>>>);

/// A job, running or ended.
pub struct Job {
    /// Name of the work it is for.
    pub work: String,
    /// Name of the step.
    pub step: &'static str,
    running: Mutex<bool>,
    stop: Mutex<Option<Instant>>,
}

impl Job {
    /// Whether it goes on.
    pub fn is_running(&self) -> bool {
        *lock(&self.running)
    }

    /// Asks it to stop.
    pub fn stop(&self) {
        lock(&self.stop).get_or_insert_with(Instant::now);
    }
}

impl Jobs {
    /// The latest job.
    pub fn latest(&self) -> Option<Arc<Job>> {
        lock(&self.0).clone()
    }

    /// Runs `commands` in `folder`, with what they say in `log`, until one fails.
    ///
    /// # Errors
    /// A sentence for the user: another job is running, or the log cannot be written.
    pub fn start(
        &self,
        (work, step): (&str, &'static str),
        commands: Vec<Command>,
        folder: PathBuf,
        log: &Path,
    ) -> Result<(), String> {
        let mut latest = lock(&self.0);
        if let Some(job) = latest.as_ref().filter(|job| job.is_running()) {
            return Err(format!("{} of {} is running: wait for it, or stop it", job.step, job.work));
        }
        let file = own_log(log).map_err(|e| format!("cannot write {}: {e}", log.display()))?;
        let Some(file) = file else {
            return Err(format!(
                "{step} of {work} is running, begun by another studio of this folder: wait for it"
            ));
        };
        let program =
            std::env::current_exe().map_err(|e| format!("the program does not find itself: {e}"))?;
        let job =
            Arc::new(Job { work: work.to_owned(), step, running: Mutex::new(true), stop: Mutex::default() });
        *latest = Some(job.clone());
        std::thread::spawn(move || {
            for command in &commands {
                if !run(&job, &program, command, &folder, &file) {
                    break;
                }
            }
            *lock(&job.running) = false;
        });
        Ok(())
    }
}

/// The log at `path`, emptied, and held: by this program, and by the commands that write into it, for as long as one of
/// them lives. `None` if those of another studio hold it, whose log would be lost, and who would seem to have ended as
/// these do.
fn own_log(path: &Path) -> std::io::Result<Option<File>> {
    // A link in its place is removed, not followed.
    if path.is_symlink() {
        std::fs::remove_file(path)?;
    }
    let file = OpenOptions::new().create(true).append(true).open(path)?;
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => return Ok(None),
        // Some file systems know no locks.
        Ok(()) | Err(TryLockError::Error(_)) => {}
    }
    file.set_len(0)?;
    Ok(Some(file))
}

/// Runs one command; whether the next one may follow.
fn run(job: &Job, program: &Path, command: &Command, folder: &Path, log: &File) -> bool {
    let say = |text: &str| {
        let mut log = log;
        // A full disk ends the commands too, and their messages.
        let _ = log.write_all(text.as_bytes());
    };
    say(&format!("$ {}\n", commands::shown(command)));
    let outputs = log.try_clone().and_then(|out| Ok((out, log.try_clone()?)));
    let child = outputs.and_then(|(out, err)| {
        let mut child = std::process::Command::new(program);
        child.args(command).current_dir(folder).stdin(Stdio::null()).stdout(out).stderr(err);
        child.spawn()
    });
    let ended = child.and_then(|mut child| watch(job, &mut child));
    let asked = lock(&job.stop).is_some();
    match &ended {
        Ok(status) if status.success() => say("= ok\n"),
        Ok(_) if asked => say("= stopped\n"),
        Ok(status) => say(&format!("= {status}\n")),
        Err(e) => say(&format!("error: the command cannot be run: {e}\n= failed\n")),
    }
    ended.is_ok_and(|status| status.success()) && !asked
}

fn watch(job: &Job, child: &mut Child) -> std::io::Result<std::process::ExitStatus> {
    let mut asked = false;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status);
        }
        let since = *lock(&job.stop);
        if let Some(since) = since {
            if !asked {
                asked = true;
                ask_to_stop(child)?;
            }
            if since.elapsed() > GRACE {
                child.kill()?;
            }
        }
        std::thread::sleep(BETWEEN_LOOKS);
    }
}

/// A run writes its checkpoint when it is asked; where it cannot be asked it is killed, and has the last one it wrote.
fn ask_to_stop(child: &mut Child) -> std::io::Result<()> {
    let asked = std::process::Command::new("kill").arg(child.id().to_string()).stdin(Stdio::null()).status();
    if cfg!(unix) && asked.is_ok_and(|status| status.success()) { Ok(()) } else { child.kill() }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_belongs_to_one_studio_while_its_commands_live() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.txt");
        std::fs::write(&path, "of before").unwrap();
        let mut own = own_log(&path).unwrap().unwrap();
        own.write_all(b"mine").unwrap();
        assert!(own_log(&path).unwrap().is_none());
        // As a command has it, after this program has gone.
        let of_command = own.try_clone().unwrap();
        drop(own);
        assert!(own_log(&path).unwrap().is_none());
        assert_eq!(std::fs::read(&path).unwrap(), b"mine");
        drop(of_command);
        assert!(own_log(&path).unwrap().is_some());
        #[cfg(unix)]
        {
            let link = folder.path().join("link.txt");
            std::os::unix::fs::symlink(&path, &link).unwrap();
            std::fs::write(&path, "mine").unwrap();
            assert!(own_log(&link).unwrap().is_some() && !link.is_symlink());
            assert_eq!(std::fs::read(&path).unwrap(), b"mine");
        }
    }
}
