//! Renders strokes of the page offline: this program does it in another process, one stroke at a time.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use asperity_page::{Page, Rendered};
use tempfile::TempDir;

use crate::failure::clean;

/// Longest time that a render may take.
const LONGEST: Duration = Duration::from_secs(60);
/// How far the priority of a render lies below that of the run.
#[cfg(unix)]
const NICE: i32 = 10;

/// The render under way.
#[derive(Default)]
pub struct Renders(Option<Job>);

struct Job {
    child: Child,
    folder: TempDir,
    since: Instant,
}

impl Drop for Job {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Renders {
    /// Begins the render that a page wants, and answers the page when it is done. `args` gives the arguments
    /// of `asperity render` for files in a folder.
    pub fn poll(&mut self, page: &Page, args: impl FnOnce(&Path) -> Result<Vec<OsString>, String>) {
        if let Some(csv) = page.wants_rendered() {
            match Job::begin(&csv, args) {
                Ok(job) => self.0 = Some(job),
                Err(why) => page.rendered(Err(why)),
            }
        }
        let Some(result) = self.0.as_mut().and_then(Job::result) else { return };
        self.0 = None;
        page.rendered(result);
    }
}

impl Job {
    fn begin(csv: &str, args: impl FnOnce(&Path) -> Result<Vec<OsString>, String>) -> Result<Self, String> {
        let cannot = |e: io::Error| format!("The stroke cannot be rendered: {e}.");
        let folder = TempDir::new().map_err(cannot)?;
        let at = |name: &str| folder.path().join(name);
        fs::write(at("stroke.csv"), csv).map_err(cannot)?;
        let said = File::create(at("said.txt")).map_err(cannot)?;
        let mut command = Command::new(std::env::current_exe().map_err(cannot)?);
        command.arg("render").args(args(folder.path())?).arg("--quiet");
        for (option, file) in [("--input", "stroke.csv"), ("--out", "out.wav"), ("--report", "report.json")] {
            command.arg(option).arg(at(file));
        }
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(said);
        let child = command.spawn().map_err(cannot)?;
        #[cfg(unix)]
        // SAFETY: it takes numbers, and touches no memory of this process.
        unsafe {
            libc::setpriority(libc::PRIO_PROCESS, child.id(), NICE);
        }
        Ok(Self { child, folder, since: Instant::now() })
    }

    /// The result once it is there.
    fn result(&mut self) -> Option<Result<Rendered, String>> {
        let file = |name: &str| self.folder.path().join(name);
        match self.child.try_wait() {
            Ok(None) if self.since.elapsed() < LONGEST => None,
            Ok(None) => Some(Err(format!("The render took longer than {} s.", LONGEST.as_secs()))),
            Ok(Some(status)) if status.success() => {
                let read = || {
                    let report = serde_json::from_slice(&fs::read(file("report.json"))?)?;
                    Ok(Rendered { wav: fs::read(file("out.wav"))?, report })
                };
                Some(read().map_err(|e: io::Error| format!("The render cannot be read: {e}.")))
            }
            Ok(Some(_)) => {
                let said = fs::read_to_string(file("said.txt")).unwrap_or_default();
                Some(Err(said.lines().map(clean).collect::<Vec<_>>().join("\n")))
            }
            Err(e) => Some(Err(format!("The render is lost: {e}."))),
        }
    }
}
